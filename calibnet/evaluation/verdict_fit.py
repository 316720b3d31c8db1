"""Fits the coefficients of the verdict to runs with a known error, and measures them on sequences left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from calibnet.errors import CalibrationError
from calibnet.evaluation.logistic import left_out, regression
from calibnet.evaluation.verdict_runs import VerdictRun
from calibnet.geometry import MiscalibrationRange
from calibnet.geometry.types import Floats
from calibnet.judging.classifier import Classifier
from calibnet.judging.covariance import CovarianceModel
from calibnet.verdict import DRIVE_TOLERANCES, FRAME_TOLERANCES, Tolerance

Ranges = tuple[MiscalibrationRange, MiscalibrationRange]
"""The range of the last stage, and that of the first, which is searched around the guess."""
RIDGE = 6.0
"""Penalty of `calibnet.evaluation.logistic.regression`: 3 times the squared coefficients of the odds of being wrong."""
FALSE_ACCEPTS, FALSE_ACCEPTS_OF_DRIVES = 0.005, 0.02
"""Largest share of the runs that may be accepted and wrong, on sequences left out. The verdict promises at most one
frame in a hundred; half of that among some 600 runs means this with 95 % confidence. There are too few drives for that,
and most of them end near a limit."""
CLEAR_FALSE_ACCEPTS = 0.01
"""The same for drives that do not end near a limit (`NEAR`), as a share of these."""
CERTAIN = 0.5
"""Factor on these shares for runs that are wrongly certain of the coarser tolerance: half of the runs have no fault,
but the promise should hold even if all input has one."""
GOOD_REJECTED = 0.02
"""Share of the good results that may be rejected; the others that are not accepted are *cannot tell*."""
LEAST_DEG = 1e-3
"""Lower limit of the common standard deviation of the rotation, in degrees."""
FEWEST, FEWEST_DRIVES = 10, 6
"""Fewest good and fewest wrong results of frames, and of drives, that are fitted."""
NEAR = 1.25
"""Errors between a limit divided by this and the limit times this are near it; no predictor distinguishes 24 from 26
cm."""
CURVE = (0.0, 0.0025, 0.005, 0.01, 0.02, 0.05)
"""Shares of false accepts at which the operating curve is given."""


@dataclass(frozen=True)
class FitFigures:
    """How well the verdict does on sequences that were left out of the fit in turn.

    Attributes:
        runs: number of runs.
        plain: number of runs without a fault.
        sequences: number of sequences.
        good: number of plain runs that end within the limits.
        false_accept_rate: share of all runs that are accepted and wrong.
        acceptance_of_good: share of the good plain runs that are accepted.
        wrong_rejected: share of the wrong runs that are rejected.
        nees: normalised estimation error squared per degree of freedom, 1 if the covariance is right; of the plain
            runs that are not rejected or, for drives, of those certain enough to be within the coarser tolerance.
        curve: acceptance of good plain runs at given shares of false accepts, of all runs and without those that end
            near a limit (`NEAR`).
        coarser: the same for the coarser tolerance; None if it was not fitted.
    """

    runs: int
    plain: int
    sequences: int
    good: int
    false_accept_rate: float
    acceptance_of_good: float
    wrong_rejected: float
    nees: float
    curve: list[dict[str, float]] = field(default_factory=list)
    coarser: FitFigures | None = None

    def as_dict(self) -> dict[str, Any]:
        """The content of the file of coefficients, without unknown figures, as TOML has no null."""
        content = asdict(replace(self, coarser=None))
        if self.coarser is not None:
            content["coarser"] = self.coarser.as_dict()
        return {name: value for name, value in content.items() if value is not None and value == value}


def fit_frames(runs: Sequence[VerdictRun], ranges: Ranges) -> tuple[Classifier, CovarianceModel, FitFigures]:
    """Fit the classifier and the covariance model to runs on single frames.

    Args:
        runs: runs with a known error.
        ranges: of the last stage, and searched around the guess.

    Raises:
        CalibrationError: too few runs end right, or wrong.
    """
    finest, coarser = FRAME_TOLERANCES
    classifier, figures, kept = fit_classifier(runs, finest, FALSE_ACCEPTS)
    coarse, coarse_figures, _ = fit_classifier(graded(runs, coarser), coarser, CERTAIN * FALSE_ACCEPTS)
    model = fit_covariance(kept, ranges)
    nees = nees_of(kept, ranges, model)
    return replace(classifier, coarser=coarse), model, replace(figures, nees=nees, coarser=coarse_figures)


def fit_drives(runs: Sequence[VerdictRun]) -> tuple[Classifier, float, FitFigures]:
    """Fit the classifier to runs on drives, and the factor that makes their stated covariance as large as their errors.

    Raises:
        CalibrationError: too few runs end right, or wrong.
    """
    finest, coarser = DRIVE_TOLERANCES
    clear, fewest = CLEAR_FALSE_ACCEPTS, FEWEST_DRIVES
    classifier, figures, _ = fit_classifier(runs, finest, FALSE_ACCEPTS_OF_DRIVES, fewest, clear)
    coarse, coarse_figures, kept = fit_classifier(graded(runs, coarser), coarser, CERTAIN * clear, fewest)
    # only accepted runs count: a few gross errors would inflate the covariance of all
    accepted = [run for run in kept if error_probability(run, coarse) < coarse.accepted_below]
    squares = [np.array(run.offset) @ np.array(run.information) @ np.array(run.offset) / 6 for run in accepted]
    nees = float(np.mean(squares)) if squares else float("nan")
    inflation = rounded(max(nees, 1.0)) if squares else 1.0
    figures = replace(figures, nees=nees / inflation, coarser=coarse_figures)
    return replace(classifier, coarser=coarse), inflation, figures


def graded(runs: Sequence[VerdictRun], tolerance: Tolerance) -> list[VerdictRun]:
    """The runs, each good if it ends within a tolerance."""
    return [replace(run, good=severity(run, tolerance) <= 1) for run in runs]


def error_probability(run: VerdictRun, classifier: Classifier) -> float:
    """Probability that the result of a run is wrong."""
    assert run.predictors is not None
    return classifier(SimpleNamespace(**run.predictors))


def fit_classifier(
    runs: Sequence[VerdictRun],
    limits: tuple[float, float],
    false_accepts: float,
    fewest: int = FEWEST,
    clear_false_accepts: float = 1.0,
) -> tuple[Classifier, FitFigures, list[VerdictRun]]:
    """Fit a classifier to runs, and measure it on sequences left out.

    Args:
        runs: runs with a known error.
        limits: largest error, in degrees and centimetres, of a good result.
        false_accepts: largest share of the runs that may be accepted and wrong.
        fewest: number of good, and of wrong, results that is required.
        clear_false_accepts: the same for the runs that do not end near a limit (`NEAR`), as a share of these.

    Returns:
        The classifier, its figures, and the plain runs that it does not reject.

    Raises:
        CalibrationError: too few runs end right, or wrong.
    """
    asked = [run for run in runs if run.predictors is not None and np.isfinite(list(run.predictors.values())).all()]
    good = np.array([run.good for run in asked], bool)
    if min(int(good.sum()), int((~good).sum())) < fewest:
        raise CalibrationError(
            f"Of {len(runs)} runs {int(good.sum())} are right and {int((~good).sum())} wrong although image and scan "
            f"seem to fit; at least {fewest} of each are needed. Make more runs, or add other data."
        )
    names = list(asked[0].predictors or {})
    values = np.array([[run.predictors[name] for name in names] for run in asked if run.predictors is not None])
    wrong_or_right = (~good).astype(np.intp)
    odds = left_out(values, wrong_or_right, 2, RIDGE, [run.sequence for run in asked])[:, 0]
    plain = np.array([run.plain for run in asked], bool)
    clear = np.array([not is_near(run, limits) for run in asked], bool)
    clear_runs = sum(not is_near(run, limits) for run in runs)
    accepted_below = min(
        threshold(odds, ~good, false_accepts * len(runs)),
        threshold(odds[clear], ~good[clear], clear_false_accepts * clear_runs),
    )
    rejected_above = max(float(np.quantile(odds[good], 1 - GOOD_REJECTED)), accepted_below)
    (intercept,), (weights,) = regression(values, wrong_or_right, 2, RIDGE)
    classifier = Classifier(
        rounded(intercept),
        {name: rounded(weight) for name, weight in zip(names, weights, strict=True)},
        rounded(probability(accepted_below)),
        rounded(probability(rejected_above)),
    )
    kept = [run for run, of in zip(asked, odds, strict=True) if run.plain and of < rejected_above]
    accepted = odds < accepted_below
    wrong = [run for run in runs if not run.good]
    told_wrong = len(wrong) - int((odds[~good] <= rejected_above).sum())
    figures = FitFigures(
        runs=len(runs),
        plain=sum(run.plain for run in runs),
        sequences=len({run.sequence for run in runs}),
        good=sum(run.plain and run.good for run in runs),
        false_accept_rate=float((accepted & ~good).sum() / len(runs)),
        acceptance_of_good=_acceptance(accepted & good & plain, runs),
        wrong_rejected=told_wrong / max(len(wrong), 1),
        nees=float("nan"),
        curve=_curve(asked, runs, odds, limits),
    )
    return classifier, figures, kept


def _curve(
    asked: Sequence[VerdictRun], runs: Sequence[VerdictRun], odds: Floats, limits: tuple[float, float]
) -> list[dict[str, float]]:
    """The operating curve of all runs, and of those that do not end near a limit."""

    def accepted(share: float, kept: Sequence[bool], of: Sequence[VerdictRun]) -> float:
        chosen, good = odds[kept], np.array([run.good for run in asked], bool)[kept]
        plain = np.array([run.plain for run in asked], bool)[kept]
        return _acceptance((chosen < threshold(chosen, ~good, share * len(of))) & good & plain, of)

    clear = [not is_near(run, limits) for run in asked]
    of_clear = [run for run in runs if not is_near(run, limits)]
    return [
        {
            "false_accepts": share,
            "acceptance_of_good": accepted(share, [True] * len(asked), runs),
            "acceptance_of_clear": accepted(share, clear, of_clear),
        }
        for share in CURVE
    ]


def is_near(run: VerdictRun, limits: tuple[float, float]) -> bool:
    """Whether a run ends near a limit, on either side."""
    return 1 / NEAR < severity(run, limits) < NEAR


def severity(run: VerdictRun, limits: tuple[float, float]) -> float:
    """The error of a run relative to limits; at most 1 within them."""
    return max(run.rotation_deg / limits[0], run.translation_cm / limits[1])


def _acceptance(accepted: NDArray[np.bool_], runs: Sequence[VerdictRun]) -> float:
    """Share of all good plain runs that are accepted."""
    return float(accepted.sum() / max(sum(run.plain and run.good for run in runs), 1))


def threshold(odds: Floats, wrong: NDArray[np.bool_], most: float) -> float:
    """The log odds below which at most ``most`` wrong results lie."""
    ranked = np.sort(odds[wrong])
    allowed = int(most)
    return float(ranked[allowed]) if allowed < len(ranked) else float("inf")


def rounded(value: float) -> float:
    """Round to six digits, more than are significant."""
    return float(f"{value:.6g}")


def probability(odds: float) -> float:
    """The probability for log odds."""
    return float(1 / (1 + np.exp(-np.clip(odds, -50, 50))))


def fit_covariance(runs: Sequence[VerdictRun], ranges: Ranges) -> CovarianceModel:
    """Fit the covariance model by maximum likelihood, then inflate it to a NEES of 1 per degree of freedom.

    The default model if no stage states an information, or there are too few runs.
    """
    known = [run for run in runs if run.information is not None]
    if len(known) < FEWEST:
        return CovarianceModel()

    def model(logarithms: Floats, inflation: float = 1.0) -> CovarianceModel:
        share, translation, rotation = np.exp(logarithms) * np.array([1 / inflation, inflation**0.5, inflation**0.5])
        return CovarianceModel(rounded(share), rounded(translation), rounded(max(rotation, LEAST_DEG)))

    def cost(logarithms: Floats) -> float:
        squares, covariances = squared_errors(known, ranges, model(logarithms))
        # Student's t with four degrees of freedom: a few gross errors must not inflate the covariance of all
        return float((0.5 * np.linalg.slogdet(covariances)[1] + 5.0 * np.log1p(squares / 4.0)).sum())

    start = np.log(list(asdict(CovarianceModel()).values()))
    found = minimize(cost, start, method="Nelder-Mead", options={"maxiter": 400, "xatol": 0.01, "fatol": 0.01}).x
    return model(found, max(nees_of(known, ranges, model(found)), 1e-3))


def nees_of(runs: Sequence[VerdictRun], ranges: Ranges, model: CovarianceModel) -> float:
    """Normalised estimation error squared per degree of freedom, 1 if the model is right; NaN without runs."""
    known = [run for run in runs if run.information is not None]
    return float(squared_errors(known, ranges, model)[0].mean() / 6) if known else float("nan")


def squared_errors(runs: Sequence[VerdictRun], ranges: Ranges, model: CovarianceModel) -> tuple[Floats, Floats]:
    """Normalised squared errors ``[N]``, and the covariances ``[N, 6, 6]``."""
    informations, offsets = np.array([run.information for run in runs]), np.array([run.offset for run in runs])
    covariances = model.covariance(informations, *ranges, np.array([run.match_error_px for run in runs]))
    return np.einsum("ni,nij,nj->n", offsets, np.linalg.inv(covariances), offsets), covariances
