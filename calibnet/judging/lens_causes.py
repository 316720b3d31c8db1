"""Which lens explains what a run found better than the camera matrix that was given.

No network is asked for it: the same matches are fitted with the pose alone and with other lenses besides. The finest
look sees little of a wrong focal length or principal point, because the looks before have explained most of it by a
wrong pose, but what it sees is sure. A barrel-shaped picture it takes for one of a shorter focal length; that shows
in a coarse look, whose wide window holds the whole bend. Shares and limits are chosen on faults put into six frames of
five rigs, see docs/decisions.md ("Picture and scan do not fit").
"""

from __future__ import annotations

from calibnet.judging.lens import LENSES, PINHOLE, Fit, fit
from calibnet.trace import CascadeTrace, StageTrace
from calibnet.verdict import Cause

LEAST_GAIN, STRONG_GAIN = 0.07, 0.15
"""Shares of the matches' cost that a lens saves from which on it may be named; and from which on it is before a barrel
shape, and where picture and scan fit badly, as over-exposed ones do."""
LEAST_FOCAL, LEAST_CENTER = 0.008, 0.01
"""By what factor less one the focal length, and by what share of the width the principal point, must differ. Without a
fault these were 0.006 and 0.008 at most."""
LEAST_BARREL, MOST_LOST = -0.07, 0.2
"""The radial coefficient of a coarse look from which on a picture is barrel-shaped, and what share of the cost an
equidistant lens may add there: of pinholes it adds more."""
COARSE = 3
"""From the last stage backwards: the look whose window still holds a whole bend."""
BARREL = ("distortion", "lens-model")
"""What a barrel-shaped picture may come from."""


def lens_causes(trace: CascadeTrace) -> tuple[Cause, ...]:
    """What the matches of a run say of the camera; nothing where a pose explains them as well."""
    fine = _fits(trace.again or trace.stages[-1])
    if not fine:
        return ()
    alone, focal, center, *_ = fine
    least = LEAST_GAIN if trace.fits else STRONG_GAIN
    by_center, by_focal = _gain(center, alone), _gain(focal, alone)
    aside = center.center[0] / trace.stages[-1].camera.width
    off_center, off_focal = abs(aside) >= LEAST_CENTER, abs(focal.focal - 1) >= LEAST_FOCAL
    if off_center and by_center >= max(STRONG_GAIN, by_focal):
        return (_principal_point(aside, by_center),)
    if focal.focal > 1 + LEAST_FOCAL and by_focal >= max(STRONG_GAIN, by_center):
        return (_focal_length(focal.focal, by_focal),)
    shorter = focal.focal < 1 - LEAST_FOCAL and by_focal >= max(least, by_center * off_center)
    if bent := _bent(trace):  # a shorter focal length bends nothing, but a coarse look takes it for a bend as well
        return (_focal_length(focal.focal, by_focal),) if shorter and len(bent) > len(BARREL) else bent
    if off_focal and by_focal >= max(least, by_center * off_center):
        return (_focal_length(focal.focal, by_focal),)
    if off_center and by_center >= least:
        return (_principal_point(aside, by_center),)
    return ()


def _fits(stage: StageTrace) -> list[Fit]:
    """A look's matches fitted with the pose alone, then with each of `LENSES`; empty without matches."""
    matches, prior, origin = stage.matches, stage.range.information, stage.looked_from
    if matches is None or not len(matches.points):
        return []
    alone = fit(matches, origin, stage.camera, origin, prior, PINHOLE)
    return [alone, *(fit(matches, origin, stage.camera, origin, prior, lens) for lens in LENSES)]


def _gain(other: Fit, alone: Fit) -> float:
    """The share of the cost that a lens saves."""
    return 1 - other.cost / alone.cost if alone.cost > 0 else 0.0


def _bent(trace: CascadeTrace) -> tuple[Cause, ...]:
    """What a coarse look says that bends the picture; a focal length first, where that explains it better."""
    coarse = _fits(trace.stages[-COARSE]) if len(trace.stages) >= COARSE else []
    if not coarse:
        return ()
    alone, focal, _, radial, equidistant = coarse
    if radial.radial > LEAST_BARREL or _gain(equidistant, alone) < -MOST_LOST:
        return ()
    text = (
        "The picture looks barrel-shaped: its distortion seems not to be undone, or it is one of a fisheye lens "
        "(equidistant)."
    )
    evidence = f"k1 of about {radial.radial:+.2f} fits the matches of stage {trace.stages[-COARSE].number}"
    barrel = tuple(Cause(name, text, evidence) for name in BARREL)
    by_focal = _gain(focal, alone)
    return (_focal_length(focal.focal, by_focal), *barrel) if by_focal > _gain(radial, alone) else barrel


def _principal_point(aside: float, gain: float) -> Cause:
    text = (
        f"The picture looks as if its principal point lay more than {abs(aside):.0%} of the width farther to the "
        f"{'right' if aside > 0 else 'left'} than camera_matrix says, or as if it were shifted."
    )
    return Cause("principal-point", text, f"matches fit by {gain:.0%} better so")


def _focal_length(factor: float, gain: float) -> Cause:
    text = (
        f"The picture looks as if its focal length were more than {abs(factor - 1):.0%} "
        f"{'longer' if factor > 1 else 'shorter'} than camera_matrix says."
    )
    return Cause("focal-length", text, f"matches fit by {gain:.0%} better so")
