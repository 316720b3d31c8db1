"""Reads training frames packed into a few files, for machines that have neither datasets nor the synthetic world.

A GPU is often lent for minutes, without a network and with little installed. Packed frames are copied there in parts of
bounded size. Frames are spread over the parts at random, so each is useful without the others. Images are JPEGs no
larger than training needs. Scans keep the points that a miscalibrated camera might see, rounded to 4 mm and stored as
differences from point to point, which compress to a third. The residuals of the stages before (`Draws`) are packed too,
since measuring them would take longer than a short training.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from torch import Tensor

from calibnet.datasets.frame import Frame
from calibnet.datasets.images.files import decode_image
from calibnet.errors import DatasetError
from calibnet.geometry import MiscalibrationRange, PinholeCamera
from calibnet.geometry.types import Transform
from calibnet.runtime.reading import parse_json, require_file
from calibnet.runtime.schema import validated
from calibnet.runtime.text import one_line
from calibnet.training.data import Source

KEY = "calib-inspect-frames"
"""Key of the metadata that describes the sources of a part."""
PATTERN = "frames-{:03d}.safetensors"
STEPS_PER_METRE = 256
"""Resolution of packed points; 16 bits reach 128 m, farther points are left out."""
FARTHEST_M = 2**15 / STEPS_PER_METRE
LARGEST_BYTES = 4 << 30
"""Largest size of a part."""
LARGEST_SCAN = 1 << 28
"""Largest unpacked size of a scan in bytes: some forty million points."""
REMEDY = "pack them again"


def unpack_scan(data: bytes) -> NDArray[np.float32]:
    """Undo `calibnet.training.packing.pack_scan`: points ``[N, 4]``, rounded.

    Raises:
        ValueError: the data is cut short, or unpacks to more than `LARGEST_SCAN`.
    """
    unpacker = zlib.decompressobj()
    flat = np.frombuffer(unpacker.decompress(data, LARGEST_SCAN), np.uint8)
    if not unpacker.eof:
        raise ValueError("its scan is truncated or too large")
    octets = flat.reshape(7, len(flat) // 7)
    difference = octets[:6].reshape(3, 2, -1).transpose(0, 2, 1).copy().view(np.int16)[..., 0]
    points = np.empty((octets.shape[1], 4), np.float32)
    points[:, :3] = np.cumsum(difference, axis=1, dtype=np.int16).T / np.float32(STEPS_PER_METRE)
    points[:, 3] = octets[6] / np.float32(255)
    return points


class PackedSequence:
    """The packed frames of one source, from all parts that were read."""

    def __init__(self, name: str, rig: str) -> None:
        self.name, self.rig = name, rig
        self._frames: list[tuple[Part, int]] = []

    def take(self, part: Part, position: int) -> None:
        """Add the frame at this position of a part."""
        self._frames.append((part, position))

    def __len__(self) -> int:
        return len(self._frames)

    def __iter__(self) -> Iterator[Frame]:
        return (self[position] for position in range(len(self)))

    def __getitem__(self, position: int) -> Frame:
        """Unpack one frame."""
        part, number = self._frames[position]
        return part.frame(number, f"packed {self.name}")


@dataclass(frozen=True)
class SourceOfPart:
    """A part's description of one of its sources, see `Source`; ``rig`` is empty in parts of older versions."""

    name: str
    weight: Annotated[float, Interval(ge=0, le=1)]
    synthetic: bool
    rig: str = ""


@dataclass(frozen=True)
class Part:
    """One file of packed frames.

    Attributes:
        path: path of the file.
        sources: the sources of all parts.
        tensors: tensors by the names that `calibnet.training.packing.Packer` gives them.
    """

    path: Path
    sources: list[SourceOfPart]
    tensors: dict[str, Tensor]

    @classmethod
    def read(cls, path: Path) -> Part:
        """Read a part.

        Raises:
            DatasetError: the file is cut short, or not of packed frames.
        """
        tensors, about = _read_tensors(path)
        part = cls(path, validated(list[SourceOfPart], about, _origin(path), DatasetError, REMEDY), tensors)
        if not part._is_whole():
            raise DatasetError(f"{_origin(path)} do not fit together; {REMEDY}.")
        return part

    def _is_whole(self) -> bool:
        tensors = self.tensors
        count = len(tensors.get("sources", ()))
        shapes = {"sources": (count,), "matrices": (count, 3, 3), "extrinsics": (count, 4, 4)}
        for name in ("pictures", "scans"):
            shapes[f"{name}.ends"] = (count,)
        if not count or any(name not in tensors or tensors[name].shape != shape for name, shape in shapes.items()):
            return False
        ends = [(tensors[f"{name}.ends"], tensors.get(name)) for name in ("pictures", "scans")]
        whole = all(of is not None and bool((end.diff() > 0).all()) and int(end[-1]) == len(of) for end, of in ends)
        return whole and int(tensors["sources"].min()) >= 0 and int(tensors["sources"].max()) < len(self.sources)

    def frame(self, number: int, source: str) -> Frame:
        """Unpack one frame; ``source`` names it.

        Raises:
            DatasetError: the image or the scan is damaged.
        """
        matrix, extrinsic = (self.tensors[name][number].numpy() for name in ("matrices", "extrinsics"))
        try:
            image = decode_image(self._piece("pictures", number))
            points = unpack_scan(self._piece("scans", number))
        except (zlib.error, ValueError) as error:
            raise DatasetError(f"Frame {number} of {self.path} is damaged ({one_line(error, 200)}).") from None
        camera = PinholeCamera(image.shape[1], image.shape[0], matrix)
        return Frame(number, 0.0, image, points, camera, extrinsic, source)

    def _piece(self, name: str, number: int) -> bytes:
        ends = self.tensors[f"{name}.ends"]
        start, end = int(ends[number - 1]) if number else 0, int(ends[number])
        return self.tensors[name][start:end].numpy().tobytes()


def read_packed(folder: Path) -> list[Source]:
    """The sources of training frames in the parts of a folder.

    Raises:
        DatasetError: the folder has no parts, or one cannot be read.
    """
    parts = [Part.read(path) for path in _parts(folder)]
    sequences = [PackedSequence(source.name, source.rig or source.name) for source in parts[0].sources]
    for part in parts:
        if part.sources != parts[0].sources:
            raise DatasetError(
                f"{part.path} belongs to another packing than {parts[0].path}; keep one packing per folder."
            )
        for position, number in enumerate(part.tensors["sources"].tolist()):
            sequences[number].take(part, position)
    return [
        Source(sequence, about.weight, about.synthetic)
        for sequence, about in zip(sequences, parts[0].sources, strict=True)
        if len(sequence)
    ]


def packed_residuals(folder: Path, stage: MiscalibrationRange) -> list[Transform]:
    """The residuals packed with the frames for a stage, 4x4 each; empty if there are none.

    Raises:
        DatasetError: the folder has no parts, or one cannot be read.
    """
    name = f"residuals.{stage}"
    return [delta for path in _parts(folder) for delta in _read_tensors(path, name)[0].get(name, ())]


def _origin(path: Path) -> str:
    return f"Packed training frames {path}"


def _read_tensors(path: Path, *names: str) -> tuple[dict[str, Tensor], Any]:
    """The tensors of these names in a part, or all of them, and the description of its sources."""
    require_file(path, _origin(path), LARGEST_BYTES, DatasetError, REMEDY)
    try:
        with safe_open(path, framework="pt") as file:
            there = [name for name in file.keys() if not names or name in names]  # noqa: SIM118 - not a dict
            tensors = {name: file.get_tensor(name) for name in there}
            about = parse_json((file.metadata() or {}).get(KEY, ""))
    except (SafetensorError, OSError, ValueError) as error:
        raise DatasetError(f"{_origin(path)} cannot be read ({one_line(error, 200)}); {REMEDY}.") from None
    return tensors, about


def _parts(folder: Path) -> list[Path]:
    paths = sorted(folder.glob(PATTERN.replace("{:03d}", "*")))
    if not paths:
        raise DatasetError(f"No packed training frames are in {folder}; make them with calib-inspect pack-training.")
    return paths
