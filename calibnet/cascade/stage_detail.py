"""From a network's tensors to the NumPy detail that the inspector shows; nothing is computed twice."""

from __future__ import annotations

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from torch import Tensor

from calibnet.network.batch import LidarInput
from calibnet.network.config import NetworkConfig
from calibnet.network.network import NetworkOutput
from calibnet.trace import ScaleTrace, StageDetail


def stage_detail(config: NetworkConfig, lidar: LidarInput, output: NetworkOutput) -> StageDetail:
    """Read one frame's intermediate results off a forward pass made with ``keep_activations``.

    The network may have been spared the empty rows at the top of ``lidar``; here they are, full of zeros.
    """
    assert output.activations is not None
    scales = tuple(
        scale_trace(stride, config.window, cells, score[0], logits[0], before[0], after[0])
        for stride, cells, score, logits, before, after in zip(
            config.volume_scales, lidar.cells, output.scores, output.logits, *output.activations, strict=False
        )
    )
    occupied = lidar.cells[0][2] > 0
    # the geometric mean of the two axes' expected errors, in pixels; 1 at a pixel or better
    error = at_the_bottom(output.field.log_scale[0].float().mean(0), len(occupied)).exp().cpu().numpy()
    displacement = at_the_bottom(output.field.displacement[0].float(), len(occupied))
    return StageDetail(
        depth=lidar.image[0],
        scales=scales,
        displacement=displacement.permute(1, 2, 0).cpu().numpy(),
        confidence=(occupied / np.maximum(error, 1.0)).astype(np.float32),
    )


def at_the_bottom(tensor: Tensor, height: int) -> Tensor:
    """``[..., h, w]`` as the lowest rows of ``[..., height, w]``, zeros above."""
    return F.pad(tensor, (0, 0, height - tensor.shape[-2], 0))


def scale_trace(
    stride: int, window: int, cells: NDArray[np.float32], score: Tensor, logits: Tensor, before: Tensor, after: Tensor
) -> ScaleTrace:
    """The trace of one scale.

    Args:
        stride: input pixels a cell.
        window: side of the search window, in cells.
        cells: ``[3, H, w]``.
        score: ``[D, h, w]``, of the lowest rows.
        logits: ``[D, h, w]``.
        before: ``[C, D, h, w]``.
        after: ``[C, D, h, w]``.
    """
    height, radius = cells.shape[1], window // 2

    def half(tensor: Tensor) -> NDArray[np.float16]:
        array: NDArray[np.float16] = at_the_bottom(tensor, height).to("cpu", torch.float16).contiguous().numpy()
        return array

    winner = logits.argmax(0)
    best = torch.stack([winner % window - radius, winner // window - radius])
    return ScaleTrace(
        stride=stride,
        volume=half(score.unflatten(0, (window, window))),
        probability=half(logits.float().softmax(0).unflatten(0, (window, window))),
        best=at_the_bottom(best, height).permute(1, 2, 0).cpu().numpy(),
        before=half(before.amax(1)),
        after=half(after.amax(1)),
        occupied=cells[2] > 0,
    )
