"""The record of a run: what the cascade, or another method, did to a frame or to a drive.

Recordings, reports and tables are made from these types alone. Arrays are NumPy, so that readers need no torch. Pixels
are those of a stage's input camera (`StageTrace.camera`); its image is the frame's, turned upright where the camera is
rolled, and resized.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from calibnet.exhibit import Curve, Exhibit
from calibnet.geometry import MiscalibrationRange, PinholeCamera, transform
from calibnet.geometry.se3 import rotate6, rotated
from calibnet.geometry.types import Extrinsic, Matrix6, Rotation, Transform, Vector6
from calibnet.verdict import REJECTED, BadFrame, Verdict

MARGIN = 1.2
"""How far a calibration may end from its initial extrinsic, relative to the range searched, to be believed."""


@dataclass(frozen=True, eq=False)
class ScaleTrace:
    """One cost volume of one stage.

    Attributes:
        stride: input pixels a cell.
        volume: ``[Dy, Dx, h, w]`` float16, matching score (mean cosine of the groups, -1..1) of the
            LiDAR cell with the image cell displaced by ``(dy, dx)`` cells, window centre = none.
        probability: ``[Dy, Dx, h, w]`` float16, the same after aggregation, a softmax over the window.
        best: ``[h, w, 2]`` int64, displacement ``(dx, dy)`` in cells with the highest probability.
        before: ``[C, h, w]`` float16, activations entering the hourglass, maximum over the window.
        after: ``[C', h, w]`` float16, activations leaving it, maximum over the window.
        occupied: ``[h, w]`` bool, cells that hold a LiDAR point.
    """

    stride: int
    volume: NDArray[np.float16] = field(repr=False)
    probability: NDArray[np.float16] = field(repr=False)
    best: NDArray[np.int64] = field(repr=False)
    before: NDArray[np.float16] = field(repr=False)
    after: NDArray[np.float16] = field(repr=False)
    occupied: NDArray[np.bool_] = field(repr=False)


@dataclass(frozen=True, eq=False)
class StageDetail:
    """The intermediate results of one stage, present only when asked for.

    Attributes:
        depth: ``[H, W]`` float32 metres, 0 where empty: the LiDAR image the stage saw.
        scales: its cost volumes, fine to coarse.
        displacement: ``[h, w, 2]`` float32, ``(dx, dy)`` in input pixels from where a LiDAR cell
            is projected to where the network finds it in the image, at the finest scale.
        confidence: ``[h, w]`` float32, 0..1 (1 = a pixel or better), 0 where no LiDAR point is.
    """

    depth: NDArray[np.float32] = field(repr=False)
    scales: tuple[ScaleTrace, ...] = field(repr=False)
    displacement: NDArray[np.float32] = field(repr=False)
    confidence: NDArray[np.float32] = field(repr=False)


@dataclass(frozen=True, eq=False)
class Matches:
    """Where one look finds the LiDAR points in the image: the occupied cells of its finest scale, row by row.

    Attributes:
        points: ``[N, 3]`` float32 metres, the nearest point of each cell in the camera frame before the correction.
        displacement: ``[N, 2]`` float32 pixels ``(dx, dy)`` of the stage's camera, from where a point is projected to
            where it is found.
        scale: ``[N, 2]`` float32 pixels, the absolute error that the network expects of each.
    """

    points: NDArray[np.float32] = field(repr=False)
    displacement: NDArray[np.float32] = field(repr=False)
    scale: NDArray[np.float32] = field(repr=False)


@dataclass(frozen=True, eq=False)
class StageTrace:
    """One stage of the cascade on one frame.

    Attributes:
        number: 1 (coarsest) to 5 (finest).
        camera: the network's input camera (the frame's, resized).
        range: the miscalibration the stage was trained for.
        before: ``camera_from_lidar`` it started from, 4x4.
        after: ``camera_from_lidar`` it arrived at, ``correction @ before``.
        correction: 4x4, in the camera frame.
        milliseconds: wall time by part, for instance ``{"projection": 2.1, "cost_volumes": 3.0}``.
        information: ``[6, 6]`` inverse covariance of the correction's ``(translation m, rotation rad)`` as the
            network states it, or None from a head that does not.
        detail: intermediate results of its first look, or None when they were not asked for.
        match_error_px: the error that the network expects of its matches in its last look, in pixels of ``camera``.
        matches: of its last look, relative to `looked_from`; None from a method without matches.
        last_before: ``camera_from_lidar`` that its last look started from; None where that is ``before``.
        upright: ``[3, 3]``, rotation to ``camera`` from the frame's camera, where the image was turned upright; None
            where it was not. `detail` and `matches` are of the turned image, all extrinsics of the frame's own camera.
        exhibits: pictures that a method shows of its work; empty when they were not asked for.
        curves: numbers over the steps of its search, likewise.
    """

    number: int
    range: MiscalibrationRange
    camera: PinholeCamera
    before: Extrinsic = field(repr=False)
    after: Extrinsic = field(repr=False)
    correction: Transform = field(repr=False)
    milliseconds: dict[str, float] = field(default_factory=dict)
    information: Matrix6 | None = field(default=None, repr=False)
    detail: StageDetail | None = field(default=None, repr=False)
    match_error_px: float = math.nan
    matches: Matches | None = field(default=None, repr=False)
    last_before: Extrinsic | None = field(default=None, repr=False)
    upright: Rotation | None = field(default=None, repr=False)
    exhibits: tuple[Exhibit, ...] = field(default=(), repr=False)
    curves: tuple[Curve, ...] = field(default=(), repr=False)

    @property
    def looked_from(self) -> Extrinsic:
        """``camera_from_lidar`` that its last look started from, 4x4."""
        return self.before if self.last_before is None else self.last_before

    def rotated(self, rotation: Rotation) -> StageTrace:
        """The same of a camera turned by ``rotation [3, 3]``; `camera`, `detail` and `matches` stay as they are."""
        turn = transform(rotation, np.zeros(3))
        return replace(
            self,
            before=turn @ self.before,
            after=turn @ self.after,
            correction=turn @ self.correction @ turn.T,
            information=rotated(self.information, rotation),
            last_before=None if self.last_before is None else turn @ self.last_before,
            upright=rotation.T if self.upright is None else self.upright @ rotation.T,
        )

    def followed_by(self, further: StageTrace) -> StageTrace:
        """This and a further look of the same stage as one trace; the detail stays that of the first look."""
        mine, its = self.milliseconds, further.milliseconds
        return replace(
            self,
            after=further.after,
            correction=further.correction @ self.correction,
            milliseconds={part: mine.get(part, 0.0) + its.get(part, 0.0) for part in dict.fromkeys([*mine, *its])},
            information=further.information,
            match_error_px=further.match_error_px,
            matches=further.matches,
            last_before=further.looked_from,
        )


@dataclass(frozen=True, eq=False)
class CascadeTrace:
    """A whole run on one frame.

    Attributes:
        initial: ``camera_from_lidar`` the run started from, 4x4.
        stages: the stages that ran, coarse to fine.
        milliseconds: wall time shared by the stages (preparation, resizing, image features).
        wider: stages of wider ranges that ran before them, because a first run left the range it searched.
        verdict: whether the result is good; None from a method that does not say.
        match_error_limit_px: largest match error of the last stage that is believed, in pixels of its ``camera``.
        method: name of the method whose run it is; empty for the cascade.
    """

    initial: Extrinsic = field(repr=False)
    stages: tuple[StageTrace, ...]
    milliseconds: dict[str, float] = field(default_factory=dict)
    match_error_limit_px: float = math.inf
    wider: tuple[StageTrace, ...] = ()
    verdict: Verdict | None = None
    method: str = ""

    @property
    def searched(self) -> MiscalibrationRange | None:
        """The range that was searched around the initial extrinsic: the first stage's; None where no stage ran."""
        return next((stage.range for stage in (*self.wider, *self.stages)), None)

    @property
    def arrived(self) -> Extrinsic:
        """``camera_from_lidar`` after the last stage, whether or not it is believed."""
        return self.stages[-1].after if self.stages else self.initial

    @property
    def fits(self) -> bool:
        """Whether image and scan fit together under `arrived`; true where the last stage states no match error."""
        return not self.stages or not self.stages[-1].match_error_px > self.match_error_limit_px

    @property
    def rejected(self) -> bool:
        """Whether the verdict on what the stages found is *rejected*."""
        return self.verdict is not None and self.verdict.word == REJECTED

    @property
    def corrected(self) -> Extrinsic:
        """``camera_from_lidar`` after the last stage; the initial one where that is rejected."""
        return self.initial if self.rejected else self.arrived


@dataclass(frozen=True, eq=False)
class Estimate:
    """The extrinsic that a number of frames agree on.

    Attributes:
        camera_from_lidar: 4x4.
        covariance: ``[6, 6]`` of ``(translation m, rotation rad)``, a perturbation in the camera frame. Of networks
            alone it is the one they state, scaled to the scatter of the frames; where edges were aligned, it includes
            the common error of the networks as far as the edges leave it open.
        frames: that went into it.
    """

    camera_from_lidar: Extrinsic = field(repr=False)
    covariance: Matrix6 = field(repr=False)
    frames: int

    @property
    def rotation_deg(self) -> float:
        """Standard deviation of the rotation in degrees: the root of the summed variances of its axes."""
        return float(np.degrees(np.sqrt(np.trace(self.covariance[3:, 3:]))))

    @property
    def translation_cm(self) -> float:
        """Standard deviation of the translation in centimetres, likewise."""
        return float(100 * np.sqrt(np.trace(self.covariance[:3, :3])))

    def rotated(self, rotation: Rotation) -> Self:
        """The same of a camera turned by ``rotation [3, 3]``."""
        extrinsic = transform(rotation, np.zeros(3)) @ self.camera_from_lidar
        return replace(self, camera_from_lidar=extrinsic, covariance=rotated(self.covariance, rotation))


@dataclass(frozen=True, eq=False)
class DriveLook:
    """What one frame of a drive says in the last look, which starts from the same extrinsic for all frames.

    Attributes:
        frame: its index.
        position: its position in the drive.
        offset: ``[6]``, ``(translation m, rotation rad)`` from there to where it believes the extrinsic to be.
        information: ``[6, 6]`` of it as the network states it, or None.
        match_error_px: the error that the network expects of its matches, in pixels of the stage's camera.
        lens: logarithm of how much another lens lowers the cost of its matches, see `calibnet.judging.predictors`.
    """

    frame: int
    position: int
    offset: Vector6 = field(repr=False)
    information: Matrix6 | None = field(default=None, repr=False)
    match_error_px: float = math.nan
    lens: float = math.nan

    def rotated(self, rotation: Rotation) -> DriveLook:
        """The same of a camera turned by ``rotation [3, 3]``."""
        offset = rotate6(rotation) @ self.offset
        return replace(self, offset=offset, information=rotated(self.information, rotation))


@dataclass(frozen=True, eq=False)
class DriveEstimate(Estimate):
    """What `calibnet.cascade.Cascade.calibrate_drive` returns.

    Attributes:
        history: the estimate after more and more frames of the last pass, with the index of the latest in its
            sequence; the last one is the estimate.
        skipped: frames that could not be read, or calibrated in the last look.
        verdict: whether the estimate is good; None from a method that does not say.
        networks: the estimate of the networks alone, where edges were aligned after them; its covariance has the
            scatter of the frames, not their common error. None where nothing was aligned: it would be the estimate.
        looks: what each frame says by itself, relative to ``looked_from``.
        looked_from: ``camera_from_lidar`` that the last look started from; None from a method without looks.
        traces: of the frames by their index, from a method that calibrates whole drives only: each goes from the
            drive's initial extrinsic to its estimate, with what is to be shown of the frame.
    """

    history: tuple[tuple[int, Estimate], ...] = field(repr=False, default=())
    skipped: tuple[BadFrame, ...] = ()
    networks: Estimate | None = field(repr=False, default=None)
    verdict: Verdict | None = None
    looks: tuple[DriveLook, ...] = field(repr=False, default=())
    looked_from: Extrinsic | None = field(repr=False, default=None)
    traces: dict[int, CascadeTrace] = field(repr=False, default_factory=dict)

    def rotated(self, rotation: Rotation) -> Self:
        """The same of a camera turned by ``rotation [3, 3]``; without the traces of a method of its own."""
        turn = transform(rotation, np.zeros(3))
        return replace(
            super().rotated(rotation),
            history=tuple((frame, so_far.rotated(rotation)) for frame, so_far in self.history),
            networks=None if self.networks is None else self.networks.rotated(rotation),
            verdict=None if self.verdict is None else self.verdict.rotated(rotation),
            looks=tuple(look.rotated(rotation) for look in self.looks),
            looked_from=None if self.looked_from is None else turn @ self.looked_from,
        )

    def inflated(self, factor: float) -> Self:
        """The same with every covariance so many times as large."""

        def of(estimate: Estimate) -> Estimate:
            return replace(estimate, covariance=factor * estimate.covariance)

        return replace(
            self,
            covariance=factor * self.covariance,
            history=tuple((frame, of(so_far)) for frame, so_far in self.history),
            networks=None if self.networks is None else of(self.networks),
        )
