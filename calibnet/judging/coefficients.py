"""What verdicts are made with: coefficients that were fitted to one set of weights, and hold for no other.

They lie beside the manifest, in ``PRESET-verdict.toml``, which `calib-inspect fit-verdict` writes, and name the weights
they belong to by fingerprints. Where a set has none of its own, nothing is accepted.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

from calibnet.errors import WeightsError
from calibnet.geometry import MiscalibrationRange
from calibnet.judging.classifier import Classifier
from calibnet.judging.covariance import CovarianceModel
from calibnet.judging.drive_predictors import DrivePredictors
from calibnet.judging.lens_causes import FAULTS, LensOdds
from calibnet.judging.lens_predictors import LensPredictors
from calibnet.judging.predictors import Predictors
from calibnet.runtime.reading import parse_toml, read_text
from calibnet.runtime.writing import write_whole
from calibnet.weights.fingerprint import fingerprint
from calibnet.weights.manifest import PACKAGE, Manifest

HEAD = (
    "# How verdicts on the weights beside this file are made; `calib-inspect fit-verdict` writes it.\n"
    "# It holds for these weights alone. docs/decisions.md (Probability of an error) says how it is fitted.\n"
)


@dataclass(frozen=True)
class Coefficients:
    """Coefficients of the verdict.

    Attributes:
        frame: how predictors of a frame are summed up; None where nothing was fitted.
        covariance: how far results of frames lie from the truth.
        lens: how likely faults of the lens are; None where that was not fitted, and then none is named.
        drive: how predictors of a drive are summed up; None where that was not fitted.
        inflation: by what a drive's stated covariance is multiplied, to be as large as its errors are.
        weights: fingerprints of the stages that were run, by range; the finest of them ends a run that can be judged.
        missing: a sentence that says why there are none; empty where there are.
        fitted: what they were fitted to, and what came of it.
    """

    frame: Classifier | None = None
    covariance: CovarianceModel = field(default_factory=CovarianceModel)
    lens: LensOdds | None = None
    drive: Classifier | None = None
    inflation: float = 1.0
    weights: Mapping[MiscalibrationRange, str] = field(default_factory=dict)
    missing: str = "The verdict has not been fitted to these networks."
    fitted: Mapping[str, Any] = field(default_factory=dict, repr=False)

    def for_frame(self, last: MiscalibrationRange) -> Classifier | str:
        """How to sum up the predictors of a run, or a sentence that says why nothing can be said of it.

        Args:
            last: range of the stage that ended it.
        """
        return self._fitted_to(last) or self.frame or self.missing

    def for_drive(self, last: MiscalibrationRange) -> Classifier | str:
        """The same of a drive."""
        return self._fitted_to(last) or self.drive or "To drives the verdict has not been fitted."

    def _fitted_to(self, last: MiscalibrationRange) -> str:
        """Why a run that a stage ended cannot be judged; empty where it can."""
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
            "frame": asdict(self.frame),
            "covariance": asdict(self.covariance),
            **({} if self.lens is None else {"lens": asdict(self.lens)}),
            **({} if self.drive is None else {"drive": asdict(self.drive) | {"inflation": self.inflation}}),
            "fitted": dict(self.fitted),
        }
        write_whole(path, (HEAD + tomli_w.dumps(content)).encode())


def coefficients_path(preset: str, folder: Path | None = None) -> Path:
    """Where the coefficients of a preset's weights lie: in ``folder``, or in the package."""
    return (folder or PACKAGE) / f"{preset}-verdict.toml"


def load_coefficients(manifest: Manifest, folder: Path | None = None) -> Coefficients:
    """The coefficients that were fitted to the weights in a folder; without any, `Coefficients.missing` says why.

    A copy of the weights that ship with the package needs no file of its own: the package's is for the same weights.

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


def _read(path: Path) -> Coefficients:
    remedy = "fit them again with `calib-inspect fit-verdict`"
    text = read_text(path, "File of a verdict's coefficients", error=WeightsError, remedy=remedy)
    try:
        content = parse_toml(text)
        frame = _classifier(content["frame"], Predictors)
        drive = content.get("drive", {})
        inflation = drive.pop("inflation", 1.0)
        of_drive = _classifier(drive, DrivePredictors) if drive else None
        lens = _lens(content["lens"]) if "lens" in content else None
        weights = {MiscalibrationRange.parse(range_): of for range_, of in content["weights"].items()}
        covariance, fitted = CovarianceModel(**content["covariance"]), content.get("fitted", {})
        return Coefficients(frame, covariance, lens, of_drive, inflation, weights, "", fitted)
    except (TypeError, KeyError, ValueError, AttributeError) as error:
        raise WeightsError(f"{path} holds no coefficients of a verdict ({error}); {remedy}.") from None


def _lens(content: dict[str, Any]) -> LensOdds:
    odds = LensOdds(**content)
    known = {field.name for field in fields(LensPredictors)}
    if not set(FAULTS) == odds.intercepts.keys() == odds.weights.keys():
        raise KeyError(f"faults of the lens are {', '.join(FAULTS)}")
    if unknown := {name for weights in odds.weights.values() for name in weights} - known:
        raise KeyError(f"no predictor is called {', '.join(sorted(unknown))}")
    return odds


def _classifier(content: dict[str, Any], predictors: type[Predictors | DrivePredictors]) -> Classifier:
    classifier = Classifier(**content)
    if unknown := classifier.weights.keys() - {field.name for field in fields(predictors)}:
        raise KeyError(f"no predictor is called {', '.join(sorted(unknown))}")
    return classifier
