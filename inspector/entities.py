"""Timelines, properties and entity paths of a recording that several modules write or read.

Paths that only one tab logs and shows are defined in its module in `inspector.record.tabs`.
"""

from __future__ import annotations

APPLICATION_ID = "calib-inspect"
COMPARISON_APPLICATION_ID = "calib-inspect-compare"
"""Application id of comparisons; not that of runs, since viewers keep one layout per application."""

FRAME = "frame"
"""Timeline: the frame's number in its sequence."""
TIME = "time"
"""Timeline: seconds since the sequence's first frame."""
STEP = "step"
"""Timeline: ``frame * 8 + stage``; stage 0 is the miscalibrated frame, 1 to 5 are after a stage, then come
`STEP_REFERENCE` and `STEP_RESULT`."""
STEPS_PER_FRAME, STEP_REFERENCE, STEP_RESULT = 8, 6, 7
"""On `STEP`: number of steps per frame, the step of the reference if known, and the step of the result and verdict."""

RUN = "run"
"""Property: the options that identify the run."""
PROVENANCE = "provenance"
"""Property: versions, records of the weights, and which stages the recording contains."""

OUTCOME = "verdict"
"""Property: the run's verdict in columns, by which catalogues sort and filter."""

SKIPPED = "skipped"
"""Text at every frame that could not be used, with the reason."""
VERDICT_FRAME = "verdict/frame"
"""Verdict on the frame's result, as `VERDICT`."""
VERDICT_DRIVE = "verdict/drive"
"""Verdict on the drive's extrinsic, at all times."""
VERDICT_GIVEN = "verdict/given"
"""Verdict on the calibration that the run started from, where it was to be verified."""
VERDICT = "verdict_json"
"""Component of the verdict entities: the JSON object of `calibnet.verdict.Verdict` as text."""

IMAGE = "image"
TABLE = "table"

OVERLAY_MISCALIBRATED = "overlay/miscalibrated"
OVERLAY_CORRECTED = "overlay/corrected"
OVERLAY_REFERENCE = "overlay/reference"
OVERLAY_CURRENT = "overlay/current"
"""Points over the image: on `STEP`, those of the start, every stage, the reference and the result in turn; on the other
timelines, those of the result. The result is the whole drive's once that is solved."""
OVERLAY_WORST = "overlay/worst"
"""Points under the result of the worst frame, at all times, since no link of Rerun 0.41 leads to a time of a file:
links that name a time begin with the port of the viewer that opens it, and ``recording://`` names an entity only."""
IMAGE_WORST = "overlay/worst/image"
"""Image of the worst frame."""
OVERLAY_DRIVE = "overlay/drive"
"""Points under the drive's extrinsic."""
DRIVE_TEXT = "drive/verdict"
"""Text on the drive's extrinsic: verdict, uncertainty, values, and the frames left out."""

EXTRINSIC_INITIAL = "extrinsic/initial"
"""The frame's initial extrinsic."""
EXTRINSIC_CORRECTED = "extrinsic/corrected"
"""The frame's result: that of the last stage or, where it is rejected, the initial one."""
EXTRINSIC_REFERENCE = "extrinsic/reference"
EXTRINSIC_DRIVE = "extrinsic/drive"
"""The extrinsic solved from all frames up to this one; the last row is the drive's."""
CAMERA = "extrinsic/camera"
"""The frame's own camera: ``width``, ``height``, ``camera_matrix`` row by row, and ``source``, its image's name."""
MATRIX = "camera_from_lidar"
"""Component of the extrinsics: 16 float64 row by row, exactly what the run computed."""

LEGEND_POINTS = "legend/points"
"""Legend of the colours of points in overlays."""
LEGEND_DISPLACEMENT = "legend/displacement"
"""Legend of the colours of displacements."""
LEGEND_DECIDED = "legend/decided"
"""Legend of the maps of how decided cells are."""
LEGEND_CERTAINTY = "legend/certainty"
"""Legend of maps of probabilities and confidences."""

PICTURE = "picture"
"""Entity below a scale: the image that its stage saw, shown under the maps; see `of_scale`."""
RIG = "rig/solved"
"""Result of a rig, with that of each camera."""
RIG_JSON = "rig_json"
"""Component of `RIG`: a JSON object as text, see `inspector.read.rig`."""

WATCH_TEXT = "watch/result"
"""Whether the mount moved, in words."""
FAILURE = "sentence"
"""Why a run failed, in words."""

TRAINING_APPLICATION_ID = "calib_inspect_training"
TRAINING = "training"
"""Parent entity of a training run's losses; that of its errors on held-out frames is the next."""
VALIDATION = "validation"
APPLICATIONS = (APPLICATION_ID, COMPARISON_APPLICATION_ID, TRAINING_APPLICATION_ID)
"""Application ids of all recordings that a viewer can open."""

ERROR_KINDS = {"rotation": "deg", "translation": "cm"}
"""Kinds of error curves, and their units."""


def camera_of_rig(name: str) -> str:
    """Entity prefix of one camera of a rig."""
    import rerun as rr  # commands that need no recording know these names too, and do not wait for it

    return f"cameras/{rr.escape_entity_path_part(name)}"


def overlay_stage(number: int) -> str:
    """Points over the image after a stage."""
    return f"overlay/stage_{number}"


def caption(overlay: str) -> str:
    """Text in an overlay: the extrinsic that it shows, and its error."""
    return f"{overlay}/caption"


def extrinsic_stage(number: int) -> str:
    """The extrinsic after a stage, as numbers."""
    return f"extrinsic/stage_{number}"


def error_initial(kind: str) -> str:
    """Error curve of the miscalibrated frame, ``kind`` as in `ERROR_KINDS`."""
    return f"error/{kind}/initial"


def error_stage(kind: str, number: int) -> str:
    """Error curve after a stage."""
    return f"error/{kind}/stage_{number}"


def error_corrected(kind: str) -> str:
    """Error curve of the final result, that of the last stage that ran."""
    return f"error/{kind}/corrected"


def error_drive(kind: str) -> str:
    """Error curve of the drive's extrinsic, in comparisons."""
    return f"error/{kind}/drive"


def error_limit(kind: str) -> str:
    """What a frame's result must be within to be accepted, as a curve to compare the others with."""
    return f"error/{kind}/limit"


def of_scale(stage: int, stride: int, name: str) -> str:
    """Entity of one scale of a stage's cost volumes, with cells of ``stride`` pixels."""
    return f"stage_{stage}/scale_{stride}/{name}"
