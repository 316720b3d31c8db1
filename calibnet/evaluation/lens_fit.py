"""Fits the regressions that name faults of the lens to frames, and to drives, with known faults."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
from scipy.special import softmax

from calibnet.errors import CalibrationError
from calibnet.evaluation.corruptions import Corruption
from calibnet.evaluation.logistic import left_out, regression
from calibnet.evaluation.verdict_drives import DriveStream
from calibnet.evaluation.verdict_fit import rounded
from calibnet.evaluation.verdict_runs import RunStream, VerdictRun
from calibnet.judging.drive_lens import drive_lens_predictors, median_reading
from calibnet.judging.lens_causes import BENT, CENTER, FAULTS, FOCAL, LensOdds
from calibnet.judging.lens_predictors import lens_fits, lens_predictors
from calibnet.trace import CascadeTrace, DriveEstimate

CLASSES = {
    "focal-length": FOCAL,
    "principal-point": CENTER,
    "shifted": CENTER,
    "distorted": BENT,
    "equidistant": BENT,
}
"""Name of each fault of the battery; runs with other faults count as runs without a fault of the lens."""
TOO_WEAK = (
    ("focal-length", "+2 %"),
    ("focal-length", "-2 %"),
    ("principal-point", "+20, +0 px"),
    ("principal-point", "-20, +0 px"),
    ("shifted", "+20 px"),
    ("distorted", "k1 -0.1"),
    ("distorted", "k1 0.1"),
)
"""Faults left out of the fit, as they hardly show."""
PITCH = ("principal-point", "+0, +60 px")
"""A fault that looks like a pitch in a frame, but not in a drive."""
LATE = "late-scan"
"""A fault that is not of the lens, but looks much like another focal length."""
RIDGE = 1.0
"""Penalty of `calibnet.evaluation.logistic.regression`."""
WRONG_NAMES = 0.05
"""Largest share of runs that may get a wrong name, or a name without a fault, on sequences left out."""
FEWEST = 10
"""Fewest runs with each fault, and without one, that are fitted."""


class LensStream(RunStream):
    """A `RunStream` whose faults are all of the lens."""

    def predictors_of(self, trace: CascadeTrace) -> dict[str, float] | None:
        """The predictors from two looks, whatever the verdict."""
        looks = lens_fits(trace)
        return None if looks is None else asdict(lens_predictors(looks))

    def has(self, fault: Corruption) -> bool:
        """Whether a fault is one of the lens and strong enough to be recognised in a frame."""
        return is_of_lens(fault) and (fault.name, fault.strength) != PITCH


class DriveLensStream(DriveStream):
    """A `DriveStream` whose faults are of the lens, or late scans."""

    def predictors_of(self, estimate: DriveEstimate) -> dict[str, float] | None:
        """The predictors from all frames, whatever the verdict."""
        found = median_reading(estimate.looks)
        return None if found is None else asdict(drive_lens_predictors(found))

    def has(self, fault: Corruption) -> bool:
        """Whether a fault is a late scan, or one of the lens and strong enough to be recognised."""
        return fault.name == LATE or is_of_lens(fault)


def is_of_lens(fault: Corruption) -> bool:
    """Whether a fault is one of the lens, and not too weak."""
    return fault.name in CLASSES and (fault.name, fault.strength) not in TOO_WEAK


@dataclass(frozen=True)
class LensFigures:
    """How well faults of the lens are named on sequences that were left out of the fit in turn.

    Attributes:
        runs: number of runs.
        sequences: number of sequences.
        faulty: number of runs with a fault.
        right: share of the faulty runs whose fault is named correctly.
        wrong: share of the faulty runs that get another name.
        named_without: share of the runs without a fault that get a name.
    """

    runs: int
    sequences: int
    faulty: int
    right: float
    wrong: float
    named_without: float


def fit_lens(runs: Sequence[VerdictRun]) -> tuple[LensOdds, LensFigures]:
    """Fit a regression to runs of `LensStream` or `DriveLensStream`.

    Raises:
        CalibrationError: too few runs with one of the faults, or without any.
    """
    asked = [run for run in runs if run.predictors is not None and np.isfinite(list(run.predictors.values())).all()]
    kinds = np.array([1 + FAULTS.index(CLASSES[run.fault]) if run.fault in CLASSES else 0 for run in asked], np.intp)
    counts = np.bincount(kinds, minlength=len(FAULTS) + 1)
    if counts.min() < FEWEST:
        counted = ", ".join(f"{count} {name}" for name, count in zip(("none", *FAULTS), counts, strict=True))
        raise CalibrationError(
            f"There are too few runs with faults of the lens ({counted}); at least {FEWEST} of each are needed. Make "
            "more runs."
        )
    names = list(asked[0].predictors or {})
    values = np.array([[run.predictors[name] for name in names] for run in asked if run.predictors is not None])
    odds_left_out = left_out(values, kinds, len(FAULTS) + 1, RIDGE, [run.sequence for run in asked])
    likely = softmax(np.column_stack([np.zeros(len(asked)), odds_left_out]), axis=1)
    best, sure = 1 + likely[:, 1:].argmax(axis=1), likely[:, 1:].max(axis=1)
    wrong = np.sort(sure[best != kinds])[::-1]
    allowed = int(WRONG_NAMES * len(asked))
    named_from = float(wrong[allowed]) if allowed < len(wrong) else 0.5
    named = sure > named_from
    intercepts, weights = regression(values, kinds, len(FAULTS) + 1, RIDGE)
    odds = LensOdds(
        rounded(named_from),
        dict(zip(FAULTS, map(rounded, intercepts), strict=True)),
        {fault: dict(zip(names, map(rounded, of), strict=True)) for fault, of in zip(FAULTS, weights, strict=True)},
    )
    faulty = kinds > 0
    return odds, LensFigures(
        runs=len(asked),
        sequences=len({run.sequence for run in asked}),
        faulty=int(faulty.sum()),
        right=float((named & (best == kinds))[faulty].mean()),
        wrong=float((named & (best != kinds))[faulty].mean()),
        named_without=float(named[~faulty].mean()),
    )
