"""Reading and writing one stage's weights."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calibnet.errors import ConfigError, WeightsError
from calibnet.geometry import MiscalibrationRange
from calibnet.runtime.reading import require_file
from calibnet.runtime.writing import Kind, write_whole
from calibnet.weights.manifest import PACKAGE, load_manifest

if TYPE_CHECKING:
    from torch import Tensor

    from calibnet.network.network import CalibrationNetwork

LARGEST_BYTES = 1 << 30
"""Of a file of weights; ours have 10 MB."""
HEADER = "calib-inspect"
MOVED = {"zooms", "rounds", "gains", "largest_match_error"}
"""Keys of older headers that act no more: how a network is used is said by its manifest."""


def weights_path(preset: str, range_: MiscalibrationRange, folder: Path | None = None) -> Path:
    """Where the weights of a preset's stage lie: in ``folder``, or in the package."""
    return (folder or PACKAGE) / load_manifest(preset, folder).file(range_)


def save_network(path: Path, network: CalibrationNetwork, state: dict[str, Tensor], record: dict[str, Any]) -> None:
    """Write ``state`` (half precision) with the network's config and the training record; atomic."""
    import torch
    from safetensors.torch import save_file

    range_ = network.range
    header = {
        "config": asdict(network.config),
        "range": str(range_),
        "record": record,
    }
    tensors = {name: tensor.detach().to("cpu", torch.float16).contiguous() for name, tensor in _unique(state).items()}

    def write(partial: Path) -> None:
        save_file(tensors, partial, metadata={HEADER: json.dumps(header)})
        partial.chmod(0o644)  # safetensors keeps its files to their owner, which a package must not

    write_whole(path, write, Kind.WEIGHTS)


def _unique(state: dict[str, Tensor]) -> dict[str, Tensor]:
    """Drop the second name of tensors that two modules share: safetensors stores each once."""
    seen: set[int] = set()
    return {name: t for name, t in state.items() if not (t.data_ptr() in seen or seen.add(t.data_ptr()))}  # type: ignore[func-returns-value]


def read_header(path: Path) -> dict[str, Any]:
    """The header of a weights file: ``config``, ``range`` and ``record``.

    Raises:
        WeightsError: the file is missing, cut short or not ours.
    """
    from safetensors import SafetensorError, safe_open

    if not path.exists():
        raise WeightsError(f"There are no weights at {path}; train them with `calib-inspect train`.")
    require_file(path, "Weights", LARGEST_BYTES, WeightsError, "train them with `calib-inspect train`")
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
    except (SafetensorError, OSError) as error:
        raise WeightsError(f"{path} is not a complete safetensors file ({error}); copy or train it again.") from None
    if HEADER not in metadata:
        raise WeightsError(f"{path} was not written by calib-inspect: its header has no {HEADER!r} entry.")
    try:
        header: dict[str, Any] = json.loads(metadata[HEADER])
    except ValueError:
        header = {}
    if not header.keys() >= {"config", "range", "record"}:
        raise WeightsError(f"The {HEADER!r} entry in the header of {path} is not complete; copy or train it again.")
    return header


def read_record(path: Path) -> dict[str, Any]:
    """The training record: data, minutes, samples, seed, commit, validation figures."""
    record: dict[str, Any] = read_header(path)["record"]
    return record


def load_network(path: Path) -> CalibrationNetwork:
    """Build the network a weights file describes and fill it; in evaluation mode, float32.

    Raises:
        WeightsError: the file is missing, cut short, foreign or does not fit its own config.
    """
    from safetensors.torch import load_file

    from calibnet.network.config import parse_config
    from calibnet.network.network import CalibrationNetwork

    header = read_header(path)
    values = {key: value for key, value in header["config"].items() if key not in MOVED}
    try:
        config = parse_config(values, f"The header of {path}")
        network = CalibrationNetwork(config, MiscalibrationRange.parse(header["range"]))
    except ConfigError as error:
        raise WeightsError(f"{error} Use the version of calib-inspect that wrote it, or train it again.") from None
    tensors = {name: tensor.float() for name, tensor in load_file(path).items()}
    if config.share_extractor:  # stored once
        for name in [name for name in tensors if name.startswith("features.image_trunk.")]:
            tensors[name.replace("image_trunk", "lidar_trunk")] = tensors[name]
    try:
        network.load_state_dict(tensors)
    except RuntimeError:  # lists every name and shape
        raise WeightsError(f"{path} does not fit the network of this version; train it again.") from None
    return network.eval()
