"""Tab *Whole drive as one*: the convergence of the six parameters that are estimated from all frames of a drive.

Each curve has its uncertainty band, and the verdict is beside them. The tab exists if `Layout.with_drive` is set,
whatever else is recorded.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from calibnet.geometry import PoseError, degrees_and_cm, pose_error
from calibnet.geometry.types import Extrinsic
from calibnet.runtime.text import number_of
from calibnet.trace import DriveEstimate, Estimate
from calibnet.verdict import Verdict
from inspector import colors, entities
from inspector.record.contents import Contents, Part
from inspector.record.observation import Layout, Observation
from inspector.record.pictures.frame_overlays import FrameOverlays, given_caption
from inspector.record.pictures.legends import log_names
from inspector.record.subtree import Subtree
from inspector.record.tabs.table import matrix_lines
from inspector.record.tabs.views import View, curve_view, frames_named, legend, with_legend
from inspector.verdicts import OF_GIVEN, certainty, found_lines, markdown_lines

NAME = "Whole drive as one"

PARAMETERS = {"roll": "deg", "pitch": "deg", "yaw": "deg", "x": "cm", "y": "cm", "z": "cm"}
"""Parameters of the extrinsic, in the camera frame, with the unit of their curves."""
COVARIANCE_ROWS = {"x": 0, "y": 1, "z": 2, "pitch": 3, "yaw": 4, "roll": 5}
LEGEND_CURVES = "legend/drive"
"""Legend of the curves."""
CURVES = {"estimate": colors.FOUND, "upper": colors.LIMIT, "lower": colors.LIMIT, "zero": colors.INITIAL}
"""Curves of every parameter, and their colours."""


NOT_YET = "# Not solved yet\n\nThe whole drive is solved as one when the last of its frames is calibrated."
TEXT_SHARE = 0.28
"""Share of the tab's width that the text takes."""


def parameter(name: str) -> str:
    """Entity of one parameter of the drive's extrinsic."""
    return f"drive/{name}"


def curve(name: str, kind: str) -> str:
    """Entity of a parameter's curve: ``estimate``, the ``upper`` or ``lower`` end of its uncertainty, or ``zero``."""
    return f"{parameter(name)}/{kind}"


def wanted(layout: Layout) -> bool:
    """Whether an estimate from the whole drive follows the frames."""
    return layout.with_drive


def log_once(rec: Subtree, layout: Layout) -> None:
    """Log the names and colours of the curves."""
    names = {"estimate from the frames so far": colors.FOUND, "± one standard deviation": colors.LIMIT}
    names[_zero(layout)] = colors.INITIAL
    log_names(rec, LEGEND_CURVES, names | frames_named(layout))
    rec.log_once(entities.DRIVE_TEXT, rr.TextDocument(NOT_YET, media_type=rr.MediaType.MARKDOWN))
    for name in PARAMETERS:
        for kind, color in CURVES.items():
            label = {"upper": "+1σ", "lower": "-1σ", "zero": _zero(layout)}.get(kind, kind)
            width = 2.5 if kind == "estimate" else 1.0
            rec.log_once(curve(name, kind), rr.SeriesLines(names=label, colors=color, widths=width))


def log(rec: Subtree, observation: Observation, contents: Contents) -> None:
    """Log nothing for a single frame, since the estimate needs all of them; see `log_drive`."""


def log_drive(
    rec: Subtree,
    estimate: DriveEstimate,
    reference: Extrinsic | None,
    seconds: Mapping[int, float],
    given: Verdict | None = None,
    remarks: Sequence[str] = (),
) -> None:
    """Log the estimate after each frame of its history, on the frames' own times.

    Args:
        rec: recording that has the frames already.
        estimate: estimate of the drive.
        reference: extrinsic to which curves are relative; None for the estimate from all frames.
        seconds: time of every recorded frame, by its number.
        given: verdict on the extrinsic that the drive started from, if that was to be verified.
        remarks: further sentences, on the single frames.
    """
    lines = _lines(estimate, reference, given, remarks)
    text = rr.TextDocument("\n".join(lines), media_type=rr.MediaType.MARKDOWN)
    rec.log_for_all(entities.DRIVE_TEXT, text)
    origin = estimate.camera_from_lidar if reference is None else reference
    for frame, current in estimate.history:
        rec.set_frame(frame, seconds.get(frame, 0.0))
        rec.log(entities.EXTRINSIC_DRIVE, rr.AnyValues(camera_from_lidar=current.camera_from_lidar.flatten()))
        error = pose_error(current.camera_from_lidar, origin)
        for name in PARAMETERS:
            value, band = offset(error, name), deviation(current, name)
            for kind, level in zip(CURVES, (value, value + band, value - band, 0.0), strict=True):
                rec.log(curve(name, kind), rr.Scalars(level))


def view(layout: Layout) -> View:
    """The verdict beside six plots, whose curves converge to zero for a good calibration."""
    views = [
        curve_view(f"{name.capitalize()} off {_zero(layout)} [{unit}]", f"/{parameter(name)}")
        for name, unit in PARAMETERS.items()
    ]
    text = rrb.TextDocumentView(origin=entities.DRIVE_TEXT, name="Verdict")
    curves = with_legend(rrb.Grid(*views, grid_columns=3), legend("Curves", LEGEND_CURVES), "Curves")
    return rrb.Horizontal(text, curves, column_shares=[TEXT_SHARE, 1 - TEXT_SHARE], name=NAME)


def _zero(layout: Layout) -> str:
    """The extrinsic to which the curves are relative, in words."""
    return "the reference" if layout.has_reference else "the final estimate"


def log_drive_overlay(rec: Subtree, observation: Observation, contents: Contents, verdict: Verdict | None) -> None:
    """Log a frame's points under the drive's extrinsic, which the observation's trace starts from.

    Args:
        rec: recording that has the frame already.
        observation: the frame, with the verdict on the given extrinsic if that was to be verified.
        contents: content of the recording.
        verdict: verdict on the drive.
    """
    rec.set_frame(observation.frame.index, observation.frame.timestamp)
    name = "whole drive as one" if verdict is None else f"whole drive, {verdict.word}"
    if observation.given is not None:
        verdict, name = observation.given, given_caption(observation.given)
    color = colors.LETTERS if verdict is None else colors.VERDICTS[verdict.word]
    overlays = FrameOverlays(observation, contents)
    overlays.log(rec, entities.OVERLAY_DRIVE, name, observation.trace.initial, color)
    if Part.OVERLAYS in contents.parts:  # in place of the frame's own result
        rec.set_step(observation.frame.index, entities.STEP_RESULT)
        overlays.log(rec, entities.OVERLAY_CURRENT, name, observation.trace.initial, color)
        rec.set_step(observation.frame.index, 0)


def _lines(
    estimate: DriveEstimate, reference: Extrinsic | None, given: Verdict | None, remarks: Sequence[str]
) -> list[str]:
    """Verdicts, error if known, frames and the matrix, as Markdown."""
    lines = [] if given is None else markdown_lines(given, OF_GIVEN)
    if estimate.verdict is not None:
        lines += found_lines(estimate.verdict, given)
        if certainty(estimate.verdict):
            lines.pop()  # uncertainty and error form one paragraph
    solved = f"solved from {estimate.frames} frame{'' if estimate.frames == 1 else 's'}"
    if reference is not None:
        error = pose_error(estimate.camera_from_lidar, reference)
        lines += [f"**Off the reference by {degrees_and_cm(error.rotation_deg, error.translation_cm)}**, {solved}.", ""]
    else:
        lines += [f"{solved.capitalize()}.", ""]
    if motion := motion_sentence(estimate):
        lines += [f"**Motion of the car.** {motion}", ""]
    if remarks:
        lines += [f"**One by one.** {' '.join(remarks)}", ""]
    if estimate.skipped:
        lines += ["Skipped:", "", *(f"- frame {bad.frame}: {bad.why}" for bad in estimate.skipped), ""]
    return [*lines, *matrix_lines("The drive's", estimate.camera_from_lidar), ""]


def offset(error: PoseError, name: str) -> float:
    """One parameter of an error, in degrees or centimetres."""
    value: float = getattr(error, f"{name}_{PARAMETERS[name]}")
    return value


def deviation(estimate: Estimate, name: str) -> float:
    """Standard deviation of one parameter, in degrees or centimetres."""
    row = COVARIANCE_ROWS[name]
    sigma = float(np.sqrt(estimate.covariance[row, row]))
    return float(np.degrees(sigma)) if PARAMETERS[name] == "deg" else 100 * sigma


def drive_sentence(estimate: DriveEstimate, reference: Extrinsic | None, initial: Extrinsic) -> str:
    """The result for the terminal."""
    error = pose_error(estimate.camera_from_lidar, initial if reference is None else reference)
    what = "changed the calibration by" if reference is None else "off by"
    skipped = f", {len(estimate.skipped)} more could not be used" if estimate.skipped else ""
    result = (
        f"Whole drive as one ({estimate.frames} frames{skipped}): {what} "
        f"{degrees_and_cm(error.rotation_deg, error.translation_cm)}; "
    )
    sure = f"±{degrees_and_cm(estimate.rotation_deg, estimate.translation_cm)} (1σ)"
    if estimate.networks is None:
        return f"{result}{sure} by the frames' scatter, not counting what all of them get wrong."
    alone = pose_error(estimate.networks.camera_from_lidar, initial if reference is None else reference)
    before = f"Before its edges were aligned: {degrees_and_cm(alone.rotation_deg, alone.translation_cm)}."
    return " ".join(filter(None, [f"{result}{sure}.", before, motion_sentence(estimate)]))


def motion_sentence(estimate: DriveEstimate) -> str:
    """How far the extrinsic that the motion of the car shows is from the result; empty without motion."""
    motion = estimate.motion
    if motion is None or not motion.certain:
        return ""
    apart = pose_error(motion.camera_from_lidar, estimate.camera_from_lidar)
    return (
        f"The motion of {number_of(motion.tracks, 'point')} in {number_of(motion.frames, 'pair')} of frames shows an "
        f"extrinsic {degrees_and_cm(apart.rotation_deg, apart.translation_cm)} away from it, "
        f"±{degrees_and_cm(motion.rotation_deg, motion.translation_cm)} (1σ)."
    )
