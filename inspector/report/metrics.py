"""The figures of a report: every frame and stage against the reference or, without one, against the frames' median."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from calibnet.evaluation.metrics import Metrics
from calibnet.geometry import PoseError, pose_error
from calibnet.geometry.median import median_pose
from calibnet.geometry.types import Extrinsic, Floats
from calibnet.verdict import WORDS
from inspector.read.run import RecordedFrame, RecordedRun
from inspector.report.files import EXAMPLES

DISTANCE_M = 10.0
"""Distance in metres of the points whose largest misplacement ranks the frames."""


@dataclass(frozen=True)
class State:
    """The calibrations of all frames, before the first stage or after one of the stages.

    Attributes:
        name: name to show.
        number: number of the stage; None before the first.
        range: range that the stage was trained for, for instance ``"5/0.5"``; None before the first.
        errors: error of every frame.
    """

    name: str
    number: int | None
    range: str | None
    errors: tuple[PoseError, ...] = field(repr=False)

    @property
    def key(self) -> str:
        """Name in ``metrics.json``."""
        return "initial" if self.number is None else f"stage_{self.number}"

    @cached_property
    def metrics(self) -> Metrics:
        """Statistics over the frames."""
        return Metrics.of(self.errors)

    @property
    def rotation_deg(self) -> Floats:
        """``[N]`` degrees."""
        return np.array([error.rotation_deg for error in self.errors])

    @property
    def translation_cm(self) -> Floats:
        """``[N]`` centimetres."""
        return np.array([error.translation_cm for error in self.errors])


@dataclass(frozen=True)
class Figures:
    """All figures of the page and of ``metrics.json``.

    Attributes:
        run: the recording.
        states: the initial state and that after every stage; the last is the corrected one, in which rejected frames
            keep their initial extrinsics.
        changes: distance from the initial to the corrected extrinsic of every frame.
        median: median of all corrected extrinsics; None where the frames come from several mounts.
        median_error: error of that extrinsic; None without a reference or a median.
    """

    run: RecordedRun
    states: tuple[State, ...]
    changes: tuple[PoseError, ...] = field(repr=False)
    median: Extrinsic | None = field(repr=False)
    median_error: PoseError | None

    @classmethod
    def of(cls, run: RecordedRun) -> Figures:
        """Measure a run.

        Args:
            run: a run with at least one frame.
        """
        frames = run.frames
        median = median_pose(run.results)
        yardsticks = [median if frame.reference is None else frame.reference for frame in frames]

        def errors(extrinsics: Sequence[Extrinsic]) -> tuple[PoseError, ...]:
            return tuple(pose_error(mine, other) for mine, other in zip(extrinsics, yardsticks, strict=True))

        start = "miscalibrated" if run.has_reference else "start"
        states = [State(start, None, None, errors([frame.initial for frame in frames]))]
        for number, range_ in run.stages:
            last = number == run.stages[-1].number
            after = errors([frame.corrected if last else frame.stages[number] for frame in frames])
            states.append(State(f"stage {number}", number, range_, after))
        return cls(
            run,
            tuple(states),
            tuple(pose_error(frame.corrected, frame.initial) for frame in frames),
            median if run.one_mount else None,
            pose_error(median, yardsticks[0]) if run.one_mount and run.has_reference else None,
        )

    @property
    def has_reference(self) -> bool:
        """Whether errors are relative to a reference; otherwise they are distances from ``median``."""
        return self.run.has_reference

    @property
    def measure(self) -> str:
        """Name of the states' errors, in words."""
        if self.has_reference:
            return "Error"
        return "Distance from the result" if len(self.run.frames) == 1 else "Distance from the frames’ median"

    @property
    def initial(self) -> State:
        """The state before the first stage."""
        return self.states[0]

    @property
    def corrected(self) -> State:
        """The state after the last stage."""
        return self.states[-1]

    @cached_property
    def change(self) -> Metrics:
        """Statistics of the size of the correction."""
        return Metrics.of(self.changes)

    @property
    def rejected(self) -> int:
        """Number of rejected frames, which were not changed."""
        return sum(frame.rejected for frame in self.run.frames)

    def ranking(self) -> list[int]:
        """Positions of the frames, best corrected first."""
        return sorted(
            range(len(self.run.frames)), key=lambda position: misplacement_cm(self.corrected.errors[position])
        )

    def examples(self) -> dict[str, int]:
        """Positions of the worst, the median and the best frame; a frame appears once."""
        order = self.ranking()
        chosen = dict(zip((order[-1], order[(len(order) - 1) // 2], order[0]), EXAMPLES, strict=True))
        return {name: position for position, name in chosen.items()}

    def as_dict(self) -> dict[str, Any]:
        """The content of ``metrics.json``; keys carry the units, matrices are rows of metres."""
        run = self.run
        return {
            "title": run.title,
            "settings": run.settings,
            "versions": run.provenance,
            "weights": {str(number): record for number, record in run.weights.items()},
            "frames": len(run.frames),
            "verdicts": self._verdicts(),
            "verdict_of_given": None if run.given_verdict is None else run.given_verdict.as_dict(),
            "verdict_of_drive": None if run.drive_verdict is None else run.drive_verdict.as_dict(),
            "measured_against": "reference" if self.has_reference else "median of the corrected extrinsics",
            "initial": self._summary(self.initial),
            "stages": [
                {"number": number, "range": range_, **self._summary(state)}
                for (number, range_), state in zip(run.stages, self.states[1:], strict=True)
            ],
            "change": _distributions(self.change),
            "drive_extrinsic": None if run.drive is None else run.drive.tolist(),
            "drive_extrinsic_error": None if run.drive_error is None else asdict(run.drive_error),
            "median_extrinsic": None if self.median is None else self.median.tolist(),
            "median_extrinsic_error": None if self.median_error is None else asdict(self.median_error),
            "examples": {name: run.frames[position].index for name, position in self.examples().items()},
            "per_frame": [self._frame(position, frame) for position, frame in enumerate(run.frames)],
        }

    def _verdicts(self) -> dict[str, int]:
        """The number of frames with each verdict."""
        words = [frame.verdict.word for frame in self.run.frames]
        return {word.replace(" ", "_"): words.count(word) for word in WORDS}

    def _summary(self, state: State) -> dict[str, Any]:
        return state.metrics.as_dict() if self.has_reference else _distributions(state.metrics)

    def _frame(self, position: int, frame: RecordedFrame) -> dict[str, Any]:
        return {
            "frame": frame.index,
            "seconds": frame.seconds,
            "source": frame.source,
            "errors": {state.key: _rounded(state.errors[position]) for state in self.states},
            "change": _rounded(self.changes[position]),
            "verdict": frame.verdict.as_dict(),
            "initial_camera_from_lidar": frame.initial.tolist(),
            "corrected_camera_from_lidar": frame.corrected.tolist(),
        }


def misplacement_cm(error: PoseError) -> float:
    """Largest misplacement of a point `DISTANCE_M` away, in centimetres."""
    return float(np.radians(error.rotation_deg)) * 100.0 * DISTANCE_M + error.translation_cm


def _rounded(error: PoseError) -> dict[str, float]:
    """An error rounded to a millionth, far below any accuracy, so that the file of a long run stays small."""
    return {name: round(value, 6) for name, value in asdict(error).items()}


def _distributions(metrics: Metrics) -> dict[str, Any]:
    """The statistics without success rates, which need a reference."""
    return {name: value for name, value in metrics.as_dict().items() if not name.startswith("success")}
