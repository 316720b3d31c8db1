"""The options of a run, checked once and passed on as one object."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from calibnet.datasets.frame import Sequence
from calibnet.datasets.selection import evenly_spaced, select_frames
from calibnet.errors import ConfigError
from calibnet.geometry import MiscalibrationRange
from calibnet.geometry.prior import Prior
from calibnet.geometry.types import Transform
from calibnet.methods.registry import CASCADE
from inspector.record.contents import Coloring, Contents, Detail, Part
from inspector.run.start import Start

DEFAULT_RANGE = MiscalibrationRange(5, 0.5)


MANY_FRAMES = 200
"""Largest number of frames of which, by default, all are run and recorded in full detail."""
COST = {True: (0.6, 0.9), False: (0.9, 4.7)}
"""Seconds on two cores and megabytes per frame, including the drive's solution; for overview detail (True) and full."""


class OptionsError(ConfigError):
    """Options that contradict each other, or the data."""


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """Options of one calibration run.

    Attributes:
        sequence: frames to calibrate.
        frames: positions in the sequence, as `select_frames` reads them; None for all, or for `MANY_FRAMES` spread over
            a longer sequence.
        camera: camera of the rig, where the dataset has several.
        as_is: whether the sequence's extrinsic is the one to correct rather than a reference.
        range: range from which the miscalibration is drawn; None for `DEFAULT_RANGE`.
        miscalibration: miscalibration to use instead of drawing one.
        per_frame: whether to draw one for every frame instead of one for the run.
        seed: seed of the random numbers.
        drive: whether to solve the drive's extrinsic from all frames after the single ones; None for doing so with
            several frames on one mount.
        on_bad_frame: ``"skip"`` or ``"stop"`` at a frame that cannot be used.
        fix: axes of the initial extrinsic that are exact, from `calibnet.geometry.prior.AXES`; None for none.
        prior_translation: standard deviation, in metres, to which the camera's position is known.
        prior_rotation: standard deviation, in radians, to which its rotation is known.
        stages: stages to run; None for those whose range is within the miscalibration's.
        preset: name of the network.
        method: name of the method: `calibnet.methods.registry.CASCADE`, or one of its ``METHODS``.
        masks: folder of masks, for a method that uses some.
        intrinsics: whether to correct the camera's intrinsics as well, for a method that can.
        weights: folder of weights; None for those of the package.
        detail: how much of each frame to record; None for everything, or for what ``parts`` names.
        parts: parts to record with `Detail.CUSTOM`.
        color: colouring of the points over the image.
        labels: further properties of the run, for instance its car and drive in a fleet.

    Raises:
        OptionsError: two of them contradict each other.
    """

    sequence: Sequence
    frames: str | None = None
    camera: int | str | None = None
    as_is: bool = False
    range: MiscalibrationRange | None = None
    miscalibration: Transform | None = field(default=None, repr=False)
    per_frame: bool = False
    seed: int = 0
    drive: bool | None = None
    on_bad_frame: str = "skip"
    fix: tuple[str, ...] | None = None
    prior_translation: float | None = None
    prior_rotation: float | None = None
    stages: tuple[int, ...] | None = None
    preset: str = "compact"
    method: str = CASCADE
    masks: Path | None = None
    intrinsics: bool = False
    weights: Path | None = None
    detail: Detail | None = None
    parts: frozenset[Part] | None = None
    color: Coloring = Coloring.DEPTH
    labels: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for wrong, sentence in (
            (
                self.range is not None and self.miscalibration is not None,
                "Give --range or --miscalibrate, not both.",
            ),
            (
                self.miscalibration is not None and self.per_frame,
                "--per-frame draws from --range; leave --miscalibrate out, which is the same for all frames.",
            ),
            (
                bool(self.drive) and self.per_frame,
                "--drive needs one mount for all frames; leave --per-frame out, which moves it in each.",
            ),
            (
                self.as_is and self.color is Coloring.ERROR,
                f"--color error needs a reference, and {self.sequence.name} has none; give --range or --miscalibrate "
                "to take "
                "its calibration as the reference, or choose another --color.",
            ),
            (
                self.detail is not None and (self.detail is Detail.CUSTOM) != (self.parts is not None),
                "--detail custom needs --log, and --log needs --detail custom; give both or neither.",
            ),
            (
                self.method == CASCADE and (self.masks is not None or self.intrinsics),
                "--masks and --intrinsics apply to other methods; choose one with --method.",
            ),
            (
                self.method != CASCADE and (self.stages is not None or self.preset != "compact"),
                f"--stages and --preset apply to the cascade; leave them out with --method {self.method}.",
            ),
            (
                self.method != CASCADE and any((self.fix, self.prior_translation, self.prior_rotation)),
                "--fix, --prior-translation and --prior-rotation apply to the cascade; "
                f"leave them out with --method {self.method}.",
            ),
        ):
            if wrong:
                raise OptionsError(sentence)

    @property
    def _level(self) -> Detail:
        """The level of detail; that of ``parts`` where only they are given."""
        if self.detail is not None:
            return self.detail
        if self.parts is not None:
            return Detail.CUSTOM
        return Detail.OVERVIEW if len(self.positions) >= MANY_FRAMES else Detail.FULL

    @cached_property
    def positions(self) -> list[int]:
        """Positions of the frames to run.

        Raises:
            DatasetError: no frame is selected.
        """
        if self.frames is None and self.is_long:
            return evenly_spaced(len(self.sequence), MANY_FRAMES)
        return select_frames(self.sequence, self.frames or ":")

    @property
    def is_long(self) -> bool:
        """Whether the sequence has so many frames that by default only some are run."""
        return len(self.sequence) > MANY_FRAMES

    @property
    def expectation(self) -> str:
        """A sentence on the time and space that the run will take; empty for a short run."""
        count = len(self.positions)
        if count < MANY_FRAMES:
            return ""
        seconds, megabytes = (count * cost for cost in COST[self._level is Detail.OVERVIEW])
        some = ""
        if self.frames is None and self.is_long:
            some = f"{count} of its {len(self.sequence):,} frames, evenly spread (--frames : runs all). "
        level = " in overview detail (--detail full keeps everything)" if self.detail is None and not self.parts else ""
        return f"{some}This takes about {_minutes(seconds)} on two cores, and about {_size(megabytes)}{level}."

    @property
    def solves_drive(self) -> bool:
        """Whether the drive's extrinsic is solved after the frames."""
        return (len(self.positions) > 1 and not self.per_frame) if self.drive is None else self.drive

    @property
    def start(self) -> Start:
        """The initial extrinsics of the run."""
        return Start(self.range or DEFAULT_RANGE, self.seed, self.per_frame, self.miscalibration, self.as_is)

    @property
    def prior(self) -> Prior:
        """What is known of the initial extrinsic: from the options, else from the dataset (`known` of a sequence).

        Raises:
            ConfigError: the options contradict each other.
        """
        asked = self.fix or None, self.prior_translation, self.prior_rotation
        if any(one is not None for one in asked):
            return Prior.of(asked[0] or (), *asked[1:])
        return getattr(self.sequence, "prior", None) or Prior()

    @property
    def contents(self) -> Contents:
        """What to record of each frame."""
        return Contents.of(self._level, self.parts or frozenset(), self.color)

    @property
    def title(self) -> str:
        """Title of the recording."""
        of = "" if self.method == CASCADE else f", {self.method}"
        return f"{self.sequence.name}, {self.start}{of}"

    def identity(self, stages: list[int]) -> dict[str, Any]:
        """All options that affect the recorded data, as recordings keep them; ``stages`` are those that can run."""
        return {
            "sequence": self.sequence.name,
            "rig": self.sequence.rig,
            "frames": self.frames or (f"{MANY_FRAMES} spread over all" if self.is_long else ":"),
            "camera": "" if self.camera is None else str(self.camera),
            "start": str(self.start),
            "seed": self.seed,
            **({"known": self.prior.words} if self.prior else {}),
            "stages": ",".join(map(str, stages)),
            **({"preset": self.preset} if self.method == CASCADE else {"method": self.method}),
            **({"masks": str(self.masks)} if self.masks is not None else {}),
            **({"intrinsics": True} if self.intrinsics else {}),
            "detail": str(self.detail or (self._level if self.parts is None else Detail.FULL)),
            "parts": ",".join(sorted(self.contents.parts)),
            "color": str(self.color),
            "as_one_drive": self.solves_drive,
            **self.labels,
        }


def _minutes(seconds: float) -> str:
    minutes = max(1, round(seconds / 60))
    return "1 minute" if minutes == 1 else f"{minutes} minutes" if minutes < 120 else f"{minutes / 60:.0f} hours"


def _size(megabytes: float) -> str:
    return f"{megabytes:.0f} MB" if megabytes < 1000 else f"{megabytes / 1000:.1f} GB"
