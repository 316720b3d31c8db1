"""Coefficients of the verdict, which are fitted to one set of weights and are valid for no other.

`calib-inspect fit-verdict` writes them to ``PRESET-verdict.toml`` beside the manifest. They name the weights they
belong to by fingerprints. With weights that have no coefficients, nothing is accepted.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calibnet.errors import ConfigError, WeightsError
from calibnet.geometry import MiscalibrationRange
from calibnet.judging.classifier import Classifier
from calibnet.judging.covariance import CovarianceModel
from calibnet.judging.drive_lens import DriveLensPredictors
from calibnet.judging.drive_predictors import DrivePredictors
from calibnet.judging.lens_causes import FAULTS, LensOdds
from calibnet.judging.lens_predictors import LensPredictors
from calibnet.judging.predictors import Predictors
from calibnet.runtime.reading import parse_toml, read_text
from calibnet.runtime.schema import validated
from calibnet.runtime.writing import write_whole
from calibnet.weights.fingerprint import fingerprint
from calibnet.weights.manifest import PACKAGE, Manifest

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

HEAD = (
    "# How verdicts on the weights beside this file are made; `calib-inspect fit-verdict` writes it.\n"
    "# It holds for these weights alone. docs/decisions.md (Probability of an error) says how it is fitted.\n"
)


@dataclass(frozen=True)
class Coefficients:
    """Coefficients of the verdict.

    Attributes:
        frame: classifier of frames; None if nothing was fitted.
        covariance: covariance model of frames.
        lens: regression that names faults of the lens; None if it was not fitted, so that none is named.
        drive: classifier of drives; None if it was not fitted.
        drive_lens: regression that names faults of the lens of a drive; None if it was not fitted.
        inflation: factor on the stated covariance of a drive that makes it as large as errors are.
        weights: fingerprints of the stages that were run in the fit, by range. Only runs that end with the finest of
            them can be judged.
        missing: a sentence that says why there are no coefficients; empty if there are.
        fitted: data and figures of the fit.
    """

    frame: Classifier | None = None
    covariance: CovarianceModel = field(default_factory=CovarianceModel)
    lens: LensOdds | None = None
    drive: Classifier | None = None
    drive_lens: LensOdds | None = None
    inflation: float = 1.0
    weights: Mapping[MiscalibrationRange, str] = field(default_factory=dict)
    missing: str = "The verdict has not been fitted to these networks."
    fitted: Mapping[str, Any] = field(default_factory=dict, repr=False)

    def for_frame(self, last: MiscalibrationRange) -> Classifier | str:
        """The classifier of frames, or a sentence that says why a run cannot be judged.

        Args:
            last: range of the last stage of the run.
        """
        return self._fitted_to(last) or self.frame or self.missing

    def for_drive(self, last: MiscalibrationRange) -> Classifier | str:
        """The classifier of drives, or a sentence that says why a drive cannot be judged."""
        return self._fitted_to(last) or self.drive or "The verdict on drives has not been fitted."

    def _fitted_to(self, last: MiscalibrationRange) -> str:
        """Why a run that ends with a stage cannot be judged; empty if it can."""
        finest = min(self.weights, default=last)
        if self.frame is not None and last != finest:
            return f"The verdict was fitted to runs that end with the stage of {finest.label}, not with {last.label}."
        return self.missing

    def write(self, path: Path) -> None:
        """Write them as TOML."""
        import tomli_w

        assert self.frame is not None
        content = {
            "weights": {str(range_): of for range_, of in self.weights.items()},
            "frame": _content(self.frame),
            "covariance": asdict(self.covariance),
            **({} if self.lens is None else {"lens": asdict(self.lens)}),
            **({} if self.drive is None else {"drive": _content(self.drive) | {"inflation": self.inflation}}),
            **({} if self.drive_lens is None else {"drive_lens": asdict(self.drive_lens)}),
            "fitted": dict(self.fitted),
        }
        write_whole(path, (HEAD + tomli_w.dumps(content)).encode())


def _content(classifier: Classifier) -> dict[str, Any]:
    """A classifier and its coarser ones as TOML has them, which knows no null."""
    content = asdict(replace(classifier, coarser=None))
    del content["coarser"]
    return content if classifier.coarser is None else content | {"coarser": _content(classifier.coarser)}


def coefficients_path(preset: str, folder: Path | None = None) -> Path:
    """The file of the coefficients for a preset's weights, in ``folder`` or in the package."""
    return (folder or PACKAGE) / f"{preset}-verdict.toml"


def load_coefficients(manifest: Manifest, folder: Path | None = None) -> Coefficients:
    """Load the coefficients fitted to the weights in a folder; if there are none, `Coefficients.missing` says why.

    A copy of the shipped weights needs no file of its own, because the package's coefficients belong to it.

    Raises:
        WeightsError: a file of coefficients is malformed.
    """
    where = folder or PACKAGE
    mend = f"`calib-inspect fit-verdict --weights {where} --data …` fits it"
    other = ""
    for path in dict.fromkeys([coefficients_path(manifest.preset, folder), coefficients_path(manifest.preset)]):
        if not path.is_file():
            continue
        read = _read(path)
        changed = [range_ for range_, known in read.weights.items() if fingerprint(where, manifest, range_) != known]
        if not changed:
            return read
        if path.parent == where:
            stages = ", ".join(range_.label for range_ in changed)
            other = (
                f"Since the verdict was fitted to the weights in {where}, these have changed: {stages}; {mend} anew."
            )
    return Coefficients(missing=other or f"The verdict has not been fitted to the weights in {where}; {mend}.")


@dataclass(frozen=True)
class _Drive(Classifier):
    inflation: float = 1.0


@dataclass(frozen=True)
class _File:
    """What a file of coefficients holds."""

    weights: dict[str, str]
    frame: Classifier
    covariance: CovarianceModel
    lens: LensOdds | None = None
    drive: _Drive | None = None
    drive_lens: LensOdds | None = None
    fitted: dict[str, Any] = field(default_factory=dict)


def _read(path: Path) -> Coefficients:
    origin, remedy = f"File of a verdict's coefficients {path}", "fit them again with `calib-inspect fit-verdict`"
    try:
        content = parse_toml(read_text(path, "File of a verdict's coefficients", error=WeightsError, remedy=remedy))
        read = validated(_File, content, origin, WeightsError, remedy)
        _require_known(read.frame, Predictors)
        for odds, predictors in ((read.lens, LensPredictors), (read.drive_lens, DriveLensPredictors)):
            if odds is not None:
                _require_faults(odds, predictors)
        drive = None
        if read.drive is not None:
            _require_known(read.drive, DrivePredictors)
            drive = Classifier(**{one.name: getattr(read.drive, one.name) for one in fields(Classifier)})
        weights = {MiscalibrationRange.parse(range_): mark for range_, mark in read.weights.items()}
    except (ValueError, ConfigError) as error:
        raise WeightsError(f"{origin}: {error}; {remedy}.") from None
    inflation = 1.0 if read.drive is None else read.drive.inflation
    return Coefficients(
        read.frame, read.covariance, read.lens, drive, read.drive_lens, inflation, weights, "", read.fitted
    )


def _require_faults(odds: LensOdds, predictors: type[DataclassInstance]) -> None:
    if not set(FAULTS) == odds.intercepts.keys() == odds.weights.keys():
        raise ValueError(f"faults of the lens are {', '.join(FAULTS)}")
    for weights in odds.weights.values():
        _require_predictors(weights, predictors)


def _require_known(classifier: Classifier, predictors: type[DataclassInstance]) -> None:
    _require_predictors(classifier.weights, predictors)
    if classifier.coarser is not None:
        _require_known(classifier.coarser, predictors)


def _require_predictors(weights: Mapping[str, float], predictors: type[DataclassInstance]) -> None:
    if unknown := weights.keys() - {field.name for field in fields(predictors)}:
        raise ValueError(f"there is no predictor {', '.join(sorted(unknown))}")
