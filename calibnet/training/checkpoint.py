"""Checkpoints of a training run: one safetensors file, replaced atomically, from which a run resumes exactly."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import torch
from annotated_types import Interval
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor, nn

from calibnet.errors import WeightsError
from calibnet.runtime.reading import parse_json, require_file
from calibnet.runtime.schema import validated
from calibnet.runtime.text import one_line
from calibnet.runtime.writing import write_whole

LARGEST_BYTES = 4 << 30
"""Largest checkpoint: weights, their average and two moments of each, in single precision."""
KEY = "calib-inspect-training"


def save_checkpoint(
    path: Path, model: nn.Module, average: nn.Module, optimizer: torch.optim.Optimizer, state: dict[str, Any]
) -> None:
    """Write everything a resumed run needs.

    Args:
        path: replaced only when the new file is complete.
        model: the network being trained.
        average: its exponential moving average.
        optimizer: AdamW; its moments are stored as tensors.
        state: numbers and texts, stored as JSON.
    """
    tensors: dict[str, Tensor] = {}
    for prefix, module in (("model", model), ("average", average)):
        tensors |= {f"{prefix}.{name}": tensor for name, tensor in module.state_dict().items()}
    for index, moments in optimizer.state_dict()["state"].items():
        tensors |= {f"optimizer.{index}.{name}": torch.as_tensor(value) for name, value in moments.items()}
    tensors = {name: tensor.detach().cpu().clone().contiguous() for name, tensor in tensors.items()}
    write_whole(path, lambda partial: save_file(tensors, partial, metadata={KEY: json.dumps(state)}))


@dataclass(frozen=True)
class State:
    """How far a run has come, and its options."""

    steps: Annotated[int, Interval(ge=0, le=10**12)]
    seconds: Annotated[float, Interval(ge=0, le=1e12)]
    options: dict[str, Any]


def read_checkpoint(path: Path) -> tuple[dict[str, Tensor], State]:
    """Tensors and state of a checkpoint.

    Raises:
        WeightsError: the file is cut short or not a checkpoint of a training run.
    """
    require_file(path, "Checkpoint", LARGEST_BYTES, WeightsError, "remove it to start again")
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - not a dict
    except (SafetensorError, OSError) as error:
        said = one_line(error, 200)
        raise WeightsError(f"Checkpoint {path} cannot be read ({said}); remove it to start again.") from None
    if KEY not in metadata:
        raise WeightsError(f"{path} is not a training checkpoint of calib-inspect; choose another --output folder.")
    origin, remedy = f"The state in checkpoint {path}", "remove it to start again"
    try:
        content = parse_json(metadata[KEY])
    except ValueError as error:
        raise WeightsError(f"{origin} is not JSON ({error}); {remedy}.") from None
    return tensors, validated(State, content, origin, WeightsError, remedy)


def restore(tensors: dict[str, Tensor], model: nn.Module, average: nn.Module, optimizer: torch.optim.Optimizer) -> None:
    """Load the tensors of a checkpoint into network, average and optimizer.

    Raises:
        WeightsError: they belong to another network.
    """

    def part(prefix: str) -> dict[str, Tensor]:
        return {name[len(prefix) :]: tensor for name, tensor in tensors.items() if name.startswith(prefix)}

    try:
        model.load_state_dict(part("model."))
        average.load_state_dict(part("average."))
        moments: dict[int, dict[str, Tensor]] = {}
        for name, tensor in part("optimizer.").items():
            index, _, key = name.partition(".")
            moments.setdefault(int(index), {})[key] = tensor
        optimizer.load_state_dict({"state": moments, "param_groups": optimizer.state_dict()["param_groups"]})
        for parameter, of in optimizer.state.items():  # a fused step needs moments laid out as weights
            for key, moment in of.items():
                if moment.shape == parameter.shape:
                    of[key] = torch.empty_like(parameter).copy_(moment)
    except (RuntimeError, ValueError, KeyError):  # lists every name and shape
        raise WeightsError("The checkpoint does not fit the network of this run; remove it to start again.") from None
