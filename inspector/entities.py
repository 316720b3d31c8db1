"""Every entity path and timeline of a recording, in one place.

`stage_logging`, `frame_logging` and `scene_logging` write them, `blueprint` shows them, tests and
scripts read them back. A new view starts with a path here.
"""

from __future__ import annotations

APPLICATION_ID = "calib-inspect"
COMPARISON_APPLICATION_ID = "calib-inspect-compare"
"""Of another layout, which viewers keep by application."""

FRAME = "frame"
"""Timeline: the frame's number in its sequence."""
TIME = "time"
"""Timeline: seconds since the sequence's first frame."""
STEP = "step"
"""Timeline: ``frame * 6 + stage``; stage 0 is the miscalibrated frame, 5 the last stage."""
STEPS_PER_FRAME = 6

RUN = "run"
"""Property: the options that identify the run."""
PROVENANCE = "provenance"
"""Property: what a reader needs besides, see `inspector.record.recording.Recording`."""

IMAGE = "image"
TABLE = "table"

OVERLAY_MISCALIBRATED = "overlay/miscalibrated"
OVERLAY_CORRECTED = "overlay/corrected"
OVERLAY_REFERENCE = "overlay/reference"
OVERLAY_CURRENT = "overlay/current"

WORLD = "world"
CLOUD = "world/cloud"
"""Positions, once a frame, and colours through every extrinsic: components of the archetype `COLORS_THROUGH`."""
COLORS_THROUGH = "colors_through"
LIDAR = "world/lidar"
CAMERA_INITIAL = "world/camera/initial"
CAMERA_REFERENCE = "world/camera/reference"

EXTRINSIC_INITIAL = "extrinsic/initial"
EXTRINSIC_CORRECTED = "extrinsic/corrected"
EXTRINSIC_REFERENCE = "extrinsic/reference"
EXTRINSIC_DRIVE = "extrinsic/drive"
CAMERA = "extrinsic/camera"
"""The frame's own camera: ``width``, ``height``, ``camera_matrix`` row by row, and ``source``, its image's name."""
MATRIX = "camera_from_lidar"
"""Component of the extrinsics: 16 float64 row by row, exactly what the run computed."""

LEGEND_POINTS = "legend/points"
"""What the colours of the overlays' points stand for."""
LEGEND_DISPLACEMENT = "legend/displacement"
LEGEND_CERTAINTY = "legend/certainty"
LEGEND_WINDOW = "legend/window"
LEGEND_STAGES = "legend/stages"

TRAINING_APPLICATION_ID = "calib_inspect_training"
TRAINING = "training"
VALIDATION = "validation"

ERROR_KINDS = {"rotation": "deg", "translation": "cm"}
"""The error curves and their units."""


FIT = "fit"
FIT_LIMIT = "fit/limit"
"""Up to which the last stage's answer is believed."""


def overlay_stage(number: int) -> str:
    """Points over the image after a stage."""
    return f"overlay/stage_{number}"


def caption(overlay: str) -> str:
    """Which extrinsic an overlay shows and how far off it is, written into the picture."""
    return f"{overlay}/caption"


def camera_stage(number: int) -> str:
    """The camera's frustum in the LiDAR frame after a stage."""
    return f"world/camera/stage_{number}"


def drive_parameter(name: str) -> str:
    """One parameter of the extrinsic estimated from the whole drive."""
    return f"drive/{name}"


def drive_curve(name: str, curve: str) -> str:
    """Its curve after every frame: ``estimate``, or the ``upper`` or ``lower`` end of its uncertainty."""
    return f"{drive_parameter(name)}/{curve}"


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


def error_limit(kind: str) -> str:
    """The bound of the success rate, as a curve to hold the others against."""
    return f"error/{kind}/success_limit"


def fit_stage(number: int) -> str:
    """Curve of the error that a stage expects of its matches, in pixels of the frame's image."""
    return f"{FIT}/stage_{number}"


def displacement(stage: int) -> str:
    """Where the network moves the LiDAR cells, as a map of flow colours."""
    return f"stage_{stage}/displacement"


def displacement_arrows(stage: int) -> str:
    """The same, as arrows in cells."""
    return f"stage_{stage}/displacement/arrows"


def confidence(stage: int) -> str:
    """How sure the network is of each displacement."""
    return f"stage_{stage}/confidence"


def cost_volume(stage: int, stride: int) -> str:
    """The matching scores as a tensor ``dy, dx, y, x``."""
    return f"stage_{stage}/scale_{stride}/cost_volume"


def probability(stage: int, stride: int) -> str:
    """The aggregated volume, a softmax over the window, as a tensor ``dy, dx, y, x``."""
    return f"stage_{stage}/scale_{stride}/probability"


def best_match(stage: int, stride: int) -> str:
    """Displacement of the most probable cell, as flow colours."""
    return f"stage_{stage}/scale_{stride}/best_match"


def true_match(stage: int, stride: int) -> str:
    """Displacement to where the reference puts each cell's point, as flow colours."""
    return f"stage_{stage}/scale_{stride}/true_match"


def peak_probability(stage: int, stride: int) -> str:
    """Probability of the best match: how sure each cell is."""
    return f"stage_{stage}/scale_{stride}/peak_probability"


def slices(stage: int, stride: int) -> str:
    """All slices of the aggregated volume side by side, one for every displacement."""
    return f"stage_{stage}/scale_{stride}/slices"


def slice_marks(stage: int, stride: int) -> str:
    """Frames around the slice that won most cells and the one that holds the true displacement; axis labels."""
    return f"{slices(stage, stride)}/marks"


def window(stage: int, stride: int) -> str:
    """The search window of the chosen cell."""
    return f"stage_{stage}/scale_{stride}/window"


def window_cells(stage: int, stride: int) -> str:
    """The cell where the point is now and the one where it was found, framed in that window."""
    return f"{window(stage, stride)}/cells"


def window_truth(stage: int, stride: int) -> str:
    """Where the reference puts the point, in that window or, if outside, on its border."""
    return f"{window(stage, stride)}/truth"


def chosen_cell(stage: int, stride: int) -> str:
    """A frame around the chosen cell, drawn over the maps."""
    return f"stage_{stage}/scale_{stride}/chosen_cell"


def hourglass_before(stage: int, stride: int) -> str:
    """Activations entering the hourglass, channels side by side."""
    return f"stage_{stage}/scale_{stride}/hourglass_before"


def hourglass_after(stage: int, stride: int) -> str:
    """Activations leaving the hourglass, channels side by side."""
    return f"stage_{stage}/scale_{stride}/hourglass_after"
