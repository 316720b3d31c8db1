"""Packs the frames of all sources, and the residuals of the stages, for `calibnet.training.packed` to read."""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from safetensors.torch import save_file
from torch import Tensor

from calibnet.cascade.loading import load_stage
from calibnet.datasets.frame import Frame
from calibnet.datasets.images.files import resize_image
from calibnet.errors import ConfigError
from calibnet.geometry import RANGES, transform_points
from calibnet.geometry.types import Transform
from calibnet.runtime.writing import Kind, write_whole
from calibnet.training.build import open_draws, open_frames
from calibnet.training.data import Source, training_sources
from calibnet.training.options import TrainingOptions
from calibnet.training.packed import FARTHEST_M, KEY, PATTERN, STEPS_PER_METRE, SourceOfPart
from calibnet.training.recipe import RECIPE, Recipe
from calibnet.weights.manifest import load_manifest

LARGEST_WIDTH = 1280
"""Largest width of a packed image, pixels; no augmentation needs more (`CameraRecipe.zoom`)."""
JPEG_QUALITY = 84
MARGIN_DEG = 20.0
"""Angle outside the image within which points are kept: a miscalibration may rotate them into it."""
Tracked = Callable[[Iterable[tuple[int, int]]], Iterable[tuple[int, int]]]
"""Passes on the frames to be packed one by one, and may show the progress."""


def pack_image(image: NDArray[np.uint8]) -> bytes:
    """Encode RGB ``[H, W, 3]`` as JPEG."""
    encoded, data = cv2.imencode(
        ".jpg", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
    )
    assert encoded
    return data.tobytes()


def pack_scan(points: NDArray[np.float32]) -> bytes:
    """Compress points ``[N, 4]`` whose coordinates are below `FARTHEST_M`."""
    steps = np.round(points[:, :3] * STEPS_PER_METRE).astype(np.int16)
    difference = np.diff(steps, axis=0, prepend=np.zeros((1, 3), np.int16))
    octets = difference.T.copy().view(np.uint8).reshape(3, -1, 2)  # low bytes apart from high ones, which hardly change
    intensity = np.round(points[:, 3].clip(0, 1) * 255).astype(np.uint8)
    return zlib.compress(octets.transpose(0, 2, 1).tobytes() + intensity.tobytes(), 9)


def smaller(frame: Frame) -> Frame:
    """The frame reduced to the pixels and points that training needs."""
    camera = frame.camera
    if camera.width > LARGEST_WIDTH:
        camera = camera.resized(LARGEST_WIDTH, round(camera.height * LARGEST_WIDTH / camera.width))
        frame = replace(frame, image=resize_image(frame.image, camera), camera=camera)
    seen = np.linalg.inv(camera.matrix) @ np.array([[0, camera.width], [0, camera.height], [1, 1]])
    x, y, z = transform_points(frame.camera_from_lidar, frame.points[:, :3]).T
    sideways, down = np.degrees(np.arctan2(x, z)), np.degrees(np.arctan2(y, np.hypot(x, z)))
    (left, right), (top, bottom), _ = np.degrees(np.arctan(seen))
    kept = (sideways > left - MARGIN_DEG) & (sideways < right + MARGIN_DEG)
    kept &= (down > top - MARGIN_DEG) & (down < bottom + MARGIN_DEG)
    kept &= (np.abs(frame.points[:, :3]) < FARTHEST_M - 1).all(axis=1)
    return replace(frame, points=frame.points[kept])


@dataclass(frozen=True)
class Packed:
    """One frame in its packed form."""

    source: int
    image: bytes
    scan: bytes
    matrix: NDArray[np.float64]
    camera_from_lidar: Transform

    @classmethod
    def of(cls, source: int, frame: Frame) -> Packed:
        """Pack a frame of the source with this number."""
        frame = smaller(frame)
        return cls(
            source, pack_image(frame.image), pack_scan(frame.points), frame.camera.matrix, frame.camera_from_lidar
        )

    @property
    def size(self) -> int:
        """Approximate size in bytes."""
        return len(self.image) + len(self.scan) + 300


class Packer:
    """Writes parts of a bounded size, frame by frame."""

    def __init__(
        self, folder: Path, sources: list[Source], largest: int, residuals: Mapping[str, list[Transform]]
    ) -> None:
        """Start the first part, which also has the residuals.

        Args:
            folder: folder for the parts, without parts so far.
            sources: sources of the frames.
            largest: largest size of a part in bytes.
            residuals: residuals, 4x4 each, by the range of the stage that is trained on them, as text.

        Raises:
            ConfigError: the folder holds parts already.
        """
        if next(folder.glob(PATTERN.replace("{:03d}", "*")), None):
            raise ConfigError(f"{folder} holds packed frames already; give another folder, or remove them first.")
        self.folder, self.largest, self.parts, self.size = folder, largest, 0, 0
        self.about = [
            asdict(SourceOfPart(source.sequence.name, source.weight, source.synthetic, source.sequence.rig))
            for source in sources
        ]
        self.residuals = residuals
        self.frames: list[Packed] = []

    def add(self, frame: Packed) -> None:
        """Add a frame; if the part would become too large, write it first."""
        if self.frames and self.size + frame.size > self.largest:
            self.close()
        self.frames.append(frame)
        self.size += frame.size

    def close(self) -> None:
        """Write the frames of the last part."""
        if not self.frames:
            return
        tensors: dict[str, Tensor] = {}
        for name, packed in (("pictures", [f.image for f in self.frames]), ("scans", [f.scan for f in self.frames])):
            tensors[name] = torch.frombuffer(bytearray(b"".join(packed)), dtype=torch.uint8)
            tensors[f"{name}.ends"] = torch.tensor([len(data) for data in packed]).cumsum(0)
        tensors["sources"] = torch.tensor([frame.source for frame in self.frames])
        tensors["matrices"] = torch.from_numpy(np.stack([frame.matrix for frame in self.frames]))
        tensors["extrinsics"] = torch.from_numpy(np.stack([frame.camera_from_lidar for frame in self.frames]))
        if not self.parts:
            tensors |= {
                f"residuals.{stage}": torch.from_numpy(np.stack(deltas))
                for stage, deltas in self.residuals.items()
                if deltas
            }
        about = {KEY: json.dumps(self.about)}
        path = self.folder / PATTERN.format(self.parts)
        write_whole(path, lambda partial: save_file(tensors, partial, metadata=about), Kind.WEIGHTS)
        self.frames, self.size, self.parts = [], 0, self.parts + 1


def pack_training(
    options: TrainingOptions, folder: Path, largest: int, tracked: Tracked = iter, recipe: Recipe = RECIPE
) -> int:
    """Pack all frames that a run with these options would draw from.

    Args:
        options: options of the run: data, validation, synthetic share and scenes, seed. With ``after``, residuals are
            measured and packed too.
        folder: folder for the parts.
        largest: largest size of a part in bytes.
        tracked: shows the progress.
        recipe: how residuals are drawn and measured.

    Returns:
        The number of parts.

    Raises:
        ConfigError: there is nothing to train on, or the folder holds parts already.
        DatasetError: a frame cannot be read.
    """
    sources, _ = training_sources(options)
    residuals = stages_residuals(sources, options, recipe) if options.after else {}
    packer = Packer(folder, sources, largest, residuals)
    places = [(source, frame) for source, of in enumerate(sources) for frame in range(len(of.sequence))]
    np.random.default_rng(options.seed).shuffle(places)  # so that each part is a fair sample of all frames
    for source, frame in tracked(places):
        packer.add(Packed.of(source, sources[source].sequence[frame]))
    packer.close()
    return packer.parts


def stages_residuals(sources: list[Source], options: TrainingOptions, recipe: Recipe) -> dict[str, list[Transform]]:
    """The residuals that each of the five stages is trained on: of the stages before it, and of its own first look."""
    residuals = {}
    manifest = load_manifest(options.preset, Path(options.after or ""))
    for number, stage_range in enumerate(RANGES, start=1):
        of_stage = replace(options, range=str(stage_range))
        stage = load_stage(number, manifest, Path(options.after or ""))
        if stage is not None:
            frames = open_frames(sources, recipe, stage, of_stage)
            residuals[str(stage_range)] = list(open_draws(of_stage, recipe, frames, stage, stage.network).residuals)
    return residuals
