"""The manifest of a set of weights: how it is used, in one readable file, ``PRESET.toml`` beside its safetensors.

The networks' tensors are in the safetensors; how they are used (image size, looks, gain, largest match error) is only
here, to be read and changed in any editor.
"""

from __future__ import annotations

import math
import os
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Interval, Len, Predicate

from calibnet.errors import ConfigError, WeightsError
from calibnet.geometry import MiscalibrationRange
from calibnet.geometry.types import Matrix6
from calibnet.runtime.reading import parse_toml, read_text
from calibnet.runtime.schema import validated
from calibnet.runtime.text import one_line
from calibnet.runtime.writing import write_whole

PACKAGE = Path(__file__).parent
"""Folder of the weights that ship with the package."""


def _is_name(text: str) -> bool:
    """Whether a text is a file name without folders."""
    return Path(text).name == text and text.isprintable()


@dataclass(frozen=True)
class StageSettings:
    """Settings with which the network of a stage is used.

    Attributes:
        image_size: width and height of the stage's image, relative to the preset's input size. A wide range needs a
            search window that reaches far; a narrow one needs fractions of a cell.
        looks: largest number of looks of the stage, each at the scan projected anew.
        gain: factor on its corrections. Trained to minimise the average error, a network undershoots where it is
            uncertain, so that most of the remaining error is in the direction of its correction.
    """

    image_size: float = 1.0
    looks: int = 1
    gain: float = 1.0

    def __post_init__(self) -> None:
        if not (self.image_size > 0 and self.gain > 0 and self.looks >= 1):
            raise ConfigError(
                f"image_size ({self.image_size:g}) and gain ({self.gain:g}) must be positive, and looks ({self.looks}) "
                "at least 1."
            )


@dataclass(frozen=True)
class StageEntry:
    """Entry of a stage in a manifest.

    Attributes:
        range: range that its network was trained for.
        file: name of its weights file, in the manifest's folder.
        settings: settings with which it is used.
        run: number or name of its training run.
        recipe: the training run in a sentence.
        validation: errors of one look on the validation frames, as measured by `calibnet.training.validation`.
    """

    range: MiscalibrationRange
    file: str
    settings: StageSettings = field(default_factory=StageSettings)
    run: str = ""
    recipe: str = ""
    validation: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Manifest:
    """A set of weights: the stages of one preset, and settings common to all of them.

    Attributes:
        preset: name of the network's preset.
        match_error_limit_px: largest match error, in pixels of its image, that the finest stage may expect; beyond it,
            image and scan are taken not to fit together.
        common_rotation_deg: standard deviation per axis of the error that the networks make in all frames of a drive.
        common_translation_m: the same for the translation.
        stages: entries of the stages, in any order.
    """

    preset: str
    match_error_limit_px: float = math.inf
    common_rotation_deg: float = 0.12
    common_translation_m: float = 0.08
    stages: tuple[StageEntry, ...] = ()

    def settings(self, range_: MiscalibrationRange) -> StageSettings:
        """Settings of the stage of a range; the defaults if the set has no such stage."""
        return next((entry.settings for entry in self.stages if entry.range == range_), StageSettings())

    def file(self, range_: MiscalibrationRange) -> str:
        """Name of the weights file of a stage."""
        return next((entry.file for entry in self.stages if entry.range == range_), file_name(self.preset, range_))

    @property
    def common_error(self) -> Matrix6:
        """Covariance of the error that the networks make in all frames of a drive."""
        sigma = [self.common_translation_m] * 3 + [float(np.radians(self.common_rotation_deg))] * 3
        return np.diag(np.square(sigma))

    def with_stage(self, entry: StageEntry) -> Manifest:
        """The set with this stage added, or replacing the one with its range."""
        others = [stage for stage in self.stages if stage.range != entry.range]
        return replace(self, stages=tuple(sorted([*others, entry], key=lambda stage: stage.range, reverse=True)))

    def write(self, path: Path) -> None:
        """Write the manifest as TOML."""
        import tomli_w

        content = {key: value for key, value in asdict(self).items() if key != "stages"}
        if math.isinf(self.match_error_limit_px):
            del content["match_error_limit_px"]
        stages = [
            {"range": str(entry.range), "file": entry.file, **asdict(entry.settings), "run": entry.run}
            | ({"recipe": entry.recipe} if entry.recipe else {})
            | ({"validation": entry.validation} if entry.validation else {})
            for entry in self.stages
        ]
        write_whole(path, tomli_w.dumps({**content, "stages": stages}).encode())


def file_name(preset: str, range_: MiscalibrationRange) -> str:
    """Default name of the weights file of a stage."""
    return f"{preset}-{range_.rotation_deg:g}deg-{range_.translation_m:g}m.safetensors"


def manifest_path(preset: str, folder: Path | None = None) -> Path:
    """Path of the manifest of a preset's weights, in ``folder`` or in the package."""
    return (folder or PACKAGE) / f"{preset}.toml"


def load_manifest(preset: str, folder: Path | None = None) -> Manifest:
    """The manifest of a preset's weights.

    A folder without one is used with the settings of the package's own weights; if the package has none of this preset
    either, every stage looks once, at the preset's input size.

    Raises:
        WeightsError: the manifest is malformed; the message names the file and the key.
    """
    path = next(
        (path for path in (manifest_path(preset, folder), manifest_path(preset)) if os.path.lexists(path)), None
    )
    if path is None:
        return Manifest(preset)
    text = read_text(path, "Manifest of weights", error=WeightsError)
    origin, remedy = f"{path} is not a manifest of weights", "compare it with the one that ships with the package"
    try:
        read = validated(_ManifestFile, parse_toml(text), origin, WeightsError, remedy)
        stages = tuple(stage.entry() for stage in read.stages)
    except (ValueError, ConfigError) as error:
        raise WeightsError(f"{origin} ({one_line(error, 200)}); {remedy}.") from None
    if read.preset != preset:
        raise WeightsError(f"{path} is the manifest of preset {read.preset!r}, not of {preset}; rename or correct it.")
    return Manifest(read.preset, read.match_error_limit_px, read.common_rotation_deg, read.common_translation_m, stages)


@dataclass(frozen=True)
class _StageInFile:
    """A stage as in the file."""

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    range: str
    file: Annotated[str, Predicate(_is_name)]
    image_size: Annotated[float, Interval(gt=0, le=8)] = 1.0
    looks: Annotated[int, Interval(ge=1, le=16)] = 1
    gain: Annotated[float, Interval(gt=0, le=10)] = 1.0
    run: str = ""
    recipe: str = ""
    validation: dict[str, float] = field(default_factory=dict)

    def entry(self) -> StageEntry:
        settings = StageSettings(self.image_size, self.looks, self.gain)
        range_ = MiscalibrationRange.parse(self.range)
        return StageEntry(range_, self.file, settings, self.run, self.recipe, self.validation)


@dataclass(frozen=True)
class _ManifestFile:
    """The content of the file."""

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    preset: str
    match_error_limit_px: Annotated[float, Interval(gt=0)] = math.inf
    common_rotation_deg: Annotated[float, Interval(gt=0, le=45)] = 0.12
    common_translation_m: Annotated[float, Interval(gt=0, le=10)] = 0.08
    stages: Annotated[tuple[_StageInFile, ...], Len(0, 20)] = ()
