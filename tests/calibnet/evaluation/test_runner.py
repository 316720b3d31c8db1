from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest

from calibnet.datasets import Frame, PickedFrames
from calibnet.errors import CalibrationError, DatasetError
from calibnet.evaluation.runner import Run, draw_miscalibration, evaluate_frames
from calibnet.geometry import (
    RANGES,
    MiscalibrationRange,
    invert,
    miscalibration,
    pose_error,
)
from calibnet.geometry.types import Transform
from calibnet.trace import CascadeTrace, StageTrace
from tests.support.drive import CAMERA, REFERENCE, Drive
from tests.support.judged import judged

RANGE = MiscalibrationRange(5, 0.5)


@dataclass
class ShrinkingCascade:
    """Stages 3 and 4 leave known errors; frames in ``blind`` cannot be calibrated."""

    blind: frozenset[int] = frozenset()
    doubted: frozenset[int] = frozenset()
    initials: list[tuple[int, Transform]] = field(default_factory=list)

    def calibrate(self, frame: Frame, initial: Transform, detail: bool = False) -> CascadeTrace:
        self.initials.append((frame.index, initial))
        if frame.index in self.blind:
            raise CalibrationError("No point falls into the image.")
        steps = [
            (3, miscalibration([0, 1.5, 0], [0, 0, 0.04]) @ REFERENCE),
            (4, miscalibration([0, 0, 0.5], [0.01, 0, 0]) @ REFERENCE),
        ]
        stages, before = [], initial
        for number, after in steps:
            stage = StageTrace(number, RANGES[number - 1], CAMERA, before, after, after @ invert(before))
            stages.append(stage)
            before = after
        return judged(CascadeTrace(initial, tuple(stages)), frame.index in self.doubted)


def test_every_stage_is_measured_against_the_reference() -> None:
    evaluation = evaluate_frames(ShrinkingCascade(), [Drive([0, 1, 2])], RANGE, repeats=2, seed=7)
    third, fourth = evaluation.stages
    assert (third.number, str(third.range), fourth.number, str(fourth.range)) == (3, "5/0.5", 4, "2/0.2")
    assert third.metrics.rotation_deg.pitch == pytest.approx(1.5)
    assert fourth.metrics.rotation_deg.yaw == pytest.approx(0.5)
    assert third.metrics.rotation_deg.mean == pytest.approx(1.5)
    assert (third.metrics.success_2deg_5cm, third.metrics.success_1deg_2_5cm) == (1.0, 0.0)
    assert fourth.metrics.success_1deg_2_5cm == 1.0
    assert evaluation.frames == 3
    assert len(evaluation.runs) == 6


def test_rows_measure_where_the_cascade_ended_whatever_the_verdict() -> None:
    evaluation = evaluate_frames(ShrinkingCascade(doubted=frozenset({1})), [Drive([0, 1, 2])], RANGE, repeats=2, seed=7)
    assert evaluation.verdicts == {"accepted": 4, "rejected": 2, "cannot tell": 0}
    assert evaluation.as_dict()["verdicts"] == {"accepted": 4, "rejected": 2, "cannot_tell": 0}
    assert evaluation.as_dict()["verdicts"]["rejected"] == 2
    for run in evaluation.runs:
        assert (run.verdict == "rejected") == (run.frame == 1) == (run.applied == run.initial)
        assert run.stages[4].yaw_deg == pytest.approx(0.5)
    assert evaluation.final.rotation_deg.mean == pytest.approx(0.5)
    assert evaluation.accepted is not None and evaluation.accepted.rotation_deg.mean == pytest.approx(0.5)
    assert evaluation.applied.rotation_deg.mean > 0.5


def test_initial_errors_are_those_of_what_the_cascade_was_given() -> None:
    cascade = ShrinkingCascade()
    evaluation = evaluate_frames(cascade, [Drive([0, 1, 2, 3])], RANGE, repeats=1, seed=7)
    angles = [pose_error(initial, REFERENCE).rotation_deg for _, initial in cascade.initials]
    assert evaluation.initial.rotation_deg.mean == pytest.approx(np.mean(angles))
    assert len(set(angles)) == 4
    assert max(angles) <= np.sqrt(3) * 5.5


def test_a_miscalibration_depends_on_seed_frame_and_repeat_alone() -> None:
    whole, part = ShrinkingCascade(), ShrinkingCascade()
    evaluate_frames(whole, [Drive([0, 1, 2, 3])], RANGE, repeats=2, seed=7)
    evaluate_frames(part, [Drive([3, 1])], RANGE, repeats=1, seed=7)
    drawn = {(frame, n % 2): initial for n, (frame, initial) in enumerate(whole.initials)}
    for frame, initial in part.initials:
        assert np.array_equal(initial, drawn[frame, 0])
    assert len({initial.tobytes() for initial in drawn.values()}) == 8
    assert not np.array_equal(draw_miscalibration(RANGE, 7, 1, 0), draw_miscalibration(RANGE, 8, 1, 0))


def test_frames_that_cannot_be_calibrated_keep_their_initial_error() -> None:
    evaluation = evaluate_frames(ShrinkingCascade(blind=frozenset({1})), [Drive([0, 1])], RANGE, repeats=1, seed=0)
    blind = evaluation.runs[1]
    assert evaluation.failed == 1
    expected = (1.5 + blind.initial.rotation_deg) / 2
    assert evaluation.stages[0].metrics.rotation_deg.mean == pytest.approx(expected)
    assert evaluation.stages[1].metrics.success_1deg_2_5cm == 0.5


def test_nothing_measured_is_an_error() -> None:
    with pytest.raises(CalibrationError, match="No point"):
        evaluate_frames(ShrinkingCascade(blind=frozenset({0})), [Drive([0])], RANGE, repeats=1, seed=0)
    with pytest.raises(DatasetError, match="no frame"):
        evaluate_frames(ShrinkingCascade(), [], RANGE, repeats=1, seed=0)


def test_frame_selection_and_observer() -> None:
    seen: list[Run] = []
    drives = [Drive([10, 11, 12, 13]), Drive([0, 1, 2, 3], name="other", rig="other rig")]
    sequences = [PickedFrames(drive, [1, 3]) for drive in drives]
    evaluation = evaluate_frames(ShrinkingCascade(), sequences, RANGE, 1, 0, observer=seen.append)
    assert [(run.sequence, run.frame) for run in seen] == [
        ("test/drive", 11),
        ("test/drive", 13),
        ("other", 1),
        ("other", 3),
    ]
    assert evaluation.rig == "test rig; other rig"
    assert evaluation.sequences == ("test/drive", "other")


def test_json_form() -> None:
    content = evaluate_frames(ShrinkingCascade(), [Drive([0, 1])], RANGE, repeats=3, seed=1).as_dict()
    assert (content["frames"], content["repeats"], content["rig"], content["range"]) == (2, 3, "test rig", "5/0.5")
    assert [stage["range"] for stage in content["stages"]] == ["5/0.5", "2/0.2"]
    figures = {"rotation_deg", "translation_cm", "success_2deg_5cm", "success_1deg_2.5cm"}
    assert set(content["initial"]) == figures
    assert figures < set(content["stages"][0])
