"""The rows of the table: the same runs for every method, the right counts, and an end in time."""

from __future__ import annotations

import numpy as np
import pytest

from calibnet.datasets import Frame
from calibnet.errors import CalibrationError
from calibnet.evaluation.bench import Bench, BenchMethod, measure_bench
from calibnet.evaluation.published import PUBLISHED
from calibnet.geometry import MiscalibrationRange, pose_error
from calibnet.geometry.types import Extrinsic
from calibnet.methods.card import MethodCard
from calibnet.methods.registry import METHODS
from calibnet.trace import CascadeTrace, StageTrace
from tests.support.drive import CAMERA, REFERENCE, Drive

RANGE = MiscalibrationRange(5, 0.5)


class Lazy:
    """Changes nothing, and cannot do frames of a number."""

    card = MethodCard(7, 9, 100, ("test rig",))

    def __init__(self, cannot: int = -1) -> None:
        self.cannot, self.starts = cannot, list[Extrinsic]()

    def calibrate(self, frame: Frame, initial: Extrinsic, detail: bool = False) -> CascadeTrace:
        if frame.index == self.cannot:
            raise CalibrationError("Not this one.")
        self.starts.append(initial)
        return CascadeTrace(initial, (StageTrace(1, RANGE, CAMERA, initial, initial, np.eye(4)),))


def entry(method: Lazy, bench: Bench) -> dict[str, object]:
    ((_, found),) = measure_bench(bench, [BenchMethod("lazy", lambda _: method)])
    return found


def test_rows_are_of_rigs_and_say_which_of_them_the_method_knows() -> None:
    bench = Bench([Drive([0, 1, 2]), Drive([5, 6], rig="another")], (RANGE,), audit=False)
    method = Lazy(cannot=1)
    found = entry(method, bench)
    rows = found["rows"]
    assert isinstance(rows, list)
    assert [(row["rig"], row["in_rig"], row["runs"], row["refused"]) for row in rows] == [
        ("test rig", True, 3, 1),
        ("another", False, 2, 0),
    ]
    errors = [pose_error(start, REFERENCE).rotation_deg for start in method.starts[-2:]]
    assert rows[1]["rotation_deg"]["mean"] == pytest.approx(np.mean(errors))  # nothing was changed
    assert (found["parameters"], found["multiply_adds"], found["samples_trained"]) == (7, 9, 100)


def test_all_methods_start_from_the_same_places() -> None:
    bench, one, other = Bench([Drive([0, 1, 2])], (RANGE,), audit=False), Lazy(), Lazy()
    entry(one, bench), entry(other, bench)
    np.testing.assert_array_equal(one.starts, other.starts)


def test_a_row_ends_in_time_and_says_how_far_it_came() -> None:
    found = entry(Lazy(), Bench([Drive(list(range(9)))], (RANGE,), limit_s=0.0, audit=False))["rows"]
    assert isinstance(found, list)
    assert (found[0]["runs"], found[0]["of_runs"]) == (1, 9)


def test_what_is_refused_throughout_has_no_figures() -> None:
    found = entry(Lazy(cannot=4), Bench([Drive([4])], (RANGE,), audit=False))["rows"]
    assert isinstance(found, list)
    assert found[0]["why"] == "Not this one." and "rotation_deg" not in found[0]


def test_claims_are_of_methods_that_there_are() -> None:
    assert set(PUBLISHED) <= {"cascade", "pcba", "regnet", "calibnet", "lccnet", "calibformer", *METHODS.names()}
