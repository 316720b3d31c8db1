"""Several recorded runs on the same frames: whether they can be compared, and their figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import rerun as rr

from calibnet.errors import ConfigError
from calibnet.evaluation.metrics import Metrics
from calibnet.geometry import PoseError, pose_error
from inspector import entities
from inspector.read.run import RecordedFrame, RecordedRun
from inspector.read.understood import RecordingError

SAME_SETTINGS = ("sequence", "rig", "camera")
"""Settings that runs on the same data have in common."""
RESERVED = (entities.IMAGE, "overlay", "legend", "comparison")
"""Entity paths that all runs share, which cannot be names of runs."""


@dataclass(frozen=True, eq=False)
class ComparedRun:
    """A run under the name it has in the comparison, with the frames that are compared.

    Attributes:
        name: name given by the user.
        run: the recording.
        frames: frames that all runs have, in order.
    """

    name: str
    run: RecordedRun
    frames: tuple[RecordedFrame, ...] = field(repr=False)

    def path(self, entity: str) -> str:
        """Path of one of the run's entities in the comparison."""
        return f"{rr.escape_entity_path_part(self.name)}/{entity}"

    @property
    def initial(self) -> Metrics | None:
        """Errors before the first stage; None without reference."""
        return self._metrics([frame.error(frame.initial) for frame in self.frames])

    @property
    def corrected(self) -> Metrics | None:
        """Errors after the last stage; None without reference."""
        return self._metrics([frame.error(frame.corrected) for frame in self.frames])

    @cached_property
    def shows_drive(self) -> bool:
        """Whether it has overlays of its drive; recordings of early versions have only the drive's extrinsic."""
        return next(self.run.chunks(entities.OVERLAY_DRIVE), None) is not None

    def distance(self, other: ComparedRun) -> Metrics:
        """Distances of the results from another run's, frame by frame."""
        pairs = zip(self.frames, other.frames, strict=True)
        return Metrics.of([pose_error(mine.corrected, theirs.corrected) for mine, theirs in pairs])

    def starts_like(self, other: ComparedRun) -> bool:
        """Whether every frame starts from the same extrinsic."""
        pairs = zip(self.frames, other.frames, strict=True)
        return all(np.array_equal(mine.initial, theirs.initial) for mine, theirs in pairs)

    @staticmethod
    def _metrics(errors: list[PoseError | None]) -> Metrics | None:
        known = [error for error in errors if error is not None]
        return Metrics.of(known) if len(known) == len(errors) else None


@dataclass(frozen=True, eq=False)
class Comparison:
    """Two or more runs on the same frames; differences are to the first."""

    runs: tuple[ComparedRun, ...]

    @property
    def first(self) -> ComparedRun:
        """The run with which the others are compared."""
        return self.runs[0]

    @property
    def indices(self) -> list[int]:
        """The frames' numbers."""
        return [frame.index for frame in self.first.frames]

    @property
    def title(self) -> str:
        """Title in the viewer's list of recordings."""
        names = " / ".join(run.name for run in self.runs)
        return f"{self.first.run.settings.get('sequence', 'frames')}: {names}"

    @property
    def drives(self) -> bool:
        """Whether any of the runs solved its drive as one."""
        return any(run.run.drive is not None for run in self.runs)

    @property
    def one_start(self) -> bool:
        """Whether all runs start from the same extrinsics."""
        return all(run.starts_like(self.first) for run in self.runs[1:])

    @property
    def one_coloring(self) -> bool:
        """Whether the points of all overlays have the same colouring."""
        return len({run.run.settings.get("color") for run in self.runs}) == 1

    @classmethod
    def of(cls, runs: Sequence[RecordedRun], names: Sequence[str], common_frames: bool = False) -> Comparison:
        """Put runs side by side.

        Args:
            runs: two or more runs.
            names: names of the runs, all different.
            common_frames: whether to compare the frames that all runs have, instead of requiring the same frames.

        Raises:
            ConfigError: a name cannot be used.
            RecordingError: the runs have different data or, without ``common_frames``, different frames.
        """
        check_names(names)
        for run in runs[1:]:
            _check_same_data(runs[0], run)
        wanted = _indices(runs[0])
        for run in runs[1:]:
            both = wanted & _indices(run)
            if not both:
                raise RecordingError(f"{runs[0].path} and {run.path} have no frame in common; record the same frames.")
            if not common_frames and not wanted == both == _indices(run):
                raise RecordingError(
                    f"{runs[0].path} has {len(wanted)} frames and {run.path} {len(_indices(run))}, of which "
                    f"{len(both)} are the same; use --common-frames to compare those."
                )
            wanted = both
        chosen = [tuple(frame for frame in run.frames if frame.index in wanted) for run in runs]
        for run, frames in zip(runs[1:], chosen[1:], strict=True):
            _check_same_frames(runs[0], chosen[0], run, frames)
        return cls(tuple(ComparedRun(*compared) for compared in zip(names, runs, chosen, strict=True)))


def of_kind(error: PoseError, kind: str) -> float:
    """Degrees or centimetres of an error, ``kind`` as in `entities.ERROR_KINDS`."""
    return error.rotation_deg if kind == "rotation" else error.translation_cm


def check_names(names: Sequence[str]) -> None:
    """Raise `ConfigError` where runs cannot be told apart by their names."""
    for position, name in enumerate(names):
        if not name or name in RESERVED:
            raise ConfigError(f"{name!r} is not a valid name for a run; give another one with --names.")
        if name in names[:position]:
            raise ConfigError(f"Two runs are called {name!r}; tell them apart with --names.")


def _indices(run: RecordedRun) -> set[int]:
    return {frame.index for frame in run.frames}


def _check_same_data(one: RecordedRun, other: RecordedRun) -> None:
    for setting in SAME_SETTINGS:
        mine, theirs = one.settings.get(setting), other.settings.get(setting)
        if mine != theirs:
            raise RecordingError(
                f"{one.path} has the {setting} {mine!r} and {other.path} has {theirs!r}; compare runs on the same data."
            )


def _check_same_frames(
    one: RecordedRun, mine: Sequence[RecordedFrame], other: RecordedRun, theirs: Sequence[RecordedFrame]
) -> None:
    for a, b in zip(mine, theirs, strict=True):
        if a.source != b.source or not a.camera.same(b.camera):
            raise RecordingError(
                f"Frame {a.index} has a different image or camera in {other.path} than in {one.path}; "
                "compare runs on the same data."
            )
