"""Timelines, properties and entity paths of a recording that several modules know: who writes them and who reads them.

Paths that one tab alone logs and shows stand in its module in `inspector.record.tabs`.
"""

from __future__ import annotations

APPLICATION_ID = "calib-inspect"
COMPARISON_APPLICATION_ID = "calib-inspect-compare"
"""Another application than that of runs, since viewers keep one layout for each."""

FRAME = "frame"
"""Timeline: the frame's number in its sequence."""
TIME = "time"
"""Timeline: seconds since the sequence's first frame."""
STEP = "step"
"""Timeline: ``frame * 8 + stage``; stage 0 is the miscalibrated frame, 1 to 5 are after a stage, then come
`STEP_REFERENCE` and `STEP_RESULT`."""
STEPS_PER_FRAME, STEP_REFERENCE, STEP_RESULT = 8, 6, 7
"""On `STEP`: steps of a frame, the step of the reference where it is known, and that of the result with its verdict."""

RUN = "run"
"""Property: the options that identify the run."""
PROVENANCE = "provenance"
"""Property: versions, records of the weights, and which stages the recording contains."""

OUTCOME = "verdict"
"""Property: the run's verdict in columns, for catalogues to sort and filter by."""

SKIPPED = "skipped"
"""A line of text at every frame that could not be used: why."""
VERDICT_FRAME = "verdict/frame"
"""Whether the frame's calibration is good, as `VERDICT`."""
VERDICT_DRIVE = "verdict/drive"
"""The same of the extrinsic that all frames agree on, at all times."""
VERDICT_GIVEN = "verdict/given"
"""The same of the calibration that the run started from, where that was to be verified."""
VERDICT = "verdict_json"
"""Component of these: the JSON object of `calibnet.verdict.Verdict` as text."""

IMAGE = "image"
TABLE = "table"

OVERLAY_MISCALIBRATED = "overlay/miscalibrated"
OVERLAY_CORRECTED = "overlay/corrected"
OVERLAY_REFERENCE = "overlay/reference"
OVERLAY_CURRENT = "overlay/current"
"""On `STEP` one after the other: start, every stage, reference, result; on the other timelines the result.

The result is that of the whole drive once it is solved as one."""
OVERLAY_WORST = "overlay/worst"
"""The result of the frame that ended worst, at all times. No link of Rerun 0.41's leads to a time of a file: those that
name a time begin with the port of the viewer that opens it, and ``recording://`` names an entity alone."""
IMAGE_WORST = "overlay/worst/image"
"""The picture of that frame."""
OVERLAY_DRIVE = "overlay/drive"
"""Points under the extrinsic that all frames agree on."""
DRIVE_TEXT = "drive/verdict"
"""Verdict on that extrinsic, how sure it is, what it is, and the frames that were left out, as text."""

EXTRINSIC_INITIAL = "extrinsic/initial"
"""Where the calibration of the frame began."""
EXTRINSIC_CORRECTED = "extrinsic/corrected"
"""The frame's result: that of the last stage or, where it is rejected, the initial one."""
EXTRINSIC_REFERENCE = "extrinsic/reference"
EXTRINSIC_DRIVE = "extrinsic/drive"
"""The extrinsic that all frames up to this one agree on; the last row is the drive's."""
CAMERA = "extrinsic/camera"
"""The frame's own camera: ``width``, ``height``, ``camera_matrix`` row by row, and ``source``, its image's name."""
MATRIX = "camera_from_lidar"
"""Component of the extrinsics: 16 float64 row by row, exactly what the run computed."""

LEGEND_POINTS = "legend/points"
"""What the colours of the overlays' points stand for."""
LEGEND_DISPLACEMENT = "legend/displacement"
"""What the colours of displacements stand for."""
LEGEND_DECIDED = "legend/decided"
"""What the brightness of maps of how far cells have decided stands for."""
LEGEND_CERTAINTY = "legend/certainty"
"""What the brightness of probabilities and confidences stands for."""

PICTURE = "picture"
"""Entity below a scale: the picture that its stage saw, under the maps; see `of_scale`."""
RIG = "rig/solved"
"""Recordings of several cameras: what was found of each."""
RIG_JSON = "rig_json"
"""Component of it: a JSON object as text, see `inspector.read.rig`."""

TRAINING_APPLICATION_ID = "calib_inspect_training"
TRAINING = "training"
"""Below it the losses of a training run, and below the next its figures on held-out frames."""
VALIDATION = "validation"
APPLICATIONS = (APPLICATION_ID, COMPARISON_APPLICATION_ID, TRAINING_APPLICATION_ID)
"""All that we record for a viewer to open."""

ERROR_KINDS = {"rotation": "deg", "translation": "cm"}
"""The error curves and their units."""


def camera_of_rig(name: str) -> str:
    """Prefix of what belongs to one of several cameras."""
    escaped = "".join(one if one.isalnum() or one in "-_" else f"\\{one}" for one in name)
    return f"cameras/{escaped}"


def overlay_stage(number: int) -> str:
    """Points over the image after a stage."""
    return f"overlay/stage_{number}"


def caption(overlay: str) -> str:
    """Which extrinsic an overlay shows and how far off it is, written into the picture."""
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
    """Error curve of the final result: the last stage's, whichever it is."""
    return f"error/{kind}/corrected"


def error_drive(kind: str) -> str:
    """Error curve of what all frames of a run agree on, in comparisons."""
    return f"error/{kind}/drive"


def error_limit(kind: str) -> str:
    """The limit of the success rate, as a curve to hold the others against."""
    return f"error/{kind}/success_limit"


def of_scale(stage: int, stride: int, name: str) -> str:
    """What is logged of one scale of a stage's cost volumes, ``stride`` pixels of its image a cell."""
    return f"stage_{stage}/scale_{stride}/{name}"
