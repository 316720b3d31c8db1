"""The terms of other papers' losses have the values that a calculation by hand gives."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from torch import Tensor

from calibnet.geometry import RANGES, transform
from calibnet.geometry.se3 import rotation_from_vector
from calibnet.methods.learned.config import MethodConfig
from calibnet.methods.learned.losses import (
    angles,
    chamfer_distance,
    photometric_error,
    point_distance,
    smooth_offset,
    splat,
)
from calibnet.methods.learned.network import MethodOutput, scaled_pose
from calibnet.methods.learned.regnet import RegNet, quaternion_of
from calibnet.network.batch import NetworkInputs
from calibnet.network.pose import rotation_from_quaternion
from calibnet.network.target import Target

TRUTH = torch.eye(4)[None]


def moved(x: float = 0.0, turn: float = 0.0) -> Tensor:
    """A pose that shifts by x metres and turns by so many radians about y."""
    return torch.from_numpy(transform(rotation_from_vector(np.array([0.0, turn, 0.0])), [x, 0, 0])).float()[None]


def two_points() -> Tensor:
    """Cells ``[1, 3, 1, 4]`` of which two hold points, 1 m beside each other at 5 m."""
    cells = torch.zeros(1, 3, 1, 4)
    cells[0, :, 0, 0], cells[0, :, 0, 2] = torch.tensor([0.0, 0.0, 5.0]), torch.tensor([1.0, 0.0, 5.0])
    return cells


def test_terms_of_poses() -> None:
    assert float(angles(moved(turn=0.3), moved(turn=0.1))) == pytest.approx(0.2, abs=1e-5)
    assert float(smooth_offset(moved(0.5), TRUTH)) == pytest.approx(0.5 * 0.5**2)
    assert float(smooth_offset(moved(3.0), TRUTH)) == pytest.approx(3.0 - 0.5)


def test_distances_of_points() -> None:
    assert float(point_distance(moved(0.3), TRUTH, two_points())) == pytest.approx(0.3, abs=1e-5)
    # moved by 1 m, one point lies on the other's place: half of the pairs are 1 m apart, half 0
    assert float(chamfer_distance(moved(1.0), TRUTH, two_points())) == pytest.approx(0.5, abs=1e-3)
    assert float(chamfer_distance(TRUTH, TRUTH, two_points())) == pytest.approx(0.0, abs=1e-3)


def test_a_point_is_spread_over_the_cells_around_it() -> None:
    intrinsics = torch.tensor([[[8.0, 0.0, 15.5], [0.0, 8.0, 3.5], [0.0, 0.0, 1.0]]])
    # in the middle between the second and the third cell of 8 pixels, 4 m away: inverse depth 1
    grid = splat(torch.tensor([[[0.0, 0.0, 4.0]]]), torch.tensor([[True]]), intrinsics, (1, 4), 8, 0)
    torch.testing.assert_close(grid, torch.tensor([[[0.0, 0.5, 0.5, 0.0]]]))
    below = splat(torch.tensor([[[0.0, 4.0, 4.0]]]), torch.tensor([[True]]), intrinsics, (1, 4), 8, 1)
    torch.testing.assert_close(below, torch.tensor([[[0.0, 0.5, 0.5, 0.0]]]))


def test_depth_maps_are_compared_where_either_has_something() -> None:
    intrinsics = torch.tensor([[[8.0, 0.0, 3.5], [0.0, 8.0, 3.5], [0.0, 0.0, 1.0]]])
    cells = torch.zeros(1, 3, 1, 4)
    cells[0, :, 0, 0] = torch.tensor([0.0, 0.0, 4.0])
    inputs = NetworkInputs(torch.zeros(1, 3, 8, 32), torch.zeros(1, 2, 8, 32), intrinsics, [cells])
    assert float(photometric_error(TRUTH, TRUTH, inputs, 8)) == 0.0
    # 4 m to the side at 4 m is 8 pixels, a cell: 1 where there was 0 and the other way round
    assert float(photometric_error(moved(4.0), TRUTH, inputs, 8)) == pytest.approx(1.0)


def test_quaternions_and_rotations_are_each_other_s_inverse() -> None:
    rotation = moved(turn=-1.2)[:, :3, :3]
    torch.testing.assert_close(rotation_from_quaternion(quaternion_of(rotation)), rotation)


def test_regnet_s_dual_quaternion() -> None:
    network = RegNet(MethodConfig("regnet"), RANGES[2])
    truth = moved(0.4, 0.05)
    regressed = network.in_units(truth)
    torch.testing.assert_close(network._pose(regressed), truth, atol=1e-6, rtol=1e-5)
    none = torch.zeros(1, 8)
    output = MethodOutput(network._pose(none), none, {})
    target = Target(moved(0.25), torch.zeros(1, 2), [])
    losses = network.losses(output, NetworkInputs(none, none, none, []), target)
    # half the range's 0.5 m: the dual part is half the offset in units of half the range
    assert float(losses.translation) == pytest.approx(0.5 * 0.5**2) and float(losses.rotation) == 0.0
    assert float(losses.translation_cm) == pytest.approx(25.0)


def test_regressed_numbers_are_in_units_of_the_range() -> None:
    pose = scaled_pose(torch.tensor([[1.0, 0.0, 0.0]]), torch.tensor([[0.0, 0.0, 1.0, 0.0]]), RANGES[2])
    assert pose[0, :3, 3].tolist() == [0.5, 0.0, 0.0]
    assert math.degrees(float(angles(pose, TRUTH))) == pytest.approx(5.0, rel=1e-3)
