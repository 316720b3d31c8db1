"""Predictors of a wrong result: a few numbers computed from one run, without running a network again.

`calibnet.judging.classifier.Classifier` turns them into the probability that the result is wrong; docs/decisions.md
says what each of them adds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibnet.geometry import MiscalibrationRange, euler_xyz, invert
from calibnet.geometry.types import Extrinsic
from calibnet.judging.correlated_errors import correlated_covariance
from calibnet.judging.lens import LENSES, PINHOLE, Lens, fit
from calibnet.trace import CascadeTrace, StageTrace

AXES = ("pitch", "yaw", "roll", "across the view", "along the image's height", "along the view")
"""What the axes of a correction are to a user: turns about the camera's x, y and z, then moves along them."""
LEAST = 1e-6
"""What is smaller counts as this much, so that it has a logarithm."""


@dataclass(frozen=True)
class Reach:
    """The axis on which a run went farthest, compared with the range that was searched.

    Attributes:
        share: of the range; 1 is its border.
        axis: index into `AXES`.
        moved: degrees or metres that it went.
        searched: degrees or metres of the range.
    """

    share: float
    axis: int
    moved: float
    searched: float

    def __str__(self) -> str:
        unit, verb = ("°", "turned") if self.axis < 3 else (" m", "moved")
        prefix = "in " if self.axis < 3 else ""
        return (
            f"{verb} {abs(self.moved):.2g}{unit} {prefix}{AXES[self.axis]}, "
            f"farther than the ±{self.searched:g}{unit} searched"
        )


def reach(before: Extrinsic, after: Extrinsic, range_: MiscalibrationRange) -> Reach:
    """How far it is from one extrinsic to another, in ranges; the miscalibration is that of ``before``."""
    delta = before @ invert(after)
    moved = np.concatenate([np.degrees(euler_xyz(delta[:3, :3])), delta[:3, 3]])
    searched = np.repeat([range_.rotation_deg, range_.translation_m], 3)
    axis = int(np.argmax(np.abs(moved) / searched))
    return Reach(float(abs(moved[axis]) / searched[axis]), axis, float(moved[axis]), float(searched[axis]))


@dataclass(frozen=True)
class Predictors:
    """Numbers that grow with what speaks against a result; not a number where a trace does not tell.

    Attributes:
        match_error: logarithm of the error, in pixels, that the last stage expects of its matches.
        misfit: logarithm of what its residuals cost, see `misfits`.
        lens: logarithm of the least cost of its matches with another lens, relative to that with the pose alone;
            0 where no lens explains them better.
        correlated: logarithm of the deviation of the translation, in centimetres, if matches also err alike, see
            `calibnet.judging.correlated_errors`.
    """

    match_error: float
    misfit: float
    lens: float
    correlated: float


def predictors(trace: CascadeTrace) -> Predictors:
    """The predictors of a run of at least one stage.

    Of the last stage they are those of its last look.
    """
    last = trace.stages[-1]
    alone, bent = misfits(last)
    return Predictors(
        match_error=math.log(last.match_error_px),
        misfit=math.log(max(alone, LEAST)),
        lens=math.log(max(bent, LEAST) / max(alone, LEAST)),
        correlated=_correlated(last, trace.stages[0].range),
    )


def misfits(stage: StageTrace, lenses: Sequence[Lens] = LENSES) -> tuple[float, float]:
    """What the residuals of a stage's last matches cost, a match, after the pose that fits them best.

    Not a number where there are no matches. Between frames it varies as much as with what is wrong; for one frame it is
    least with the right lens.

    Returns:
        The cost with the camera as given, and with whichever other lens explains the matches best, fitted together
        with the pose; the second is the first where no lens explains them better.
    """
    matches, prior, origin = stage.matches, stage.range.information, stage.looked_from
    if matches is None or not len(matches.points):
        return math.nan, math.nan
    alone = fit(matches, origin, stage.camera, origin, prior, PINHOLE)
    bent = [fit(matches, origin, stage.camera, origin, prior, lens, start=alone).cost for lens in lenses]
    return alone.cost / len(matches.points), min(alone.cost, *bent, math.inf) / len(matches.points)


def _correlated(stage: StageTrace, searched: MiscalibrationRange) -> float:
    """Logarithm of the deviation of the translation, in centimetres, if a stage's matches also err alike."""
    if stage.matches is None or not len(stage.matches.points):
        return math.nan
    covariance = correlated_covariance(stage.matches, stage.camera, searched.information)
    return math.log(100 * math.sqrt(np.trace(covariance[:3, :3])))
