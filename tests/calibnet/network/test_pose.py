from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from torch import Tensor

from calibnet.geometry import RANGES, MiscalibrationRange, pose_error, rotation_from_euler_xyz
from calibnet.network.displacement import DisplacementField
from calibnet.network.pose import (
    GeometricHead,
    RegressionHead,
    project_points,
    projection_jacobian,
    rotation_from_quaternion,
    rotation_from_vector,
    rotation_vector,
    skew,
)
from tests.support.tiny import TINY

INTRINSICS = torch.tensor([[[360.0, 0.0, 250.0], [0.0, 355.0, 80.0], [0.0, 0.0, 1.0]]])


def scene(count: int = 800, seed: int = 0) -> Tensor:
    """Points ``[1, N, 3]`` in front of the camera, 4 to 60 m away."""
    generator = torch.Generator().manual_seed(seed)
    pixel = torch.rand(1, count, 2, generator=generator) * torch.tensor([512.0, 160.0])
    depth = 4.0 * 15.0 ** torch.rand(1, count, 1, generator=generator)
    ray = torch.cat([pixel, torch.ones(1, count, 1)], dim=-1) @ torch.linalg.inv(INTRINSICS).transpose(1, 2)
    return ray * depth


def correction(angles_deg: tuple[float, float, float], offset_m: tuple[float, float, float]) -> Tensor:
    matrix = torch.eye(4)
    matrix[:3, :3] = torch.from_numpy(rotation_from_euler_xyz(torch.deg2rad(torch.tensor(angles_deg)).numpy()))
    matrix[:3, 3] = torch.tensor(offset_m)
    return matrix


def projected(points: Tensor, by: Tensor) -> Tensor:
    return project_points(points @ by[:3, :3].T + by[:3, 3], INTRINSICS)


def solve(
    points: Tensor, target: Tensor, scale: float | Tensor = 0.5, range_: MiscalibrationRange = RANGES[2]
) -> Tensor:
    head = GeometricHead(TINY, range_)
    return head.solve(points, target, torch.as_tensor(scale).expand(target.shape), INTRINSICS).correction[0]


def error(estimate: Tensor, truth: Tensor) -> tuple[float, float]:
    """Degrees and centimetres."""
    result = pose_error(estimate.double().numpy(), truth.double().numpy())
    return result.rotation_deg, result.translation_cm


@pytest.mark.parametrize(
    ("angles", "offset", "stage"),
    [
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 3),
        ((3.0, -4.0, 2.0), (0.3, -0.2, 0.4), 3),
        ((-9.0, 12.0, 8.0), (1.0, 0.5, -0.8), 1),
    ],
)
def test_solver_recovers_a_correction(
    angles: tuple[float, float, float], offset: tuple[float, float, float], stage: int
) -> None:
    truth, points = correction(angles, offset), scene()
    degrees, centimetres = error(solve(points, projected(points, truth), range_=RANGES[stage - 1]), truth)
    assert degrees < 0.02
    assert centimetres < 1.0


def test_solver_averages_noise_and_outweighs_outliers() -> None:
    truth, points = correction((2.0, -3.0, 1.0), (0.2, -0.1, 0.3)), scene(3000)
    generator = torch.Generator().manual_seed(1)
    target = projected(points, truth) + torch.randn(1, 3000, 2, generator=generator)
    wrong = torch.rand(1, 3000, 1, generator=generator) < 0.2
    target = torch.where(wrong, target + 60.0 * torch.randn(1, 3000, 2, generator=generator), target)
    degrees, centimetres = error(solve(points, target, 1.0), truth)
    assert degrees < 0.1
    assert centimetres < 6.0


def test_solver_follows_the_cells_that_are_sure() -> None:
    truth, points = correction((2.0, -3.0, 1.0), (0.2, -0.1, 0.3)), scene()
    target, scale = projected(points, truth), torch.full((1, 800, 2), 0.5)
    target[:, ::2] += 25.0
    scale[:, ::2] = 60.0
    assert error(solve(points, target, scale), truth)[0] < 0.05


def test_solver_stays_at_the_prior_without_information() -> None:
    points = scene(30)
    target = projected(points, correction((4.0, 4.0, 4.0), (0.4, 0.4, 0.4)))
    degrees, centimetres = error(solve(points, target, 5000.0), torch.eye(4))
    assert degrees < 0.1
    assert centimetres < 1.0
    empty = solve(torch.zeros(1, 20, 3), torch.full((1, 20, 2), 70.0))
    torch.testing.assert_close(empty, torch.eye(4))


def test_solver_ignores_empty_cells() -> None:
    truth, points = correction((1.0, 2.0, -1.0), (0.1, 0.1, 0.1)), scene()
    target = projected(points, truth)
    padded = (
        torch.cat([points, torch.zeros(1, 50, 3)], dim=1),
        torch.cat([target, torch.full((1, 50, 2), 300.0)], dim=1),
    )
    torch.testing.assert_close(solve(*padded), solve(points, target), atol=1e-5, rtol=0)


def test_information_tells_that_distance_hides_translation() -> None:
    def sigma(points: Tensor) -> Tensor:
        target = project_points(points, INTRINSICS)
        pose = GeometricHead(TINY, RANGES[0]).solve(points, target, torch.ones_like(target), INTRINSICS)
        assert pose.information is not None
        assert (torch.linalg.eigvalsh(pose.information[0]) > 0).all()
        return torch.linalg.inv(pose.information[0]).diagonal().sqrt()

    near, far = sigma(scene()), sigma(4.0 * scene())
    torch.testing.assert_close(far[:3], 4.0 * near[:3], rtol=0.05, atol=0)
    torch.testing.assert_close(far[3:], near[3:], rtol=0.05, atol=0)


def test_solver_passes_gradients_to_targets_and_scales() -> None:
    points = scene(60)
    target = projected(points, correction((1.0, 1.0, 1.0), (0.1, 0.1, 0.1))).requires_grad_()
    scale = torch.ones_like(target, requires_grad=True)
    GeometricHead(TINY, RANGES[2]).solve(points, target, scale, INTRINSICS).correction[:, :3].square().sum().backward()
    for gradient in (target.grad, scale.grad):
        assert gradient is not None and gradient.isfinite().all() and gradient.abs().sum() > 0


def test_jacobian_is_the_derivative_of_the_projection() -> None:
    points, intrinsics = scene(5)[0].double(), INTRINSICS.double()

    def pixels(twist: Tensor) -> Tensor:
        turned = points @ torch.linalg.matrix_exp(skew(twist[3:])).T + twist[:3]
        return project_points(turned[None], intrinsics)[0]

    expected = torch.autograd.functional.jacobian(pixels, torch.zeros(6, dtype=torch.float64))
    found = projection_jacobian(points.T[None], intrinsics)[0]  # [6, 2, N]
    torch.testing.assert_close(found.permute(2, 1, 0), expected)


def test_geometric_head_reads_the_field_in_pixels() -> None:
    truth = correction((1.0, -2.0, 1.5), (0.1, 0.2, -0.1))
    points = scene(96)
    cells = points.transpose(1, 2).unflatten(2, (8, 12))
    displacement = (projected(points, truth) - project_points(points, INTRINSICS)).transpose(1, 2).unflatten(2, (8, 12))
    field = DisplacementField(displacement, torch.full_like(displacement, -1.0), torch.zeros(1, 16, 8, 12))
    with torch.autocast("cpu", torch.bfloat16):
        pose = GeometricHead(TINY, RANGES[2])(field, cells, INTRINSICS)
    degrees, centimetres = error(pose.correction[0], truth)
    assert degrees < 0.05, "the solver must not run in bf16"
    assert centimetres < 3.0


def test_a_batch_is_solved_frame_by_frame_wherever_its_cells_are() -> None:
    generator = torch.Generator().manual_seed(2)
    head, intrinsics = GeometricHead(TINY, RANGES[2]), INTRINSICS.expand(2, 3, 3)
    cells = scene(40).transpose(1, 2).unflatten(2, (5, 8)).repeat(2, 1, 1, 1)
    cells[0, :, :, :3], cells[1, :, 3:] = 0.0, 0.0
    displacement, log_scale = torch.randn(2, 2, 2, 5, 8, generator=generator)
    both = head(DisplacementField(3 * displacement, log_scale, displacement), cells, intrinsics)
    for number in range(2):
        one = slice(number, number + 1)
        field = DisplacementField(3 * displacement[one], log_scale[one], displacement[one])
        alone = head(field, cells[one], INTRINSICS)
        torch.testing.assert_close(both.correction[one], alone.correction, atol=1e-5, rtol=1e-4)
    nothing = head(DisplacementField(displacement, log_scale, displacement), torch.zeros_like(cells), intrinsics)
    torch.testing.assert_close(nothing.correction, torch.eye(4).expand(2, 4, 4))


def test_rotations() -> None:
    torch.manual_seed(0)
    vector = 0.3 * torch.randn(5, 3, dtype=torch.float64)
    rotation = rotation_from_vector(vector)
    torch.testing.assert_close(rotation @ rotation.transpose(1, 2), torch.eye(3).double().expand(5, 3, 3))
    half = vector.norm(dim=1, keepdim=True) / 2
    quaternion = torch.cat([half.cos(), half.sin() * vector / (2 * half)], dim=1)
    torch.testing.assert_close(rotation_from_quaternion(7.0 * quaternion), rotation)
    torch.testing.assert_close(
        rotation_vector(rotation_from_vector(0.01 * vector)), 0.01 * vector, atol=1e-7, rtol=1e-4
    )


@pytest.mark.parametrize("stage", [1, 5])
def test_regression_head_starts_within_its_range(stage: int) -> None:
    torch.manual_seed(0)
    range_ = RANGES[stage - 1]
    head = RegressionHead(replace(TINY, head="regression"), range_).eval()
    field = DisplacementField(torch.randn(3, 2, 8, 12), torch.zeros(3, 2, 8, 12), torch.randn(3, 16, 8, 12))
    pose = head(field, 10 * torch.rand(3, 3, 8, 12), INTRINSICS.expand(3, 3, 3))
    assert pose.information is None
    for estimate in pose.correction.detach().double().numpy():
        start = pose_error(estimate, torch.eye(4).double().numpy())
        assert start.rotation_deg < 0.5 * range_.rotation_deg
        assert start.translation_cm < 50 * range_.translation_m
        torch.testing.assert_close(
            torch.from_numpy(estimate[:3, :3] @ estimate[:3, :3].T), torch.eye(3).double(), atol=1e-5, rtol=0
        )


def test_regression_head_can_reach_the_ends_of_its_range() -> None:
    range_ = RANGES[0]
    head = RegressionHead(replace(TINY, head="regression"), range_).eval()
    with torch.no_grad():
        head.translation.weight.zero_()
        head.quaternion.weight.zero_()
        head.translation.bias.copy_(torch.tensor([1.0, -1.0, 0.0]))
        head.quaternion.bias.copy_(torch.tensor([0.0, 1.0, 0.0, 0.0]))
        field = DisplacementField(*(torch.zeros(1, channels, 8, 12) for channels in (2, 2, 16)))
        pose = head(field, torch.zeros(1, 3, 8, 12), INTRINSICS)
    result = pose_error(pose.correction[0].double().numpy(), torch.eye(4).double().numpy())
    assert result.pitch_deg == pytest.approx(range_.rotation_deg, abs=0.3)
    assert (result.x_cm, result.y_cm, result.z_cm) == pytest.approx((150.0, -150.0, 0.0), abs=1e-3)
