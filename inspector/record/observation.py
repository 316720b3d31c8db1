"""One calibrated frame as the inspector records it, and the layout of a recording."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.frame import Frame
from calibnet.geometry import MiscalibrationRange, PoseError, invert, pose_error, project_through
from calibnet.geometry.projection import Projection
from calibnet.geometry.types import Extrinsic, Vector3
from calibnet.trace import CascadeTrace, ScaleTrace, StageTrace
from calibnet.verdict import Verdict
from inspector.record.contents import Contents

Xyz = tuple[float, float, float]
"""A position in metres, or a direction, in the LiDAR frame; a tuple, so that layouts can be compared."""


class Skipped(Protocol):
    """A stage that did not run, and why."""

    @property
    def number(self) -> int:
        """Number of the stage, 1 to 5."""
        ...

    @property
    def reason(self) -> str:
        """Reason in one sentence that names the stage."""
        ...


@dataclass(frozen=True, eq=False)
class Observation:
    """A frame, the cascade's trace of it and, if known, the reference.

    Attributes:
        frame: the calibrated frame.
        trace: trace of the cascade on the frame.
        reference: the true ``camera_from_lidar``; None if unknown.
        skipped: requested stages that have no weights.
        given: verdict on the extrinsic that the run started from, if this frame alone is to verify it.
    """

    frame: Frame
    trace: CascadeTrace
    reference: Extrinsic | None = field(default=None, repr=False)
    skipped: tuple[Skipped, ...] = ()
    given: Verdict | None = field(default=None, repr=False)

    @property
    def start(self) -> str:
        """Name of the initial extrinsic in captions and tables."""
        return "as given" if self.reference is None else "miscalibrated"

    def projected(self, camera_from_lidar: Extrinsic) -> Projection:
        """The scan projected into the image as taken, rows far to near; computed once per extrinsic of the run."""
        key = camera_from_lidar.tobytes()
        if key not in self._projections:
            camera = self.frame.as_taken.camera
            seen = project_through(self.frame.points[self._in_front], camera_from_lidar, camera).sorted()
            self._projections[key] = replace(seen, index=self._in_front[seen.index])
        return self._projections[key]

    @cached_property
    def _projections(self) -> dict[bytes, Projection]:
        return {}

    @cached_property
    def _in_front(self) -> NDArray[np.intp]:
        """Rows of the scan in front of the camera under any extrinsic of the run, about half of a scan.

        All rows for a lens that may see sideways.
        """
        if not self.frame.as_taken.camera.is_pinhole:
            return np.arange(len(self.frame.points))
        extrinsics = [self.trace.initial, *(stage.after for stage in self.trace.stages)]
        extrinsics += [] if self.reference is None else [self.reference]
        ahead = np.stack([extrinsic[2] for extrinsic in extrinsics]).astype(np.float32)
        depths = ahead[:, :3] @ self.frame.points[:, :3].T + ahead[:, 3:]
        return np.flatnonzero(depths.max(axis=0) > 0.0)

    def image_px(self, stage: StageTrace, pixels: float) -> float:
        """A length in a stage's input image as one in the frame's own."""
        return stage.in_image(pixels, self.frame.camera)

    def error(self, camera_from_lidar: Extrinsic) -> PoseError | None:
        """Error of an extrinsic against the reference; None without one."""
        return None if self.reference is None else pose_error(camera_from_lidar, self.reference)

    @property
    def worse(self) -> bool:
        """Whether the result is known to be worse than the start, in rotation or translation."""
        before, after = self.error(self.trace.initial), self.error(self.trace.corrected)
        if before is None or after is None:
            return False
        return after.rotation_deg > before.rotation_deg or after.translation_cm > before.translation_cm

    @property
    def badness(self) -> float:
        """Figure by which the worst frame of a run is found: the error of its result in degrees plus decimetres.

        Without a reference, the match error that its last stage expects, in pixels; -inf where there is none.
        """
        error = self.error(self.trace.corrected)
        if error is not None:
            return error.rotation_deg + error.translation_cm / 10
        last = self.trace.stages[-1] if self.trace.stages else None
        if last is None or not math.isfinite(last.match_error_px):
            return -math.inf
        return self.image_px(last, last.match_error_px)


class Grid(NamedTuple):
    """Cells of a cost volume: ``stride`` input pixels each, ``height`` by ``width``, ``window`` displacements in x."""

    stride: int
    height: int
    width: int
    window: int

    @classmethod
    def of(cls, scale: ScaleTrace) -> Grid:
        """The grid of one scale of a stage."""
        _, window, height, width = scale.volume.shape
        return cls(scale.stride, height, width, window)


@dataclass(frozen=True)
class StageLayout:
    """A stage that appears in the recording.

    Attributes:
        number: number of the stage, 1 to 5.
        range: range of the stage, for instance ``"5/0.5"``.
        grids: stride, height and width in cells of each cost volume that is shown, fine to coarse.
        exhibits: names of a method's pictures of the stage.
        curves: names of a method's curves of the stage.
    """

    number: int
    range: str
    grids: tuple[Grid, ...]
    exhibits: tuple[str, ...] = ()
    curves: tuple[str, ...] = ()

    @property
    def short(self) -> str:
        """Name for legends and tabs."""
        return f"Stage {self.number}"

    @property
    def title(self) -> str:
        """Name for views, for instance ``"Stage 3 (±5°/0.5 m)"``."""
        return f"Stage {self.number} ({MiscalibrationRange.parse(self.range).label})"


@dataclass(frozen=True)
class Layout:
    """The content of a recording, known after its first frame, which the blueprint shows.

    Attributes:
        stages: the stages that ran.
        has_reference: whether there are errors and an overlay of the reference.
        contents: what to log of each frame.
        image: width and height of the first frame's image, in pixels.
        position: position of the camera in the LiDAR frame, in metres.
        forward: viewing direction of the camera there, of unit length.
        with_drive: whether an estimate from the whole drive follows the frames.
        with_watch: whether it is also watched for moves of the mount.
        with_fit: whether its stages expect a match error.
        method: name of the method that ran; empty for the cascade.
        frames: numbers of the first and the last frame; None where the last is not known yet.
    """

    stages: tuple[StageLayout, ...]
    has_reference: bool
    contents: Contents
    image: tuple[int, int] = (1242, 375)
    position: Xyz = (0.0, 0.0, 0.0)
    forward: Xyz = (1.0, 0.0, 0.0)
    with_drive: bool = False
    with_fit: bool = True
    with_watch: bool = False
    method: str = ""
    frames: tuple[int, int] | None = None

    @property
    def start(self) -> str:
        """Name of the initial extrinsic in names of views."""
        return "Miscalibrated" if self.has_reference else "As given"

    @property
    def several(self) -> bool:
        """Whether the recording is known to have several frames."""
        return self.frames is not None and self.frames[0] != self.frames[1]

    @property
    def with_worst(self) -> bool:
        """Whether a worst frame is shown."""
        return self.several and (self.has_reference or self.with_fit)

    @property
    def stages_with_volumes(self) -> tuple[StageLayout, ...]:
        """The stages whose cost volumes are shown: all, or none if the run kept no details."""
        return tuple(stage for stage in self.stages if stage.grids)

    @classmethod
    def of(cls, observation: Observation, contents: Contents, with_drive: bool = False) -> Layout:
        """The layout of a recording that starts with this observation."""
        stages = tuple(
            StageLayout(
                stage.number,
                str(stage.range),
                tuple(map(Grid.of, contents.scales(stage.detail))),
                tuple(exhibit.name for exhibit in stage.exhibits),
                tuple(curve.name for curve in stage.curves),
            )
            for stage in observation.trace.stages
        )
        camera = observation.frame.as_taken.camera
        lidar_from_camera = invert(observation.trace.corrected)
        return cls(
            stages,
            observation.reference is not None,
            contents,
            (camera.width, camera.height),
            _xyz(lidar_from_camera[:3, 3]),
            _xyz(lidar_from_camera[:3, 2]),
            with_drive,
            any(math.isfinite(stage.match_error_px) for stage in observation.trace.stages),
            method=observation.trace.method,
        )


def _xyz(values: Vector3) -> Xyz:
    x, y, z = values.tolist()
    return x, y, z
