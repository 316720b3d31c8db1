"""Every row of the measurement, with a cascade whose answers are known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from calibnet.datasets import Frame
from calibnet.datasets.frame import Frames
from calibnet.evaluation.measure import Step, measure
from calibnet.geometry import RANGES, MiscalibrationRange, invert, miscalibration
from calibnet.geometry.types import Extrinsic
from calibnet.trace import CascadeTrace, DriveEstimate, StageTrace
from tests.support.drive import REFERENCE, Drive
from tests.support.judged import judged

RANGE = MiscalibrationRange(5, 0.5)


class Leaving:
    """Leaves the given degrees of yaw; without the true image it finds nothing and says so."""

    def __init__(self, yaw_deg: float) -> None:
        self.found = miscalibration([0, 0, yaw_deg], [0, 0, 0]) @ REFERENCE

    def calibrate(self, frame: Frame, initial: Extrinsic, detail: bool = False) -> CascadeTrace:
        stage = StageTrace(3, RANGES[2], frame.camera, initial, self.found, self.found @ invert(initial))
        seen = bool((frame.image == 7).all())
        return judged(CascadeTrace(initial, (stage,)), rejected=not seen)

    def calibrate_drive(
        self, frames: Frames, initial: Extrinsic, observer: Callable[[int, int], None] | None = None
    ) -> DriveEstimate:
        for read in range(len(frames)):
            if observer is not None:
                observer(read, len(frames))
        return DriveEstimate(self.found, np.eye(6), len(frames))


def drives() -> list[Drive]:
    return [Drive([0, 1, 2], "a/00", brightness=7), Drive([0, 1], "a/01", brightness=7)]


def test_every_row_that_was_asked_for_and_no_other() -> None:
    plain = measure(Leaving(1.0), drives(), RANGE, references={}, drives=False)
    assert plain.final.rotation_deg.yaw == pytest.approx(1.0)
    assert plain.references == {"no correction": plain.initial}
    assert plain.drives is None and plain.audit == {}
    whole = measure(Leaving(1.0), drives(), RANGE, 2, references={"other": Leaving(0.5)}, audit=True)
    assert whole.references["other"].rotation_deg.yaw == pytest.approx(0.5)
    assert whole.drives is not None and whole.drives.rotation_deg.yaw == pytest.approx(1.0)
    assert whole.drives_networks is None
    assert whole.audit_rejected == {"swapped": 0, "grey": 10, "thinned": 0}
    assert whole.audit["grey"] == whole.initial, "as applied"
    assert whole.audit_arrived["grey"] == whole.final, "before the verdict"
    assert whole.audit_images == "a/01, a/00"


def test_the_classical_refinement_is_held_against_by_default() -> None:
    evaluation = measure(Leaving(1.0), drives(), RANGE, drives=False)
    assert list(evaluation.references) == ["no correction", "edge alignment"]
    blind = evaluation.references["edge alignment"]  # one point and no edge: it stays where it was
    assert blind.rotation_deg.mean == pytest.approx(evaluation.initial.rotation_deg.mean)


def test_the_audit_takes_images_from_beside_where_there_is_one_sequence() -> None:
    beside = Drive([0], "a/05", brightness=200)
    evaluation = measure(
        Leaving(1.0), drives()[:1], RANGE, references={}, drives=False, audit=True, beside=lambda: iter([beside])
    )
    assert evaluation.audit_images == "a/05"
    assert evaluation.audit_rejected == {"swapped": 3, "grey": 3, "thinned": 0}


def test_the_observer_hears_of_every_row_before_its_first_run_and_after_each() -> None:
    steps: list[Step] = []
    measure(Leaving(1.0), drives(), RANGE, 2, references={}, audit=True, observer=steps.append)
    rows = list(dict.fromkeys(step.row for step in steps))
    assert rows == ["single frames", "drives", "audit, swapped", "audit, grey", "audit, thinned"]
    single = [step for step in steps if step.row == "single frames"]
    assert [step.done for step in single] == list(range(11)) and {step.total for step in single} == {10}
    assert [step.sequence for step in single] == ["", *["a/00"] * 6, *["a/01"] * 4]
    of_drives = [step for step in steps if step.row == "drives"]
    assert of_drives[-1] == Step("drives", 10, None, "a/01")
