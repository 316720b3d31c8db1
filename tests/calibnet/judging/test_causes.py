from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from calibnet.datasets.frame import Frame
from calibnet.errors import CalibrationError
from calibnet.evaluation import faults
from calibnet.geometry.types import Extrinsic
from calibnet.judging.causes import IMAGE_AND_SCAN, Attempt, Search, cause, match_error_of
from tests.support.boxes import boxes

FRAME = boxes()


def unlike(frame: Frame, guess: Extrinsic) -> float:
    """A measure that knows the frame as it should be: 5 if it is that, more the farther it is from it."""
    if len(frame.points) != len(FRAME.points) or (frame.points[:, 0] < -20).mean() > 0.5:
        raise CalibrationError("nothing falls into the image")
    scan = np.abs(frame.points - FRAME.points).mean()
    picture = np.abs(frame.image.astype(float) - FRAME.image)[60:260, 350:680].mean() / 10
    camera = np.abs(frame.camera.matrix - FRAME.camera.matrix).max()
    return float(5 + scan + picture + camera)


@pytest.mark.parametrize(
    ("alter", "names"),
    [
        (faults.mirrored, ("mirrored", "left-handed")),
        (faults.rolled(-30), ("roll",)),
        (faults.rolled(90), ("roll",)),
        (faults.rolled(180), ("roll",)),
        (faults.turned(faults.AXIS_CONVENTIONS["x right, y forward, z up"]), ("axes",)),
        (faults.turned(faults.AXIS_CONVENTIONS["x right, y down, z forward"]), ("axes",)),
        (faults.turned(faults.AXIS_CONVENTIONS["x backward, y right, z up"]), ("axes",)),
        (faults.flipped(0), ("left-handed",)),
        (faults.flipped(2), ("left-handed",)),
    ],
)
def test_what_undoes_the_fault_is_the_cause(alter: faults.Alteration, names: tuple[str, ...]) -> None:
    found = cause(replace(IMAGE_AND_SCAN, share=0.9), alter(FRAME), FRAME.camera_from_lidar, unlike)
    assert tuple(one.name for one in found) == names


def test_nothing_is_named_that_fits_no_better_or_not_well() -> None:
    constant = Search((Attempt(("roll",), "", lambda frame: frame),), share=0.9, most=10.0, unit="px")
    assert cause(constant, FRAME, FRAME.camera_from_lidar, lambda frame, guess: 5.0) == ()
    halved = replace(constant, attempts=(Attempt(("roll",), "It is rolled.", lambda frame: replace(frame, index=1)),))
    (named,) = cause(halved, FRAME, FRAME.camera_from_lidar, lambda frame, guess: 8.0 - 4 * frame.index)
    assert (named.name, named.text) == ("roll", "It is rolled.")
    assert named.evidence == "4 px without this fault, 8 px with it"
    assert cause(halved, FRAME, FRAME.camera_from_lidar, lambda frame, guess: 80.0 - 60 * frame.index) == ()


def test_measures_are_those_of_the_stages() -> None:
    looks: list[float] = []

    class Stage:
        def view(self, frame: Frame) -> Any:
            return None

        def look(self, frame: Frame, view: Any, before: Extrinsic) -> Any:
            looks.append(float(before[0, 3]))
            after = before.copy()
            after[0, 3] += 1
            return SimpleNamespace(match_error_px=2.0 if len(looks) == 1 else 8.0, after=after)

    assert match_error_of(Stage())(FRAME, np.eye(4)) == pytest.approx(4.0)
    assert looks == [0.0, 1.0]
