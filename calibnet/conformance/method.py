"""What a method promises: `check_method`."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np

from calibnet.calibrator import Calibrator, DriveCalibrator, drives_only
from calibnet.conformance.requirement import require, require_definite, require_rigid
from calibnet.datasets.frame import Frame, Frames
from calibnet.geometry import RANGES, miscalibration
from calibnet.geometry.types import Extrinsic
from calibnet.trace import CascadeTrace, DriveEstimate


def check_method(calibrator: Calibrator, frame: Frame | None = None, drive: Frames | None = None) -> None:
    """Hold a method to the promises of `Calibrator` and, where it is one, of `DriveCalibrator`.

    Whether it is any good is for `calibnet.evaluation.measure` to say.

    Args:
        calibrator: ready to use.
        frame: one that it can calibrate from 1° and 5 cm off; a synthetic one by default.
        drive: frames likewise, of a method that solves drives; twice the frame by default. One that tells something of
            drives alone is held to the promises on these, and needs frames that move.

    Raises:
        AssertionError: one of them is not kept; the sentence says which.
    """
    require(isinstance(calibrator, Calibrator), "A method has calibrate(frame, initial, detail=False).")
    if drives_only(calibrator):
        require(drive is not None, "A method that calibrates only whole drives has to be tested with a drive.")
        assert isinstance(calibrator, DriveCalibrator)
        assert drive is not None
        _check_drives_only(calibrator, drive)
        return
    chosen = synthetic_frame() if frame is None else frame
    initial = miscalibration([0.6, -0.6, 0.5], [0.03, -0.03, 0.03]) @ chosen.camera_from_lidar
    before, start = copy.deepcopy(chosen), initial.copy()
    trace = calibrator.calibrate(chosen, initial)
    check_trace(trace, start)
    untouched = np.array_equal(before.image, chosen.image) and np.array_equal(before.points, chosen.points)
    require(untouched and np.array_equal(initial, start), "The method changes the frame or the extrinsic it is given.")
    again = calibrator.calibrate(chosen, initial)
    require(np.array_equal(trace.corrected, again.corrected), "The same frame and start give different results.")
    blind = calibrator.calibrate(replace(chosen, camera_from_lidar=np.eye(4)), initial)
    require(np.array_equal(trace.corrected, blind.corrected), "The method uses the frame's own extrinsic.")
    shown = calibrator.calibrate(chosen, initial, detail=True)
    check_trace(shown, start)
    _check_exhibits(shown)
    if isinstance(calibrator, DriveCalibrator):
        _check_drive(calibrator, drive or [chosen, replace(chosen, index=chosen.index + 1)], initial)


def check_trace(trace: CascadeTrace, initial: Extrinsic) -> None:
    """Hold a trace to its own rules: it starts where it should, and each stage where the one before ended."""
    require(np.array_equal(trace.initial, initial), "The trace does not start from the extrinsic that was given.")
    require(len(trace.stages) > 0, "The trace has no stage; a method without stages has one.")
    stages = (*trace.wider, *trace.stages)
    numbers = [stage.number for stage in stages]
    rising = numbers == sorted(set(numbers)) and set(numbers) <= set(range(1, len(RANGES) + 1))
    require(rising, f"The stages are numbered {numbers} instead of ascending within 1 to {len(RANGES)}.")
    expected = initial
    for stage in stages:
        name = f"stage {stage.number}"
        require(np.array_equal(stage.before, expected), f"{name} does not start where the one before it ended.")
        require_rigid(stage.correction, f"the correction of {name}")
        require(np.allclose(stage.after, stage.correction @ stage.before), f"{name}: after is not correction @ before.")
        if stage.information is not None:
            require_definite(stage.information, f"the information of {name}")
        require(min(stage.milliseconds.values(), default=0.0) >= 0, f"{name} has a negative time.")
        expected = stage.after
    require_rigid(trace.corrected, "the corrected extrinsic")


def _check_exhibits(trace: CascadeTrace) -> None:
    """Pictures and curves can be shown, and have names of their own."""
    for stage in trace.stages:
        names = [*(shown.name for shown in stage.exhibits), *(curve.name for curve in stage.curves)]
        require(
            len(set(names)) == len(names) and all(names),
            f"The exhibits of stage {stage.number} do not have distinct names: {names}.",
        )
        for shown in stage.exhibits:
            values: np.ndarray[tuple[int, ...], np.dtype[np.generic]] = np.asarray(shown.picture)
            is_map = values.ndim == 2 and values.dtype == np.float32
            is_picture = values.shape[2:] == (3,) and values.dtype == np.uint8
            require(is_map or is_picture, f"{shown.name!r} is neither [H, W] float32 nor [H, W, 3] uint8.")
        for curve in stage.curves:
            finite = np.ndim(curve.values) == 1 and bool(np.isfinite(curve.values).all())
            require(finite, f"{curve.name!r} is not a curve of finite numbers.")


def _check_drives_only(calibrator: DriveCalibrator, drive: Frames) -> None:
    """The drive's promises, and those of what is shown of its frames."""
    initial = miscalibration([0.6, -0.6, 0.5], [0.03, -0.03, 0.03]) @ drive[0].camera_from_lidar
    estimate = _check_drive(calibrator, drive, initial)
    require(bool(estimate.traces), "The estimate has no traces of the drive's frames.")
    for trace in estimate.traces.values():
        check_trace(trace, initial)
        _check_exhibits(trace)
        ends = bool(np.allclose(trace.arrived, estimate.camera_from_lidar))
        require(ends, "A frame's trace does not end at the drive's result.")


def _check_drive(calibrator: DriveCalibrator, frames: Frames, initial: Extrinsic) -> DriveEstimate:
    """The promises of an estimate, and that the observer hears of every frame."""
    told: list[tuple[int, int]] = []
    estimate = calibrator.calibrate_drive(frames, initial, lambda read, total: told.append((read, total)))
    require_rigid(estimate.camera_from_lidar, "the drive's extrinsic")
    require_definite(estimate.covariance, "the covariance of the drive's extrinsic")
    require(0 < estimate.frames <= len(frames), f"The estimate is from {estimate.frames} of {len(frames)} frames.")
    reads, totals = [read for read, _ in told], {total for _, total in told}
    require(reads == list(range(len(reads))), f"The observer is called with {reads} frames read.")
    ended = totals in ({len(reads)}, {len(reads) - 1})  # with or without a last call that all are read
    require(ended, f"The observer is called with totals {totals}, and {len(reads)} times with a frame.")
    return estimate


def synthetic_frame() -> Frame:
    """A frame of the synthetic world."""
    from calibnet.datasets.synthetic import KITTI_LIKE, SyntheticSequence

    return SyntheticSequence(seed=0, length=1, rig=KITTI_LIKE)[0]
