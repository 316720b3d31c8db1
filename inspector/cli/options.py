"""Option types that several commands share, such as ranges, stages, frames and miscalibrations."""

from __future__ import annotations

import math
import re
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import click

from calibnet.geometry.types import Transform
from calibnet.methods.registry import CASCADE, METHODS
from calibnet.runtime.threads import cores
from inspector.record.contents import Coloring, Detail, Part

if TYPE_CHECKING:
    from calibnet.geometry import MiscalibrationRange

STAGE_COUNT = 5
FRAMES_PATTERN = re.compile(r"-?\d+|(-?\d+)?:(-?\d+)?(:-?[1-9]\d*)?")


class RangeType(click.ParamType["MiscalibrationRange"]):
    """``DEGREES/METRES``, for instance ``5/0.5``, parsed to a `MiscalibrationRange`."""

    name = "DEG/M"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> MiscalibrationRange:
        """Parse the text; a range is returned as it is."""
        from calibnet.errors import ConfigError
        from calibnet.geometry import MiscalibrationRange

        if isinstance(value, MiscalibrationRange):
            return value
        try:
            return MiscalibrationRange.parse(str(value))
        except ConfigError as error:
            self.fail(str(error), param, ctx)


class StagesType(click.ParamType[tuple[int, ...]]):
    """Stage numbers such as ``3-5``, ``3,5`` or ``4``, parsed to an ascending tuple."""

    name = "STAGES"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, ...]:
        """Parse the text; a tuple is returned as it is."""
        if isinstance(value, tuple):
            return value
        stages: set[int] = set()
        for part in str(value).split(","):
            match = re.fullmatch(r"\s*(\d+)\s*(?:-\s*(\d+)\s*)?", part)
            if match is None:
                self.fail(f"{value!r} is not a list of stages; write for instance 3-5, 3,5 or 4.", param, ctx)
            first, last = int(match[1]), int(match[2] or match[1])
            if not 1 <= first <= last <= STAGE_COUNT:
                self.fail(
                    f"{value!r} is not an ascending list of stages within 1-{STAGE_COUNT}; write for instance 3-5.",
                    param,
                    ctx,
                )
            stages.update(range(first, last + 1))
        return tuple(sorted(stages))


class FramesType(click.ParamType[str]):
    """A position or a Python slice, ``START:STOP:STEP``, which is checked and kept as text."""

    name = "FRAMES"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Check the form; whether the frames exist depends on the dataset."""
        text = str(value)
        if FRAMES_PATTERN.fullmatch(text) is None:
            self.fail(
                f"{text!r} is not a frame number or START:STOP:STEP; write for instance 7 or 0:100:5.", param, ctx
            )
        return text


class MiscalibrationType(click.ParamType["Transform"]):
    """``roll,pitch,yaw,x,y,z`` in degrees and metres, parsed to a 4x4 ``delta`` in the camera frame."""

    name = "ROLL,PITCH,YAW,X,Y,Z"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> Transform:
        """Parse the text; a matrix is returned as it is."""
        import numpy as np

        from calibnet.geometry import miscalibration

        if isinstance(value, np.ndarray):
            return value
        try:
            numbers = [float(part) for part in str(value).split(",")]
        except ValueError:
            numbers = []
        if len(numbers) != 6 or not all(math.isfinite(number) for number in numbers):
            self.fail(
                f"{value!r} is not a miscalibration; write six numbers, roll,pitch,yaw,x,y,z in degrees and metres.",
                param,
                ctx,
            )
        return miscalibration(numbers[:3], numbers[3:])


class QuantityType(click.ParamType[Any]):
    """A text, parsed by a function of `calibnet.geometry.prior`."""

    def __init__(self, name: str, parser: str) -> None:
        self.name, self.parser = name, parser

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Parse the text; a parsed value is returned as it is."""
        from calibnet.errors import ConfigError
        from calibnet.geometry import prior

        if not isinstance(value, str):
            return value
        try:
            return getattr(prior, self.parser)(value)
        except ConfigError as error:
            self.fail(str(error), param, ctx)


class PartsType(click.ParamType[frozenset[Part]]):
    """Names of `Part`, separated by commas."""

    name = "PART,PART"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> frozenset[Part]:
        """Check every name; a set is returned as it is."""
        if isinstance(value, frozenset):
            return value
        parts = [part.strip() for part in str(value).split(",")]
        unknown = [part for part in parts if part not in list(Part)]
        if unknown:
            self.fail(f"{unknown[0]!r} is not a part of a frame; choose from {', '.join(Part)}.", param, ctx)
        return frozenset(map(Part, parts))


class WordType(click.Choice[str]):
    """One of the words of an enumeration, parsed to its member."""

    def __init__(self, words: type[StrEnum]) -> None:
        super().__init__([str(word) for word in words])
        self.words = words

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> StrEnum:
        """Check the word; a member is returned as it is."""
        return value if isinstance(value, self.words) else self.words(super().convert(value, param, ctx))


class NumberRange(click.FloatRange):
    """A finite number within limits; click's own type lets NaN through."""

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Parse the text and check the limits."""
        number = float(super().convert(cast(float, value), param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number.", param, ctx)
        return number


class SeedType(click.ParamType[int]):
    """Seed of the random numbers, which recordings keep as a signed 64-bit number."""

    name = "N"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """Parse the text, or take a number as it is, and check the limits."""
        text = str(value)
        if re.fullmatch(r"\d{1,19}", text, re.ASCII) is None or int(text) >= 2**63:
            self.fail(f"{text!r} is not a whole number from 0 to {2**63 - 1}.", param, ctx)
        return int(text)


UNITS = {"KiB": 2**10, "MiB": 2**20, "GiB": 2**30, "KB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12}


class Size(click.ParamType[int]):
    """A number of bytes, written as ``30MiB``."""

    name = "size"

    def convert(self, value: str | int, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """Parse the text."""
        if isinstance(value, int):
            return value
        match = re.fullmatch(rf"(\d{{1,9}}(?:\.\d{{1,9}})?) ?({'|'.join(UNITS)})", value)
        if match is None:
            self.fail(f"{value!r} is not a valid size; write it as 30MiB or 4GB.", param, ctx)
        return int(float(match[1]) * UNITS[match[2]])


SIZE = Size()
SEED = SeedType()
CORES = cores()
THREADS = click.IntRange(1, CORES)
"""A number of CPU threads; torch ends the process at far too large a number."""
USUAL_THREADS = min(2, CORES)
"""Number of threads with which latencies are measured by default."""
RANGE = RangeType()
STAGES = StagesType()
FRAMES = FramesType()
PARTS = PartsType()
DETAIL = WordType(Detail)
COLORING = WordType(Coloring)
MISCALIBRATION = MiscalibrationType()
AXES = QuantityType("AXIS,AXIS", "parse_axes")
LENGTH = QuantityType("LENGTH", "parse_length")
ANGLE = QuantityType("ANGLE", "parse_angle")
TOLERANCE = QuantityType("ANGLE/LENGTH", "parse_tolerance")
FOLDER = click.Path(file_okay=False, path_type=Path)
"""A folder, which the command itself checks for existence."""
KNOWN_OPTIONS = (
    click.option(
        "--fix",
        type=AXES,
        help="Axes of the initial extrinsic that are exact: some of roll,pitch,yaw,x,y,z as in --miscalibrate, where "
        "x,y,z fix the camera's position relative to the LiDAR.",
    ),
    click.option(
        "--prior-translation", type=LENGTH, help="Standard deviation per axis to which the camera's position is known."
    ),
    click.option(
        "--prior-rotation", type=ANGLE, help="Standard deviation per axis to which the camera's rotation is known."
    ),
)
"""Options that state what is known of the initial extrinsic."""
METHOD_OPTIONS = (
    click.option(
        "--method",
        type=click.Choice((CASCADE, *METHODS.names())),
        default=CASCADE,
        show_default=True,
        help="Method to calibrate with. Only results of the cascade are judged.",
    ),
    click.option(
        "--masks",
        type=FOLDER,
        metavar="DIR",
        help="Masks for calib-anything: one folder per image, named like it, with one PNG per mask.  "
        "[default: segments of the image]",
    ),
    click.option("--intrinsics", is_flag=True, help="Let pcba adjust focal length and principal point as well."),
)
"""Options that choose the method of a calibration."""
