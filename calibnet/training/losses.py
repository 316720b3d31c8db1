"""The hybrid loss (paper section 3.5): pose, quaternion angle, point distance, displacement, matching."""

from __future__ import annotations

from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor

from calibnet.network.batch import NetworkInputs
from calibnet.network.config import NetworkConfig
from calibnet.network.cost_volume import LOGIT_SCALE
from calibnet.network.network import NetworkOutput
from calibnet.network.target import Target, rotation_angle, transform_points, true_displacement
from calibnet.training.recipe import LossRecipe


class Losses(NamedTuple):
    """The terms of the hybrid loss, each already weighted, and two figures for the progress line."""

    matching: Tensor
    displacement: Tensor
    pose: Tensor
    quaternion: Tensor
    points: Tensor
    rotation_deg: Tensor
    translation_cm: Tensor

    @property
    def total(self) -> Tensor:
        """The loss that is minimised."""
        return self.matching + self.displacement + self.pose + self.quaternion + self.points


def balanced(depth: Tensor, counted: Tensor, recipe: LossRecipe, strength: float = 1.0) -> Tensor:
    """Weights with which all bands of depth count alike.

    Args:
        depth: ``[...]`` metres.
        counted: ``[...]`` bool: the cells that are weighted.
        recipe: the bands.
        strength: 1 for balanced bands, 0 for equal cells; in between, a mixture.

    Returns:
        ``[...]`` weights: mean 1 over the cells that count, 0 for the others.
    """
    # sums only: counting with masks or bins would make the host wait for the GPU
    bands = [depth >= nearest for nearest in recipe.depth_bands_m]
    band = sum((farther.long() for farther in bands), torch.zeros_like(depth, dtype=torch.long))
    beyond = torch.stack([counted.sum(), *((counted & farther).sum() for farther in bands), counted.sum() * 0])
    cells, total = -beyond.diff(), beyond[0].clamp(min=1)
    weight = counted / (cells / total).clamp(min=recipe.rarest_band)[band]
    weight = weight * (total / weight.sum().clamp(min=1e-6))
    return strength * weight + (1 - strength) * counted


def matching_loss(
    logits: Tensor, displacement: Tensor, visible: Tensor, depth: Tensor, stride: int, radius: int, recipe: LossRecipe
) -> Tensor:
    """Cross-entropy over the window against the true displacement, spread over its four nearest cells.

    All bands of depth count alike, see `balanced`.

    Args:
        logits: ``[B, D, h, w]``.
        displacement: ``[B, 2, h, w]``, true displacement in pixels.
        visible: ``[B, h, w]``, cells that count; those whose true displacement is outside the window do not either.
        depth: ``[B, h, w]``, depth of the cells' points, metres.
        stride: side of a cell, pixels.
        radius: radius of the window, cells.
        recipe: the bands of depth.
    """
    window = 2 * radius + 1
    position = displacement / stride + radius
    inside = visible & ((position >= 0) & (position <= 2 * radius)).all(1)
    corner = position.clamp(0, 2 * radius - 1e-3).floor()
    fraction = (position - corner).clamp(0, 1)
    log_probability = F.log_softmax(logits.float(), dim=1)
    loss = torch.zeros_like(log_probability[:, 0])
    for dy in (0, 1):
        for dx in (0, 1):
            wx = fraction[:, 0] if dx else 1 - fraction[:, 0]
            wy = fraction[:, 1] if dy else 1 - fraction[:, 1]
            index = ((corner[:, 1] + dy) * window + corner[:, 0] + dx).long()
            loss = loss - wx * wy * log_probability.gather(1, index[:, None])[:, 0]
    return (loss * balanced(depth, inside, recipe)).sum() / inside.sum().clamp(min=1)


def scores_loss(
    logits: list[Tensor], inputs: NetworkInputs, target: Target, config: NetworkConfig, recipe: LossRecipe
) -> Tensor:
    """The matching loss of logits ``[B, D, h_s, w_s]``, averaged over the scales."""
    losses = [
        matching_loss(
            scale_logits,
            true_displacement(cells, target.correction, inputs.intrinsics) - target.shift[:, :, None, None],
            visible,
            cells[:, 2],
            stride,
            config.radius,
            recipe,
        )
        for scale_logits, cells, visible, stride in zip(
            logits, inputs.cells, target.visible, config.volume_scales, strict=False
        )
    ]
    return torch.stack(losses).mean()


def cosines_loss(
    scores: list[Tensor], inputs: NetworkInputs, target: Target, config: NetworkConfig, recipe: LossRecipe
) -> Tensor:
    """The matching loss of the features' cosines ``[B, D, h_s, w_s]``, as logits."""
    return scores_loss([LOGIT_SCALE * score for score in scores], inputs, target, config, recipe)


def feature_losses(
    scores: list[Tensor], inputs: NetworkInputs, target: Target, config: NetworkConfig, recipe: LossRecipe
) -> Losses:
    """The terms of a batch that trains features alone; it has no pose, and so no pose errors."""
    matching = cosines_loss(scores, inputs, target, config, recipe)
    zero, unknown = torch.zeros_like(matching), torch.full_like(matching.detach(), torch.nan)
    return Losses(recipe.matching * matching, zero, zero, zero, zero, unknown, unknown)


def displacement_loss(
    output: NetworkOutput, displacement: Tensor, visible: Tensor, depth: Tensor, recipe: LossRecipe
) -> Tensor:
    """Laplace negative log-likelihood of the field, per axis, in units of pixels; partly balanced over depth."""
    error = (output.field.displacement - displacement).abs()
    likelihood = error * torch.exp(-output.field.log_scale) + output.field.log_scale
    weight = balanced(depth, visible, recipe, recipe.displacement_balance)
    return (likelihood * weight[:, None]).sum() / (2 * visible.sum().clamp(min=1))


def hybrid_loss(
    output: NetworkOutput,
    inputs: NetworkInputs,
    target: Target,
    config: NetworkConfig,
    recipe: LossRecipe,
    pose_share: float = 1.0,
) -> Losses:
    """All terms of one batch; only those of the pose without ``config.hybrid_loss`` (the paper's ablation).

    ``pose_share`` scales the terms of the pose: until the features match anything, the gradient of the
    pose is noise that keeps them from learning to match.
    """
    estimate, truth = output.pose.correction, target.correction
    difference = estimate @ torch.linalg.inv_ex(truth).inverse
    angle = rotation_angle(difference[:, :3, :3])
    offset = (estimate[:, :3, 3] - truth[:, :3, 3]).norm(dim=-1)
    zero = angle.new_zeros(())
    matching, field, points = zero, zero, zero
    if config.hybrid_loss:
        of_features = cosines_loss(output.scores, inputs, target, config, recipe)
        of_volumes = scores_loss(output.logits, inputs, target, config, recipe)
        matching = recipe.feature_share * of_features + (1 - recipe.feature_share) * of_volumes
        truth_here = true_displacement(inputs.cells[0], truth, inputs.intrinsics)
        field = displacement_loss(output, truth_here, target.visible[0], inputs.cells[0][:, 2], recipe)
        cloud = inputs.cells[-1].flatten(2).transpose(1, 2)
        occupied = cloud[..., 2] > 0
        distance = (transform_points(estimate, cloud) - transform_points(truth, cloud)).norm(dim=-1) * occupied
        points = distance.sum() / occupied.sum().clamp(min=1)
    return Losses(
        matching=recipe.matching * matching,
        displacement=recipe.displacement * field,
        pose=recipe.pose * pose_share * offset_cost(offset, recipe.linear_m).mean(),
        quaternion=recipe.quaternion * pose_share * angle.mean(),
        points=recipe.points * pose_share * torch.log1p(points),
        rotation_deg=torch.rad2deg(angle.detach()).mean(),
        translation_cm=100 * offset.detach().mean(),
    )


def offset_cost(offset: Tensor, linear: float) -> Tensor:
    """The offset itself up to ``linear`` metres; beyond, it grows smoothly as the logarithm does."""
    return torch.where(offset < linear, offset, linear * (1 + (offset / linear).clamp(min=1).log()))
