"""The published datasets with many sequences below one folder: how a sequence is named, and which files are its own.

Commands, lists of drives, ``evaluate --sequences`` and ``train --data list:...`` all read `PUBLISHED`.
"""

from __future__ import annotations

import glob
import re
from dataclasses import dataclass
from typing import Any

from calibnet.errors import ConfigError


@dataclass(frozen=True, kw_only=True)
class Published:
    """A dataset that holds many sequences below one folder.

    Attributes:
        command: name of its command of `calib-inspect`.
        parts: options of the dataset that say which sequence; its name has them with slashes in between.
        example: such a name; the parts that it has are needed.
        whole: the name that an empty one stands for; None where one is needed.
        files: patterns, below the dataset's folder, of the files that belong to one sequence.
        one_mount: whether all frames of a sequence have the same extrinsic.
    """

    command: str
    parts: tuple[str, ...]
    example: str
    whole: str | None = None
    files: tuple[str, ...]
    one_mount: bool = True

    def named(self, text: str) -> dict[str, str]:
        """The dataset's options for the name of a sequence.

        Raises:
            ConfigError: the name has too few or too many parts.
        """
        text = text or self.whole or ""
        if not text and self.whole is not None:
            return {}
        words = re.split(r"[/\s]", text.strip())
        if not (self.example.count("/") < len(words) <= len(self.parts) and all(words)):
            form = "/".join(self.parts).upper()
            raise ConfigError(f"Sequence {text!r} is not {form}; give for instance {self.example}.")
        return dict(zip(self.parts, words, strict=False))

    def files_of(self, text: str, camera: str = "") -> tuple[str, ...]:
        """Patterns, below the dataset's folder, of the files that a sequence is made of."""
        parts = {"camera": camera or "*"} | {name: glob.escape(part) for name, part in self.named(text).items()}
        return tuple(pattern.format(**parts) for pattern in self.files)


PUBLISHED = {
    "kitti-odometry": Published(command="seq", parts=("sequence",), example="04", files=("sequences/{sequence:0>2}",)),
    "kitti-raw": Published(
        command="raw",
        parts=("date", "drive"),
        example="2011_09_26/0005",
        files=("{date}/{date}_drive_{drive:0>4}_*", "{date}/calib_*.txt"),
    ),
    "kitti-object": Published(
        command="object",
        parts=("split",),
        example="training",
        whole="training",
        files=("",),
        one_mount=False,
    ),
    "kitti-tracking": Published(
        command="tracking",
        parts=("sequence",),
        example="0004",
        files=("training/*/{sequence:0>4}", "training/*/{sequence:0>4}.txt"),
    ),
    "kitti-360": Published(
        command="kitti360",
        parts=("drive",),
        example="0003",
        files=("calibration", "data_?d_raw/*_drive_{drive:0>4}_sync"),
    ),
    "nuscenes": Published(
        command="nuscenes",
        parts=("scene", "camera"),
        example="scene-0061",
        whole="",
        files=("*/*.json", "samples/{camera}", "samples/LIDAR_TOP"),  # its names do not say of which scene they are
    ),
}
"""By the dataset's name."""


def options_of(dataset: str, sequence: str, camera: str) -> dict[str, Any]:
    """Options of `calibnet.datasets.open_sequence` for a sequence and a camera that are named in text.

    Args:
        dataset: one of `calibnet.datasets.dataset_names`.
        sequence: its name, which only a dataset of `PUBLISHED` reads.
        camera: name or number; empty for the dataset's own choice.

    Raises:
        ConfigError: the sequence's name has too few or too many parts.
    """
    if dataset not in PUBLISHED:
        return {"camera": camera} if camera else {}
    options: dict[str, Any] = {"camera": int(camera) if camera.isdecimal() else camera} if camera else {}
    return options | PUBLISHED[dataset].named(sequence)
