"""One estimate from the whole drive: how each of its six parameters converges, with its uncertainty band."""

from __future__ import annotations

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from calibnet.geometry import PoseError, pose_error
from calibnet.geometry.types import Extrinsic
from calibnet.trace import DriveEstimate, Estimate
from inspector import colors, entities

BAND = 2.0
"""Standard deviations on either side of the estimate: 95 % of the errors, if it is right about itself."""
PARAMETERS = {"pitch": "deg", "yaw": "deg", "roll": "deg", "x": "cm", "y": "cm", "z": "cm"}
"""Of the extrinsic, in the camera frame, with the unit of their curves."""
COVARIANCE_ROWS = {"x": 0, "y": 1, "z": 2, "pitch": 3, "yaw": 4, "roll": 5}
CURVES = {"estimate": colors.FOUND, "upper": (150, 150, 150), "lower": (150, 150, 150)}


def log_drive(
    rec: rr.RecordingStream,
    estimate: DriveEstimate,
    reference: Extrinsic | None,
    seconds: dict[int, float],
) -> None:
    """Log the estimate after each frame of its history, on the frames' own times.

    Args:
        rec: the frames are already in it.
        estimate: of the drive.
        reference: that curves are relative to; without one, the estimate of all frames.
        seconds: time of every recorded frame by its index.
    """
    origin = estimate.camera_from_lidar if reference is None else reference
    for name in PARAMETERS:
        for curve, color in CURVES.items():
            label = {"upper": f"+{BAND:g} σ", "lower": f"-{BAND:g} σ"}.get(curve, curve)
            style = rr.SeriesLines(names=label, colors=color, widths=2.5 if curve == "estimate" else 1.0)
            rec.log(entities.drive_curve(name, curve), style, static=True)
    for frame, current in estimate.history:
        rec.set_time(entities.FRAME, sequence=frame)
        rec.set_time(entities.TIME, duration=seconds.get(frame, 0.0))
        rec.set_time(entities.STEP, sequence=frame * entities.STEPS_PER_FRAME)
        rec.log(entities.EXTRINSIC_DRIVE, rr.AnyValues(camera_from_lidar=current.camera_from_lidar.flatten()))
        offsets = pose_error(current.camera_from_lidar, origin)
        for name in PARAMETERS:
            value, band = offset(offsets, name), BAND * deviation(current, name)
            for curve, level in (("estimate", value), ("upper", value + band), ("lower", value - band)):
                rec.log(entities.drive_curve(name, curve), rr.Scalars(level))


def offset(error: PoseError, parameter: str) -> float:
    """One parameter of an error, in degrees or centimetres."""
    value: float = getattr(error, f"{parameter}_{PARAMETERS[parameter]}")
    return value


def deviation(estimate: Estimate, parameter: str) -> float:
    """Standard deviation of one parameter, in degrees or centimetres."""
    row = COVARIANCE_ROWS[parameter]
    sigma = float(np.sqrt(estimate.covariance[row, row]))
    return float(np.degrees(sigma)) if PARAMETERS[parameter] == "deg" else 100 * sigma


def drive_tab(has_reference: bool) -> rrb.Container:
    """Six curves: a good calibration runs into zero, inside its band."""
    zero = "the reference" if has_reference else "the estimate from all frames"
    views = [
        rrb.TimeSeriesView(
            origin=f"/{entities.drive_parameter(name)}",
            name=f"{name.capitalize()} off {zero} [{unit}]",
            plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop),
        )
        for name, unit in PARAMETERS.items()
    ]
    return rrb.Grid(*views, grid_columns=3, name="Whole drive as one")


def drive_sentence(estimate: DriveEstimate, reference: Extrinsic | None, initial: Extrinsic) -> str:
    """The result for the terminal."""
    error = pose_error(estimate.camera_from_lidar, initial if reference is None else reference)
    what = "changed the calibration by" if reference is None else "off by"
    skipped = f", {estimate.skipped} more could not be used" if estimate.skipped else ""
    result = (
        f"Whole drive as one ({estimate.frames} frames{skipped}): {what} {error.rotation_deg:.2f}° / "
        f"{error.translation_cm:.1f} cm; "
    )
    sure = f"sure to {estimate.rotation_deg:.2f}° / {estimate.translation_cm:.1f} cm"
    if estimate.networks is None:
        return f"{result}by the frames' scatter it is {sure}, not counting what all of them get wrong."
    alone = pose_error(estimate.networks.camera_from_lidar, initial if reference is None else reference)
    return (
        f"{result}{sure} (one standard deviation). Before its edges were aligned: {alone.rotation_deg:.2f}° / "
        f"{alone.translation_cm:.1f} cm."
    )
