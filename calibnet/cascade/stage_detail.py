"""Converts a network's tensors to the NumPy detail that the inspector shows, without computing anything twice."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from calibnet.network.batch import Cut, LidarInput
from calibnet.network.config import NetworkConfig
from calibnet.network.network import NetworkOutput
from calibnet.trace import ScaleTrace, StageDetail


def stage_detail(config: NetworkConfig, lidar: LidarInput, cut: Cut, output: NetworkOutput) -> StageDetail:
    """The intermediate results of one frame, from a forward pass with ``keep_activations``.

    Args:
        config: configuration of the network.
        lidar: the projected scan.
        cut: rows that the network skipped, which are filled with zeros here.
        output: output of a batch of one.
    """
    assert output.activations is not None
    scales = tuple(
        scale_trace(stride, config.window, cells[2] > 0, cut, score[0], logits[0], before[0], after[0])
        for stride, cells, score, logits, before, after in zip(
            config.volume_scales, lidar.cells, output.scores, output.logits, *output.activations, strict=False
        )
    )
    # the geometric mean of the two axes' expected errors, in pixels; 1 at a pixel or better
    error = cut.undo(output.field.log_scale[0].float().mean(0)).exp().cpu().numpy()
    displacement = cut.undo(output.field.displacement[0].float())
    return StageDetail(
        depth=lidar.image[0],
        scales=scales,
        displacement=displacement.permute(1, 2, 0).cpu().numpy(),
        confidence=(lidar.occupied / np.maximum(error, 1.0)).astype(np.float32),
    )


def scale_trace(
    stride: int,
    window: int,
    occupied: NDArray[np.bool_],
    cut: Cut,
    score: Tensor,
    logits: Tensor,
    before: Tensor,
    after: Tensor,
) -> ScaleTrace:
    """The trace of one scale.

    Args:
        stride: size of a cell in input pixels.
        window: side of the search window, in cells.
        occupied: ``[H, w]``, cells with a point.
        cut: rows that the tensors lack.
        score: ``[D, h, w]``.
        logits: ``[D, h, w]``.
        before: ``[C, D, h, w]``.
        after: ``[C, D, h, w]``.
    """
    radius = window // 2

    def half(tensor: Tensor) -> NDArray[np.float16]:
        array: NDArray[np.float16] = cut.undo(tensor).to("cpu", torch.float16).contiguous().numpy()
        return array

    winner = logits.argmax(0)
    best = torch.stack([winner % window - radius, winner // window - radius])
    return ScaleTrace(
        stride=stride,
        volume=half(score.unflatten(0, (window, window))),
        probability=half(logits.float().softmax(0).unflatten(0, (window, window))),
        best=cut.undo(best).permute(1, 2, 0).cpu().numpy(),
        before=half(before.amax(1)),
        after=half(after.amax(1)),
        occupied=occupied,
    )
