"""Predictors of a wrong result: a few numbers computed from one run, without running a network again.

`calibnet.judging.classifier.Classifier` turns them into the probability that the result is wrong; docs/decisions.md
says what each of them adds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from calibnet.geometry import MiscalibrationRange, euler_xyz, invert
from calibnet.geometry.types import Extrinsic
from calibnet.judging.correlated_errors import correlated_covariance
from calibnet.judging.lens import LENSES, fit
from calibnet.trace import CascadeTrace, StageTrace

AXIS_NAMES = ("pitch", "yaw", "roll", "across the view", "along the image's height", "along the view")
"""Names of a correction's axes for users: rotations about the camera's x, y and z, then translations along them."""
LEAST = 1e-6
"""Lower limit of values whose logarithm is taken."""


@dataclass(frozen=True)
class Reach:
    """How far a run moved the extrinsic, on the axis where that is largest relative to the range searched.

    Attributes:
        share: distance relative to the range; 1 is its border.
        axis: index into `AXIS_NAMES`.
        moved: distance on that axis, in degrees or metres.
        searched: half width of the range on that axis, in degrees or metres.
    """

    share: float
    axis: int
    moved: float
    searched: float

    def __str__(self) -> str:
        unit, verb = ("°", "turned") if self.axis < 3 else (" m", "moved")
        prefix = "in " if self.axis < 3 else ""
        return (
            f"{verb} {abs(self.moved):.2g}{unit} {prefix}{AXIS_NAMES[self.axis]}, "
            f"farther than the ±{self.searched:g}{unit} searched"
        )


def reach(before: Extrinsic, after: Extrinsic, range_: MiscalibrationRange) -> Reach:
    """How far ``after`` lies from ``before``, relative to a range."""
    delta = before @ invert(after)
    moved = np.concatenate([np.degrees(euler_xyz(delta[:3, :3])), delta[:3, 3]])
    searched = np.repeat([range_.rotation_deg, range_.translation_m], 3)
    axis = int(np.argmax(np.abs(moved) / searched))
    return Reach(float(abs(moved[axis]) / searched[axis]), axis, float(moved[axis]), float(searched[axis]))


@dataclass(frozen=True)
class Predictors:
    """Predictors of a wrong result of one frame; NaN where the trace lacks the data.

    Attributes:
        match_error: logarithm of the match error that the last stage expects, in pixels.
        misfit: logarithm of the mean cost of its matches, see `misfits`.
        lens: logarithm of the lowest cost of its matches with another lens, relative to the cost with the pose alone;
            0 if no lens explains them better.
        correlated: logarithm of the standard deviation of the translation, in centimetres, if matches have correlated
            errors, see `calibnet.judging.correlated_errors`.
    """

    match_error: float
    misfit: float
    lens: float
    correlated: float


def predictors(trace: CascadeTrace) -> Predictors:
    """The predictors of a run of at least one stage.

    They are computed from the last look of the last stage.
    """
    last = trace.stages[-1]
    alone, bent = misfits(last)
    return Predictors(
        match_error=math.log(last.match_error_px),
        misfit=math.log(max(alone, LEAST)),
        lens=math.log(max(bent, LEAST) / max(alone, LEAST)),
        correlated=_correlated(last, trace.stages[0].range),
    )


def misfits(stage: StageTrace) -> tuple[float, float]:
    """Mean cost per match of a stage's last look, at the pose that fits its matches best; NaN without matches.

    It varies between frames as much as with faults of the input, but for one frame it is lowest with the right lens.

    Returns:
        The cost with the given camera, and the lowest cost with another lens fitted together with the pose. Both are
        equal if no lens explains the matches better.
    """
    matches, prior, origin = stage.matches, stage.range.information, stage.looked_from
    if matches is None or not len(matches.points):
        return math.nan, math.nan
    alone = fit(matches, origin, stage.camera, prior)
    bent = [fit(matches, origin, stage.camera, prior, lens, start=alone).cost for lens in LENSES]
    return alone.cost / len(matches.points), min(alone.cost, *bent, math.inf) / len(matches.points)


def _correlated(stage: StageTrace, searched: MiscalibrationRange) -> float:
    """The predictor ``correlated`` from the last look of a stage."""
    if stage.matches is None or not len(stage.matches.points):
        return math.nan
    covariance = correlated_covariance(stage.matches, stage.camera, searched.information)
    return math.log(100 * math.sqrt(np.trace(covariance[:3, :3])))
