"""One calibrated frame as the inspector sees it, and what a whole recording contains."""

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
        """1 to 5."""
        ...

    @property
    def reason(self) -> str:
        """One sentence that names the stage."""
        ...


@dataclass(frozen=True, eq=False)
class Observation:
    """A frame, what the cascade did to it and, where known, the truth.

    Attributes:
        frame: what was calibrated.
        trace: the run of the cascade on it.
        reference: the true ``camera_from_lidar``, or None where nobody knows it.
        skipped: stages that were asked for and have no weights.
        given: the verdict on the extrinsic that the run started from, where this frame alone is to verify it.
    """

    frame: Frame
    trace: CascadeTrace
    reference: Extrinsic | None = field(default=None, repr=False)
    skipped: tuple[Skipped, ...] = ()
    given: Verdict | None = field(default=None, repr=False)

    @property
    def start(self) -> str:
        """What the extrinsic before the first stage is called in captions and tables."""
        return "as given" if self.reference is None else "miscalibrated"

    def projected(self, camera_from_lidar: Extrinsic) -> Projection:
        """The scan in the picture as it was taken, rows far to near; each extrinsic of the run is projected once."""
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
        """Rows of the scan before the camera under any extrinsic of the run: half of what a scanner sees.

        All of them for a lens that may see to the side.
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
        if stage.upright is None:
            return pixels * self.frame.camera.width / stage.camera.width
        return pixels * self.frame.camera.focal[0] / stage.camera.focal[0]  # it was cut as well

    def error(self, camera_from_lidar: Extrinsic) -> PoseError | None:
        """Error of an extrinsic against the reference; None without one."""
        return None if self.reference is None else pose_error(camera_from_lidar, self.reference)

    @property
    def worse(self) -> bool:
        """Whether the result is known to be farther off than the start, in angle or place."""
        before, after = self.error(self.trace.initial), self.error(self.trace.corrected)
        if before is None or after is None:
            return False
        return after.rotation_deg > before.rotation_deg or after.translation_cm > before.translation_cm

    @property
    def badness(self) -> float:
        """What makes a frame the worst of a run: degrees and decimetres that it ended off the reference.

        Without a reference, the pixels by which its last stage expects its matches to be off; -inf where it expects
        nothing.
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
        """Those of a scale of a stage."""
        _, window, height, width = scale.volume.shape
        return cls(scale.stride, height, width, window)


@dataclass(frozen=True)
class StageLayout:
    """A stage that appears in the recording.

    Attributes:
        number: 1 to 5.
        range: for instance ``"5/0.5"``.
        grids: stride, height and width in cells of each cost volume that is shown, fine to coarse.
        exhibits: names of what a method shows of it, in pictures.
        curves: and in curves.
    """

    number: int
    range: str
    grids: tuple[Grid, ...]
    exhibits: tuple[str, ...] = ()
    curves: tuple[str, ...] = ()

    @property
    def short(self) -> str:
        """For legends and tabs."""
        return f"Stage {self.number}"

    @property
    def title(self) -> str:
        """For view names, for instance ``"Stage 3 (±5°/0.5 m)"``."""
        return f"Stage {self.number} ({MiscalibrationRange.parse(self.range).label})"


@dataclass(frozen=True)
class Layout:
    """What a recording contains, known after its first frame; the blueprint shows exactly this.

    Attributes:
        stages: those that ran.
        has_reference: whether errors and a reference overlay exist.
        contents: what is logged of each frame.
        image: width and height of the first frame's image, in pixels.
        position: of the camera in the LiDAR frame, metres.
        forward: its viewing direction there, of unit length.
        with_drive: whether an estimate from the whole drive follows the frames.
        with_watch: whether it also tells if the mount moved meanwhile.
        with_fit: whether its stages say what error they expect of their matches.
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
        """What the extrinsic before the first stage is called in names of views."""
        return "Miscalibrated" if self.has_reference else "As given"

    @property
    def several(self) -> bool:
        """Whether several frames are known to follow one another."""
        return self.frames is not None and self.frames[0] != self.frames[1]

    @property
    def with_worst(self) -> bool:
        """Whether one of its frames is known to be the worst."""
        return self.several and (self.has_reference or self.with_fit)

    @property
    def stages_with_volumes(self) -> tuple[StageLayout, ...]:
        """The stages whose cost volumes are shown: all, or none where the run kept no details."""
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
