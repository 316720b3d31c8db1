"""A promise that is broken is named: the checks can fail, each of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from calibnet.conformance import check_dataset, check_head, check_method
from calibnet.datasets.frame import Frame
from calibnet.exhibit import Curve, Exhibit
from calibnet.geometry import RANGES, invert, transform
from calibnet.geometry.types import Extrinsic
from calibnet.network.pose import Pose, RegressionHead
from calibnet.trace import CascadeTrace, StageTrace
from tests.support.drive import Drive
from tests.support.scene import make_frame
from tests.support.tiny import TINY


class Altered(Drive):
    """A good drive but for what ``alter`` does to each frame."""

    alter: Callable[[Frame, int], Frame] = staticmethod(lambda frame, position: frame)

    def __getitem__(self, position: int) -> Frame:
        good = replace(super().__getitem__(range(len(self))[position]), source="memory")
        return self.alter(good, position)


class Forgetful(Altered):
    """Hands out the same frames again, so that changing one changes what is read later."""

    def __init__(self) -> None:
        super().__init__([0, 1])
        self.kept = [super(Forgetful, self).__getitem__(position) for position in range(2)]

    def __getitem__(self, position: int) -> Frame:
        return self.kept[position]


def altered(alter: Callable[[Frame, int], Frame]) -> Callable[[], Altered]:
    def opened() -> Altered:
        drive = Altered([0, 1])
        drive.alter = alter
        return drive

    return opened


def test_a_good_dataset_passes() -> None:
    check_dataset(altered(lambda frame, position: frame))


@pytest.mark.parametrize(
    ("alter", "sentence"),
    [
        (lambda frame, position: replace(frame, source=""), "The source of frame 0 is empty"),
        (lambda frame, position: replace(frame, image=frame.image[:-1]), "its camera says"),
        (lambda frame, position: replace(frame, image=frame.image / 255), "float64 and not uint8"),
        (lambda frame, position: replace(frame, points=frame.points.astype(float)), "float64 and not float32"),
        (lambda frame, position: replace(frame, points=frame.points[:, :3]), "not [N, 4]"),
        (lambda frame, position: replace(frame, points=frame.points + np.float32(2)), "outside 0..1"),
        (lambda frame, position: replace(frame, points=frame.points * np.float32("nan")), "not finite"),
        (lambda frame, position: replace(frame, camera_from_lidar=2 * np.eye(4)), "The last row of the extrinsic"),
        (lambda frame, position: replace(frame, camera_from_lidar=np.diag([1.0, 1, -1, 1])), "reflection"),
        (lambda frame, position: replace(frame, index=7), "Indices are not ascending: [7, 7]"),
        (lambda frame, position: replace(frame, timestamp=1.0), "at 1.0 s and not at 0"),
    ],
)
def test_what_a_dataset_does_wrong_is_named(alter: Callable[[Frame, int], Frame], sentence: str) -> None:
    with pytest.raises(AssertionError) as broken:
        check_dataset(altered(alter))
    assert sentence in str(broken.value)


def test_frames_are_read_anew() -> None:
    with pytest.raises(AssertionError, match="another reading of it was changed"):
        check_dataset(Forgetful)


class Method:
    """Moves a little; each flag breaks a promise."""

    def __init__(self, **broken: Any) -> None:
        self.broken, self.calls = broken, 0

    def calibrate(self, frame: Frame, initial: Extrinsic, detail: bool = False) -> CascadeTrace:
        self.calls += 1
        correction = transform(np.eye(3), [0.01, 0, 0])
        after = correction @ initial
        if "peeks" in self.broken:
            after, correction = frame.camera_from_lidar, frame.camera_from_lidar @ invert(initial)
        if "moody" in self.broken:
            correction = transform(np.eye(3), [0.01 * self.calls, 0, 0])
            after = correction @ initial
        if "writes" in self.broken:
            frame.points[:] = 0
        if "scales" in self.broken:
            correction = np.diag([2.0, 2.0, 2.0, 1.0])
            after = correction @ initial
        if "elsewhere" in self.broken:
            after = initial
        number = self.broken.get("number", 1)
        stage = StageTrace(number, RANGES[2], frame.camera, initial, after, correction, **self.broken.get("fields", {}))
        return CascadeTrace(np.eye(4) if "starts" in self.broken else initial, (stage,))


@pytest.mark.parametrize(
    ("broken", "sentence"),
    [
        ({"starts": True}, "does not start from the extrinsic that was given"),
        ({"peeks": True}, "uses the frame's own extrinsic"),
        ({"moody": True}, "give different results"),
        ({"writes": True}, "changes the frame"),
        ({"scales": True}, "rotation of the correction of stage 1"),
        ({"elsewhere": True}, "after is not correction @ before"),
        ({"fields": {"information": -np.eye(6)}}, "not positive definite"),
        ({"fields": {"milliseconds": {"all": -1.0}}}, "has a negative time"),
        ({"number": 6}, "instead of ascending within 1 to 5"),
        ({"fields": {"exhibits": (Exhibit("Map", np.zeros((2, 2), int)),)}}, "'Map' is neither [H, W] float32"),
        (
            {"fields": {"exhibits": (Exhibit("", np.zeros((2, 2), np.float32)),)}},
            "stage 1 do not have distinct names: ['']",
        ),
        ({"fields": {"curves": (Curve("Score", np.array([np.nan])),)}}, "'Score' is not a curve of finite numbers"),
    ],
)
def test_what_a_method_does_wrong_is_named(broken: dict[str, Any], sentence: str) -> None:
    check_method(Method(), make_frame())
    with pytest.raises(AssertionError) as raised:
        check_method(Method(**broken), make_frame())
    assert sentence in str(raised.value)


class Head(RegressionHead):
    """The paper's, but for what is done to its pose."""

    def forward(self, field: Any, cells: Tensor, intrinsics: Tensor) -> Pose:
        return self.spoiled(super().forward(field, cells, intrinsics))

    def spoiled(self, pose: Pose) -> Pose:
        return pose


class Scaled(Head):
    def spoiled(self, pose: Pose) -> Pose:
        return pose._replace(correction=pose.correction * torch.tensor([[2.0], [2], [2], [1]]))


class Mixing(Head):
    def spoiled(self, pose: Pose) -> Pose:
        correction = pose.correction.clone()
        correction[:, :3, 3] = correction[:, :3, 3] + len(correction)
        return pose._replace(correction=correction)


class Cut(Head):
    def spoiled(self, pose: Pose) -> Pose:
        return pose._replace(correction=pose.correction.detach())


class Unsure(Head):
    def spoiled(self, pose: Pose) -> Pose:
        return pose._replace(information=torch.zeros(len(pose.correction), 6, 6))


@pytest.mark.parametrize(
    ("head", "sentence"),
    [
        (Scaled, "rotation of a correction is not orthonormal"),
        (Mixing, "depends on the other frames"),
        (Unsure, "not positive definite"),
    ],
)
def test_what_a_head_does_wrong_is_named(head: type[nn.Module], sentence: str) -> None:
    with pytest.raises(AssertionError, match=sentence):
        check_head(head, TINY)


def test_a_head_that_cannot_be_trained_is_named() -> None:
    with pytest.raises(AssertionError, match="nothing could be trained"):
        check_head(Cut, TINY)
