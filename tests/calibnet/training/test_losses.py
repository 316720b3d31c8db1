from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import Tensor

from calibnet.geometry import rotation_from_euler_xyz
from calibnet.network.batch import NetworkInputs
from calibnet.network.displacement import DisplacementField
from calibnet.network.network import NetworkOutput
from calibnet.network.pose import Pose
from calibnet.network.target import Target, rotation_angle, true_displacement
from calibnet.training.losses import Losses, balanced, displacement_loss, hybrid_loss, matching_loss, scores_loss
from calibnet.training.recipe import RECIPE
from tests.support.tiny import TINY, random_inputs

CONFIG = replace(TINY, radius=4)
WEIGHTS = RECIPE.losses
SIZES = ((8, 16), (4, 8), (2, 4))


def rigid(degrees: tuple[float, float, float], metres: tuple[float, float, float]) -> Tensor:
    matrix = torch.eye(4)
    matrix[:3, :3] = torch.from_numpy(rotation_from_euler_xyz(np.radians(degrees)))
    matrix[:3, 3] = torch.tensor(metres)
    return matrix[None]


TRUTH = rigid((1.0, -2.0, 0.5), (0.1, -0.2, 0.3))


def inputs_and_target() -> tuple[NetworkInputs, Target]:
    inputs = random_inputs(CONFIG)
    return inputs, Target(TRUTH, torch.zeros(1, 2), [cells[:, 2] > 0 for cells in inputs.cells])


def output(estimate: Tensor, shift_px: float | Tensor = 0.0, sharpness: float = 40.0) -> NetworkOutput:
    """What a network would say that believes in ``estimate``, sees everything ``shift_px`` off and is ``sharp``."""
    inputs, target = inputs_and_target()
    offset = np.arange(-CONFIG.radius, CONFIG.radius + 1)
    logits = []
    for stride, cells in zip(CONFIG.scales, inputs.cells, strict=True):
        truth = true_displacement(cells, target.correction, inputs.intrinsics) + shift_px
        dx = torch.from_numpy(offset)[None, None, :, None, None] * stride - truth[:, :1, None]
        dy = torch.from_numpy(offset)[None, :, None, None, None] * stride - truth[:, 1:, None]
        logits.append((-sharpness * (dx**2 + dy**2) / stride**2).flatten(1, 2))
    field = true_displacement(inputs.cells[0], target.correction, inputs.intrinsics) + shift_px
    cosines = [logit / 40.0 for logit in logits]
    return NetworkOutput(
        Pose(estimate, None), DisplacementField(field, torch.zeros_like(field), torch.empty(0)), cosines, logits, None
    )


def losses(estimate: Tensor = TRUTH, shift_px: float = 0.0, **changes: bool) -> Losses:
    inputs, target = inputs_and_target()
    return hybrid_loss(output(estimate, shift_px), inputs, target, replace(CONFIG, **changes), WEIGHTS)


def test_true_displacement_is_that_of_the_projections() -> None:
    inputs, _ = inputs_and_target()
    displacement = true_displacement(inputs.cells[0], TRUTH, inputs.intrinsics)[0].numpy()
    matrix, correction = inputs.intrinsics[0].double().numpy(), TRUTH[0].double().numpy()
    for row, column in np.argwhere(inputs.cells[0][0, 2].numpy() > 0):
        point = inputs.cells[0][0, :, row, column].double().numpy()
        before = matrix @ point
        after = matrix @ (correction[:3, :3] @ point + correction[:3, 3])
        expected = after[:2] / after[2] - before[:2] / before[2]
        assert displacement[:, row, column] == pytest.approx(expected, abs=1e-3)


def test_terms_of_the_pose_vanish_at_the_truth() -> None:
    result = losses()
    for term in (result.displacement, result.pose, result.quaternion, result.points):
        assert float(term) == pytest.approx(0.0, abs=1e-3)
    assert float(result.rotation_deg) == pytest.approx(0.0, abs=1e-3)
    assert float(result.translation_cm) == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("axis", range(3))
def test_terms_of_the_pose_grow_with_the_error(axis: int) -> None:
    def off(degrees: float, metres: float) -> Losses:
        delta = np.zeros((2, 3))
        delta[:, axis] = degrees, metres
        return losses(rigid(tuple(delta[0]), tuple(delta[1])) @ TRUTH)

    for small, large in ((off(1, 0), off(3, 0)), (off(-2, 0), off(-9, 0))):
        assert 0 < small.quaternion < large.quaternion
        assert 0 < small.points < large.points
    for small, large in ((off(0, 0.1), off(0, 0.5)), (off(0, -0.5), off(0, -4.0))):
        assert 0 < small.pose < large.pose
        assert 0 < small.points < large.points
        assert float(small.quaternion) == pytest.approx(0.0, abs=1e-2)


def test_figures_are_degrees_and_centimetres() -> None:
    result = losses(rigid((0.0, 3.0, 0.0), (0.0, 0.0, 0.0)) @ TRUTH)
    assert float(result.rotation_deg) == pytest.approx(3.0, abs=1e-3)
    shifted = TRUTH.clone()
    shifted[0, 1, 3] += 0.25
    assert float(losses(shifted).translation_cm) == pytest.approx(25.0, abs=1e-2)


def test_matching_and_displacement_grow_with_the_shift() -> None:
    results = [losses(shift_px=shift) for shift in (0.0, 4.0, 8.0, 16.0)]
    for term in ("matching", "displacement"):
        values = [float(getattr(result, term)) for result in results]
        assert values == sorted(values) and values[0] < 0.2 * values[-1]


def test_matching_follows_a_displaced_lidar_image() -> None:
    inputs, target = inputs_and_target()
    shift = torch.tensor([[8.0, -16.0]])
    displaced = target._replace(shift=shift)
    right, ignorant = output(TRUTH, shift_px=-shift[..., None, None]), output(TRUTH)
    assert scores_loss(right.logits, inputs, displaced, CONFIG, WEIGHTS) < 0.2 * scores_loss(
        ignorant.logits, inputs, displaced, CONFIG, WEIGHTS
    )


def test_only_the_pose_counts_without_the_hybrid_loss() -> None:
    wrong = rigid((3.0, 0.0, 0.0), (0.2, 0.0, 0.0)) @ TRUTH
    full, pose_only = losses(wrong, 8.0), losses(wrong, 8.0, hybrid_loss=False)
    assert pose_only.matching == pose_only.displacement == pose_only.points == 0
    assert pose_only.pose == full.pose and pose_only.quaternion == full.quaternion
    assert pose_only.total < full.total


def test_matching_is_least_at_the_true_cell() -> None:
    radius, stride = 4, 8
    window = 2 * radius + 1
    displacement = torch.tensor([3.0 * stride, -2.0 * stride])[None, :, None, None]
    visible = torch.ones(1, 1, 1, dtype=torch.bool)
    costs = []
    for cell in range(window**2):
        logits = torch.zeros(1, window**2, 1, 1)
        logits[0, cell] = 10.0
        costs.append(
            float(matching_loss(logits, displacement, visible, torch.full((1, 1, 1), 7.0), stride, radius, WEIGHTS))
        )
    true_cell = (radius - 2) * window + radius + 3
    assert int(np.argmin(costs)) == true_cell
    assert costs[true_cell] < 0.01 and min(np.delete(costs, true_cell)) > 5


def test_matching_between_cells_asks_for_shares() -> None:
    displacement = torch.tensor([2.0, 4.0])[None, :, None, None]  # a quarter of a cell right, half a cell down
    logits = torch.zeros(1, 25, 1, 1, requires_grad=True)
    matching_loss(
        logits, displacement, torch.ones(1, 1, 1, dtype=torch.bool), torch.ones(1, 1, 1), 8, 2, WEIGHTS
    ).backward()
    assert logits.grad is not None
    asked = (1 / 25 - logits.grad).reshape(5, 5)  # the gradient of a cross-entropy is softmax minus target
    expected = torch.zeros(5, 5)
    expected[2:4, 2:4] = torch.tensor([[0.75, 0.25], [0.75, 0.25]]) / 2
    torch.testing.assert_close(asked, expected)


@pytest.mark.parametrize("displacement", [(33.0, 0.0), (0.0, -32.1), (1e6, 1e6), (float("inf"), 0.0)])
def test_matching_leaves_out_what_the_window_cannot_hold(displacement: tuple[float, float]) -> None:
    logits = torch.randn(1, 81, 2, 2, requires_grad=True)
    truth = torch.tensor(displacement)[None, :, None, None].expand(1, 2, 2, 2)
    loss = matching_loss(
        logits, truth, torch.ones(1, 2, 2, dtype=torch.bool), torch.full((1, 2, 2), 7.0), 8, 4, WEIGHTS
    )
    loss.backward()
    assert loss == 0 and logits.grad is not None and logits.grad.abs().sum() == 0


def test_matching_counts_the_end_of_the_window_and_hidden_cells_not_at_all() -> None:
    logits = torch.zeros(1, 81, 1, 2)
    logits[0, 80, 0, 0] = 50.0  # the last displacement: 4 cells right, 4 down
    truth = torch.full((1, 2, 1, 2), 32.0)
    visible = torch.tensor([[[True, False]]])
    depth = torch.tensor([[[7.0, 50.0]]])
    assert float(matching_loss(logits, truth, visible, depth, 8, 4, WEIGHTS)) == pytest.approx(0.0, abs=1e-3)
    assert float(matching_loss(logits, truth, ~visible, depth, 8, 4, WEIGHTS)) == pytest.approx(np.log(81), abs=1e-3)


def test_bands_of_depth_count_alike() -> None:
    depth = torch.tensor([3.0, 7.0, 7.5, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0, 10.0])
    counted = torch.tensor([True] * 9 + [False])
    weight = balanced(depth, counted, WEIGHTS)
    # nine cells in three bands: each band weighs three, however many cells share that
    torch.testing.assert_close(weight, torch.tensor([3.0, 1.5, 1.5, *[0.5] * 6, 0.0]))
    torch.testing.assert_close(
        balanced(depth, counted, WEIGHTS, 0.5), torch.tensor([2.0, 1.25, 1.25, *[0.75] * 6, 0.0])
    )
    torch.testing.assert_close(balanced(depth, counted, WEIGHTS, 0.0), counted.float())


@pytest.mark.parametrize(("metres", "band"), [(5.9, 0), (6.0, 1), (8.9, 1), (9.0, 2), (13.0, 3), (20.0, 4), (35.0, 5)])
def test_bands_end_at_their_metres(metres: float, band: int) -> None:
    centres = torch.tensor([3.0, 7.5, 11.0, 16.0, 27.0, 50.0])
    weight = balanced(torch.cat([centres, torch.tensor([metres])]), torch.ones(7, dtype=torch.bool), WEIGHTS)
    assert [other for other in range(6) if weight[other] == weight[6]] == [band], "two cells share their band's weight"
    assert weight[6] == weight[(band + 1) % 6] / 2


def test_a_band_of_very_few_cells_is_not_heard_louder() -> None:
    depth = torch.cat([torch.full((999,), 50.0), torch.tensor([3.0])])
    weight = balanced(depth, torch.ones(1000, dtype=torch.bool), WEIGHTS)
    assert float(weight.sum()) == pytest.approx(1000, rel=1e-5)
    assert float(weight[-1] / weight[0]) == pytest.approx(0.999 / WEIGHTS.rarest_band, rel=1e-4)


def test_nothing_is_weighted_where_nothing_counts() -> None:
    assert not balanced(torch.tensor([3.0, 50.0]), torch.tensor([False, False]), WEIGHTS).any()


def test_matching_and_displacement_hear_the_near_cell_as_loud_as_all_far_ones() -> None:
    depth, ones = torch.tensor([[[4.0, *[50.0] * 3]]]), torch.ones(1, 1, 4, dtype=torch.bool)
    logits = torch.zeros(1, 81, 1, 4)
    logits[0, 40, 0, 1:] = 50.0  # the far ones are sure of their place, which is right; the near one knows nothing
    still = torch.zeros(1, 2, 1, 4)
    assert float(matching_loss(logits, still, ones, depth, 8, 4, WEIGHTS)) == pytest.approx(np.log(81) / 2, rel=1e-3)
    error = torch.zeros(1, 2, 1, 4)
    error[..., 0] = 8.0  # half of the weight is balanced (2 of 4 for the near cell), half is not (1 of 4)
    said = output(TRUTH)._replace(field=DisplacementField(error, torch.zeros_like(error), torch.empty(0)))
    assert float(displacement_loss(said, still, ones, depth, WEIGHTS)) == pytest.approx(8.0 * (2 + 1) / 2 / 4)


def test_displacement_loss_rewards_honest_uncertainty() -> None:
    made = output(TRUTH)

    def cost(error: float, log_scale: float) -> float:
        field = DisplacementField(torch.full((1, 2, 1, 1), error), torch.full((1, 2, 1, 1), log_scale), torch.empty(0))
        said = made._replace(field=field)
        one = torch.ones(1, 1, 1)
        return float(displacement_loss(said, torch.zeros(1, 2, 1, 1), one.bool(), 7.0 * one, WEIGHTS))

    scales = np.linspace(-1, 4, 101)
    for error in (1.0, 5.0, 20.0):
        best = scales[np.argmin([cost(error, scale) for scale in scales])]
        assert np.exp(best) == pytest.approx(error, rel=0.05)


def test_angle_is_exact_and_smooth_near_zero() -> None:
    for degrees in (1e-3, 0.1, 5.0, 90.0, 179.0):
        rotation = rigid((0.0, degrees, 0.0), (0, 0, 0))[:, :3, :3].double()
        assert float(torch.rad2deg(rotation_angle(rotation))) == pytest.approx(degrees, rel=1e-2)
    still = torch.eye(3)[None].requires_grad_()
    rotation_angle(still).sum().backward()
    assert still.grad is not None and still.grad.isfinite().all()


@pytest.mark.parametrize("visible", [True, False])
def test_gradients_are_finite(visible: bool) -> None:
    inputs, target = inputs_and_target()
    if not visible:
        target = target._replace(visible=[torch.zeros_like(mask) for mask in target.visible])
        inputs = inputs._replace(cells=[torch.zeros_like(cells) for cells in inputs.cells])
    estimate = TRUTH.clone().requires_grad_()
    made = output(TRUTH)
    leaves = [tensor.requires_grad_() for tensor in (*made.scores, *made.logits, *made.field[:2])]
    made = made._replace(pose=Pose(estimate, None))
    hybrid_loss(made, inputs, target, CONFIG, WEIGHTS).total.backward()
    for leaf in (estimate, *leaves):
        assert leaf.grad is not None and leaf.grad.isfinite().all()
