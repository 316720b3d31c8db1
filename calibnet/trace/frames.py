"""The record of a run on one frame, stage by stage."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from calibnet.exhibit import Curve, Exhibit
from calibnet.geometry import MiscalibrationRange, PinholeCamera, transform
from calibnet.geometry.se3 import rotated
from calibnet.geometry.types import Extrinsic, Matrix6, Rotation, Transform
from calibnet.verdict import REJECTED, Verdict

MARGIN = 1.2
"""Largest distance of a believable result from its initial extrinsic, relative to the range searched."""


@dataclass(frozen=True, eq=False)
class ScaleTrace:
    """One cost volume of one stage.

    Attributes:
        stride: size of a cell in input pixels.
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
    """The intermediate results of one stage, kept on request.

    Attributes:
        depth: ``[H, W]`` float32 metres, 0 where empty: the LiDAR image the stage saw.
        scales: cost volumes of the stage, fine to coarse.
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
    """Matches of one look: where it finds the LiDAR points of the occupied cells of its finest scale, row by row.

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
        before: initial ``camera_from_lidar``, 4x4.
        after: resulting ``camera_from_lidar``, ``correction @ before``.
        correction: the correction, 4x4, in the camera frame.
        milliseconds: wall time by part, for instance ``{"projection": 2.1, "cost_volumes": 3.0}``.
        information: ``[6, 6]`` inverse covariance of the correction's ``(translation m, rotation rad)`` as the
            network states it, or None from a head that does not.
        detail: intermediate results of its first look; None unless requested.
        match_error_px: the error that the network expects of its matches in its last look, in pixels of ``camera``.
        matches: matches of its last look, relative to `looked_from`; None from a method without matches.
        last_before: initial ``camera_from_lidar`` of its last look; None if that is ``before``.
        upright: ``[3, 3]``, rotation to ``camera`` from the frame's camera if the image was turned upright; else None.
            `detail` and `matches` belong to the turned image, all extrinsics to the frame's own camera.
        exhibits: pictures of a method's work; empty unless requested.
        curves: curves of its search, likewise.
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
        """Initial ``camera_from_lidar`` of its last look, 4x4."""
        return self.before if self.last_before is None else self.last_before

    def in_image(self, pixels: float, camera: PinholeCamera) -> float:
        """A length in pixels of this stage's image, in pixels of the frame's own, whose camera is given."""
        if self.upright is None:
            return pixels * camera.width / self.camera.width
        return pixels * camera.focal[0] / self.camera.focal[0]  # the image may be cropped as well

    def rotated(self, rotation: Rotation) -> StageTrace:
        """The trace for a camera turned by ``rotation [3, 3]``; `camera`, `detail` and `matches` are kept."""
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
        """This trace and a further look of the same stage as one trace, with the detail of the first look."""
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
    """The trace of a run on one frame.

    Attributes:
        initial: initial ``camera_from_lidar``, 4x4.
        stages: the stages that ran, coarse to fine.
        milliseconds: wall time shared by the stages (preparation, resizing, image features).
        wider: stages of wider ranges that ran before, because a first run left the range that it searched.
        verdict: verdict on the result; None from a method without verdicts.
        match_error_limit_px: largest match error at which the last stage is believed, in pixels of its ``camera``.
        method: name of the method; empty for the cascade.
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
        """The range that was searched around the initial extrinsic, that of the first stage; None if no stage ran."""
        return next((stage.range for stage in (*self.wider, *self.stages)), None)

    @property
    def arrived(self) -> Extrinsic:
        """``camera_from_lidar`` after the last stage, rejected or not."""
        return self.stages[-1].after if self.stages else self.initial

    @property
    def fits(self) -> bool:
        """Whether image and scan fit together under `arrived`; true if the last stage states no match error."""
        return not self.stages or not self.stages[-1].match_error_px > self.match_error_limit_px

    @property
    def rejected(self) -> bool:
        """Whether the verdict on the result is *rejected*."""
        return self.verdict is not None and self.verdict.word == REJECTED

    @property
    def corrected(self) -> Extrinsic:
        """``camera_from_lidar`` after the last stage, or the initial one if that is rejected."""
        return self.initial if self.rejected else self.arrived
