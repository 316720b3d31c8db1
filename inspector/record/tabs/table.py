"""The text panel: the effect of every stage on this frame, as Markdown.

It has no timings, which differ from run to run, since two recordings with one seed must be equal; the command line
prints them.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from calibnet.geometry import RANGES, MiscalibrationRange, PoseError, degrees_and_cm, pose_error
from calibnet.geometry.types import Extrinsic
from calibnet.trace import CascadeTrace
from inspector import entities
from inspector.markdown import markdown_table
from inspector.record.observation import Observation
from inspector.verdicts import OF_GIVEN, found_lines, markdown_lines

NOTHING = "–"
READING_AID = (
    "Where the calibration is right, jumps in the points' colours lie on edges of the image. Switch between the images "
    "by the tabs above them, or select the timeline `step` below and press the arrow keys to step through start, every "
    "stage, reference and result of each frame in the same place."
)


def stage_table(observation: Observation, path: Callable[[str], str] | None = None) -> str:
    """The table of one frame, including the stages that did not run and the reasons.

    Args:
        observation: the frame and its calibration.
        path: gives the full path of an entity, so that the names of stages link to their overlays; None if these are
            not recorded.
    """
    lines = [
        *_verdicts(observation),
        f"### {_headline(observation)}",
        "",
        *_stages(observation, path),
        "",
        *_match_error(observation),
        *_axes(observation),
        "",
    ]
    lines += [f"{stage.reason}\n" for stage in observation.skipped]
    if observation.reference is None:
        lines += ["*These frames have no reference extrinsic, so there are no errors.*", ""]
    return "\n".join([*lines, *_extrinsic(observation.trace), "", READING_AID, ""])


def _verdicts(observation: Observation) -> list[str]:
    """The verdicts on the extrinsic that the run started from, if that is verified, and on the result."""
    given, found = observation.given, observation.trace.verdict
    lines = [] if given is None else markdown_lines(given, OF_GIVEN)
    return lines if found is None else lines + found_lines(found, given)


def _headline(observation: Observation) -> str:
    """The result in one line."""
    frame, trace = observation.frame, observation.trace
    if trace.rejected:
        return f"Frame {frame.index}: left as it was"
    before, after = observation.error(trace.initial), observation.error(trace.corrected)
    if before is None or after is None:
        change = pose_error(trace.corrected, trace.initial)
        return f"Frame {frame.index}: corrected by {change.rotation_deg:.2f}° and {change.translation_cm:.1f} cm"
    return (
        f"Frame {frame.index}: {before.rotation_deg:.2f}° → {after.rotation_deg:.2f}°, "
        f"{before.translation_cm:.1f} → {after.translation_cm:.1f} cm"
    )


def _match_error(observation: Observation) -> list[str]:
    """The match error after the last stage, in pixels of the frame's image."""
    trace = observation.trace
    if not trace.stages or math.isinf(trace.match_error_limit_px):
        return []
    last = trace.stages[-1]
    found = f"{observation.image_px(last, last.match_error_px):.1f} px"
    limit = f"{observation.image_px(last, trace.match_error_limit_px):.1f} px"
    lines = [f"Expected match error after stage {last.number}: {found}; results with at most {limit} are believed.", ""]
    if not trace.fits:
        lines += [
            "Check that image and scan belong together, and that the start is within the first stage's range.",
            "",
        ]
    return lines


def _stages(observation: Observation, path: Callable[[str], str] | None) -> list[str]:
    trace = observation.trace
    with_errors = observation.reference is not None
    skipped = {stage.number for stage in observation.skipped}
    ran = {stage.number: stage for stage in trace.stages}
    for_ = "made for" if trace.method else "trained for"
    header = ["after", for_, *(["rotation error", "translation error"] if with_errors else []), "moved by"]
    rows = [[observation.start, NOTHING, *_error(observation.error(trace.initial)), NOTHING]]
    for number in sorted(skipped | set(ran)):
        if number in ran:
            stage = ran[number]
            motion = pose_error(stage.after, stage.before)
            change = degrees_and_cm(motion.rotation_deg, motion.translation_cm)
            name = f"stage {number}"
            if path is not None:
                name = f"[{name}](recording://{path(entities.overlay_stage(number))})"
            rows.append([name, _range(stage.range), *_error(observation.error(stage.after)), change])
        else:
            empty = [NOTHING, NOTHING] if with_errors else []
            rows.append([f"stage {number}", _range(RANGES[number - 1]), *empty, "skipped"])
    return markdown_table(header, rows)


def _range(range_: MiscalibrationRange) -> str:
    return f"±{range_.rotation_deg:g}° / {range_.translation_m:g} m"


def _axes(observation: Observation) -> list[str]:
    """The remaining error per axis or, without a reference, the correction per axis."""
    trace = observation.trace
    known = observation.reference is not None
    rows = {
        "miscalibrated by": observation.error(trace.initial),
        "remaining error": observation.error(trace.corrected),
        "corrected by": None if known else pose_error(trace.corrected, trace.initial),
    }
    header = ["", "roll", "pitch", "yaw", "x (right)", "y (down)", "z (ahead)"]
    return markdown_table(header, [[name, *_per_axis(error)] for name, error in rows.items() if error is not None])


def _per_axis(error: PoseError) -> list[str]:
    angles = (error.roll_deg, error.pitch_deg, error.yaw_deg)
    offsets = (error.x_cm, error.y_cm, error.z_cm)
    return [f"{angle:+.2f}°" for angle in angles] + [f"{offset:+.1f} cm" for offset in offsets]


def _extrinsic(trace: CascadeTrace) -> list[str]:
    return matrix_lines("Uncorrected" if trace.rejected else "Corrected", trace.corrected)


def matrix_lines(which: str, camera_from_lidar: Extrinsic) -> list[str]:
    """An extrinsic as Markdown."""
    rows = (" ".join(f"{value:9.5f}" for value in row) for row in camera_from_lidar[:3])
    return [f"{which} `camera_from_lidar` (metres)", "```", *rows, "```"]


def _error(error: PoseError | None) -> list[str]:
    return [] if error is None else [f"{error.rotation_deg:.2f}°", f"{error.translation_cm:.1f} cm"]
