"""What tells right from wrong: a few numbers of one run, none of which needs the network again.

`Doubt` sums them up to the probability that a result is wrong; docs/decisions.md says how it was fitted.
"""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass, fields
from functools import cache
from importlib.resources import files

import numpy as np

from calibnet.geometry import MiscalibrationRange, euler_xyz, invert
from calibnet.geometry.types import Extrinsic
from calibnet.judging.lens import LENSES, PINHOLE, Fit, Lens, fit
from calibnet.trace import CascadeTrace, StageTrace

AXES = ("pitch", "yaw", "roll", "across the view", "along the image's height", "along the view")
"""What the axes of a correction are to a user: turns about the camera's x, y and z, then moves along them."""


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
class Witnesses:
    """Numbers that grow with what speaks against a result; not a number where a trace does not tell.

    Attributes:
        match_error: logarithm of the error, in pixels, that the last stage expects of its matches.
        earlier_error: likewise of the stage before it.
        misfit: logarithm of the last stage's `misfit`.
        reach: how far the run went, in ranges searched.
    """

    match_error: float
    earlier_error: float
    misfit: float
    reach: float


def witnesses(trace: CascadeTrace, again: StageTrace | None = None) -> Witnesses:
    """The witnesses of a run of at least one stage.

    Args:
        trace: of the run.
        again: one more look of the last stage from where the run arrived, which tells more than its last one.
    """
    last = again or trace.stages[-1]
    earlier = trace.stages[-2] if len(trace.stages) > 1 else trace.stages[-1]
    return Witnesses(
        match_error=math.log(last.match_error_px),
        earlier_error=math.log(earlier.match_error_px),
        misfit=math.log(max(misfit(last), 1e-6)),
        reach=reach(trace.initial, trace.stages[-1].after, trace.stages[0].range).share,
    )


def misfit(stage: StageTrace) -> float:
    """What the residuals of a stage's last matches cost, a match, after the pose that fits them best.

    Not a number where there are no matches. Between frames it varies as much as with what is wrong; for one frame it is
    least with the right lens.
    """
    if stage.matches is None or not len(stage.matches.points):
        return math.nan
    return _fit(stage, PINHOLE).cost / len(stage.matches.points)


def lens_gain(stage: StageTrace) -> float:
    """What the best lens of another kind gains over a pose alone with a stage's last matches, as a log likelihood."""
    if stage.matches is None or not len(stage.matches.points):
        return math.nan
    alone = _fit(stage, PINHOLE).cost
    return max(alone - _fit(stage, lens).cost for lens in LENSES)


def _fit(stage: StageTrace, lens: Lens) -> Fit:
    assert stage.matches is not None
    prior = stage.range.information
    return fit(stage.matches, stage.looked_from, stage.camera, stage.looked_from, prior, lens)


@dataclass(frozen=True)
class Doubt:
    """Logistic regression of a wrong result on the witnesses.

    Attributes:
        intercept: of the logarithm of the odds.
        weights: of the witnesses, by name.
        accepted_below: probability of being wrong below which a result is accepted.
        rejected_above: probability above which it is rejected; in between nobody can tell.
    """

    intercept: float
    weights: dict[str, float]
    accepted_below: float
    rejected_above: float

    def __call__(self, of: Witnesses) -> float:
        """Probability that the result is wrong; not a number where a witness is missing."""
        odds = self.intercept + sum(weight * getattr(of, name) for name, weight in self.weights.items())
        return 1 / (1 + math.exp(-min(max(odds, -50.0), 50.0)))


@cache
def load_doubt(again: bool = True) -> Doubt:
    """The coefficients that ship with the package; ``doubt.toml`` says what they were fitted to.

    Args:
        again: whether the last stage looked again from where it had arrived.
    """
    content = tomllib.loads(files("calibnet.judging").joinpath("doubt.toml").read_text(encoding="utf-8"))
    part = content["again" if again else "once"]
    unknown = part["weights"].keys() - {field.name for field in fields(Witnesses)}
    assert not unknown, unknown
    return Doubt(part["intercept"], part["weights"], part["accepted_below"], part["rejected_above"])
