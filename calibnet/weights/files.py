"""Reads and writes the weights of one stage."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from calibnet.errors import ConfigError, WeightsError
from calibnet.geometry import MiscalibrationRange
from calibnet.runtime.reading import parse_json, require_file
from calibnet.runtime.schema import validated
from calibnet.runtime.text import one_line
from calibnet.runtime.writing import Kind, write_whole
from calibnet.weights.manifest import PACKAGE, load_manifest

if TYPE_CHECKING:
    from _typeshed import DataclassInstance
    from torch import Tensor

    from calibnet.network.network import CalibrationNetwork

LARGEST_BYTES = 1 << 30
"""Largest size of a weights file; ours have 10 MB."""
HEADER = "calib-inspect"
MOVED = {"zooms", "rounds", "gains", "largest_match_error"}
"""Keys of older headers that have no effect, since the manifest determines how a network is used."""


def weights_path(preset: str, range_: MiscalibrationRange, folder: Path | None = None) -> Path:
    """Path of the weights of a preset's stage, in ``folder`` or in the package."""
    return (folder or PACKAGE) / load_manifest(preset, folder).file(range_)


class Saveable(Protocol):
    """A network, of any kind, that a weights file can store."""

    @property
    def config(self) -> DataclassInstance:
        """Configuration from which it is built."""
        ...

    @property
    def range(self) -> MiscalibrationRange:
        """Range that it was trained for."""
        ...


def save_network(path: Path, network: Saveable, state: dict[str, Tensor], record: dict[str, Any]) -> None:
    """Write ``state`` (half precision) with the network's config and the training record; atomic."""
    import torch
    from safetensors.torch import save_file

    range_ = network.range
    header = {
        "config": asdict(network.config),
        "range": str(range_),
        "record": record,
    }
    tensors = {
        name: tensor.detach().to("cpu", torch.float16 if tensor.is_floating_point() else None).contiguous()
        for name, tensor in _unique(state).items()
    }

    metadata = {HEADER: json.dumps(header)}
    write_whole(path, lambda partial: save_file(tensors, partial, metadata=metadata), Kind.WEIGHTS)


def _unique(state: dict[str, Tensor]) -> dict[str, Tensor]:
    """Drop the second name of tensors that two modules share, since safetensors stores each once."""
    seen: set[int] = set()
    return {name: t for name, t in state.items() if not (t.data_ptr() in seen or seen.add(t.data_ptr()))}  # type: ignore[func-returns-value]


@dataclass(frozen=True)
class Header:
    """Header of a weights file.

    Attributes:
        config: configuration of the network, as in a preset.
        range: range of the stage, in degrees and metres.
        record: training record.
    """

    config: dict[str, Any]
    range: str
    record: dict[str, Any]


def read_header(path: Path) -> Header:
    """The header of a weights file.

    Raises:
        WeightsError: the file is missing, truncated or not ours.
    """
    from safetensors import SafetensorError, safe_open

    if not path.exists():
        raise WeightsError(f"Weights {path} do not exist; train them with `calib-inspect train`.")
    require_file(path, "Weights", LARGEST_BYTES, WeightsError, "train them with `calib-inspect train`")
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
    except (SafetensorError, OSError) as error:
        said = one_line(error, 200)
        raise WeightsError(f"{path} is not a complete safetensors file ({said}); copy or train it again.") from None
    if HEADER not in metadata:
        raise WeightsError(f"{path} was not written by calib-inspect: its header has no {HEADER!r} entry.")
    origin = f"The {HEADER!r} entry in the header of {path}"
    try:
        content = parse_json(metadata[HEADER])
    except ValueError as error:
        raise WeightsError(f"{origin} is not JSON ({error}); copy or train it again.") from None
    return validated(Header, content, origin, WeightsError, "copy or train it again")


def read_record(path: Path) -> dict[str, Any]:
    """The training record: data, minutes, samples, seed, commit, validation figures."""
    return read_header(path).record


def load_network(path: Path) -> CalibrationNetwork:
    """Build the network of a weights file and load its weights; in evaluation mode, float32.

    Raises:
        WeightsError: the file is missing, truncated, foreign or does not fit its own config.
    """
    import torch
    from safetensors.torch import load_file

    from calibnet.network.config import parse_config
    from calibnet.network.network import CalibrationNetwork

    header = read_header(path)
    values = {key: value for key, value in header.config.items() if key not in MOVED}
    try:
        config, range_ = parse_config(values, f"The header of {path}"), MiscalibrationRange.parse(header.range)
        with torch.device("meta"):  # which takes no memory
            promised = CalibrationNetwork(config, range_).state_dict()
    except ConfigError as error:
        where = "" if str(path) in str(error) else f"{path}: "
        raise WeightsError(
            f"{where}{error} Use the version of calib-inspect that wrote it, or train it again."
        ) from None
    stored = load_file(path)
    tensors = {name: tensor.float() for name, tensor in stored.items() if not tensor.is_complex()}
    if config.share_extractor:  # stored only once
        for name in [name for name in tensors if name.startswith("features.image_trunk.")]:
            tensors[name.replace("image_trunk", "lidar_trunk")] = tensors[name]
    if {name: tensor.shape for name, tensor in promised.items()} != {name: t.shape for name, t in tensors.items()}:
        raise WeightsError(f"{path} does not fit the network of this version; train it again.")
    if not all(torch.isfinite(tensor).all() for tensor in tensors.values()):
        raise WeightsError(f"{path} contains numbers that are not finite; copy or train it again.")
    network = CalibrationNetwork(config, range_)
    network.load_state_dict(tensors)
    return network.eval()
