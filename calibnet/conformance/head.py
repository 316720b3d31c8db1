"""What a pose head promises: `check_head`."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from calibnet.conformance.requirement import require, require_definite, require_rigid
from calibnet.geometry import RANGES, MiscalibrationRange
from calibnet.network.config import NetworkConfig, load_preset

if TYPE_CHECKING:
    from torch import Tensor, nn

    from calibnet.network.displacement import DisplacementField
    from calibnet.network.pose import Pose

SINGLE_PRECISION = 1e-4
SIZES = ((20, 64), (12, 40))
"""Rows and columns of cells: those of the shipped network, and others."""


def check_head(
    head: Callable[[NetworkConfig, MiscalibrationRange], nn.Module], config: NetworkConfig | None = None
) -> None:
    """Hold a pose head to its interface: from a displacement field to a rigid correction, trainable, a frame by itself.

    Args:
        head: its class, called as `calibnet.network.heads` says.
        config: of the network it is for; the preset ``compact`` by default.

    Raises:
        AssertionError: a promise is not kept; the sentence says which.
    """
    import torch
    from safetensors.torch import save

    torch.manual_seed(0)
    config = load_preset("compact") if config is None else config
    module = head(config, RANGES[2]).eval()
    for size in SIZES:
        inputs = random_inputs(config, *size)
        with torch.no_grad():
            pose, again = module(*inputs), module(*inputs)
            alone = module(*_first(inputs))
        _check_pose(pose, len(inputs[1]))
        require(torch.equal(pose.correction, again.correction), "The same field gives different corrections.")
        same = torch.allclose(pose.correction[:1], alone.correction, atol=SINGLE_PRECISION)
        require(same, "A frame's correction depends on the other frames of its batch.")
    require(len(save(module.state_dict())) > 0, "The head's state cannot be stored.")
    _check_gradient(module.train(), random_inputs(config, *SIZES[0]))


def random_inputs(config: NetworkConfig, height: int, width: int) -> tuple[DisplacementField, Tensor, Tensor]:
    """Noise as a displacement field of two frames; points at 3 to 33 m in half of the cells, the others empty."""
    import torch

    from calibnet.network.displacement import DisplacementField

    noise = torch.Generator().manual_seed(1)
    stride = config.scales[0]
    v, u = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    pixels = torch.stack([stride * u, stride * v, torch.ones_like(u)]).float()
    focal, center = 0.7 * stride * width, (stride * width / 2, stride * height / 2)
    intrinsics = torch.tensor([[focal, 0.0, center[0]], [0.0, focal, center[1]], [0.0, 0.0, 1.0]])
    depth = 3.0 + 30.0 * torch.rand(2, 1, height, width, generator=noise)
    depth = depth * (torch.rand(depth.shape, generator=noise) < 0.5)
    cells = torch.einsum("ij,jhw->ihw", torch.linalg.inv(intrinsics), pixels)[None] * depth
    shape = (2, 2, height, width)
    field = DisplacementField(
        displacement=4.0 * torch.randn(shape, generator=noise),
        log_scale=0.5 * torch.randn(shape, generator=noise),
        features=torch.randn(2, config.context_channels, height, width, generator=noise),
    )
    return field, cells, intrinsics.expand(2, 3, 3)


def _first(inputs: tuple[DisplacementField, Tensor, Tensor]) -> tuple[Any, ...]:
    field, cells, intrinsics = inputs
    return type(field)(*(part[:1] for part in field)), cells[:1], intrinsics[:1]


def _check_pose(pose: Pose, batch: int) -> None:
    shape = list(pose.correction.shape)
    require(shape == [batch, 4, 4], f"The correction has shape {shape} and not [{batch}, 4, 4].")
    for correction in pose.correction:
        require_rigid(correction.numpy(), "a correction", SINGLE_PRECISION)
    if pose.information is not None:
        require(len(pose.information) == batch, "There is not one information matrix per frame.")
        for information in pose.information:
            require_definite(information.numpy(), "an information")


def _check_gradient(module: nn.Module, inputs: tuple[DisplacementField, Tensor, Tensor]) -> None:
    """The loss of a pose has to reach what the field was made from."""
    import torch

    field, cells, intrinsics = inputs
    leaves = [part.requires_grad_() for part in field]
    loss = module(type(field)(*leaves), cells, intrinsics).correction[:, :3].square().sum()
    if loss.requires_grad:
        loss.backward()
    gradients = [leaf.grad for leaf in leaves if leaf.grad is not None]
    require(bool(gradients), "No gradient reaches the displacement field, so nothing could be trained.")
    finite = all(bool(torch.isfinite(gradient).all()) for gradient in gradients)
    require(finite and any(bool(gradient.any()) for gradient in gradients), "The gradient is zero or not finite.")
