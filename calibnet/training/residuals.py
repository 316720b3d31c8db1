"""What earlier looks leave behind: the errors, tails included, that the next look is trained to correct."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch

from calibnet.datasets.frame import Frame
from calibnet.geometry import RANGES, MiscalibrationRange, sample_miscalibration
from calibnet.geometry.miscalibration import range_of
from calibnet.geometry.types import Transform
from calibnet.network.network import CalibrationNetwork
from calibnet.runtime.precision import autocast
from calibnet.training.samples import TrainingSamples, collate, make_sample, plain
from calibnet.weights import load_network, weights_path

LARGEST_ROTATION, LARGEST_TRANSLATION = 3.0, 6.0
"""Residuals beyond so many times the stage's own range are lost frames: there is nothing to learn from them.

A stage corrects less than it should of what is larger than all it has seen, so this is generous.
"""


def stages_before(preset: str, range_: MiscalibrationRange, folder: Path) -> list[CalibrationNetwork]:
    """The networks of wider ranges in ``folder``, coarse to fine; those without weights are left out."""
    wider = RANGES[: RANGES.index(range_)] if range_ in RANGES else ()
    paths = [weights_path(preset, stage, folder) for stage in wider]
    return [load_network(path) for path in paths if path.is_file()]


def residual_errors(
    networks: list[CalibrationNetwork],
    data: TrainingSamples,
    range_: MiscalibrationRange,
    count: int,
    start: CalibrationNetwork | None = None,
) -> list[Transform]:
    """Errors ``correction @ delta`` (4x4) that the networks leave on ``count`` augmented training frames.

    Args:
        networks: run one after the other, each from where the one before arrived.
        data: where frames come from.
        range_: of the stage to be trained.
        count: frames to run; what is lost altogether is left out of the result.
        start: the stage itself as it was, if it looks more than once: what its first look leaves is added.
    """
    generator = np.random.default_rng([data.seed, 4])
    residuals = []
    for number in range(count):
        frame = data.draw_frame(number, generator, 1.0, whole=True)
        delta = sample_miscalibration(networks[0].range if networks else range_, generator)
        for network in networks:
            seen = plain(frame, network.input_camera(frame.camera))
            for _ in range(network.looks):
                correction = look(network, seen, delta)
                delta = correction @ delta
                if network.is_settled(correction):
                    break
        if networks and within(delta, range_):
            residuals.append(delta)
        if start is not None:
            delta = look(start, plain(frame, start.input_camera(frame.camera)), delta) @ delta
            if within(delta, range_):
                residuals.append(delta)
    return residuals


def look(network: CalibrationNetwork, frame: Frame, delta: Transform) -> Transform:
    """The correction (4x4) of one frame, already at input size, under ``delta @ camera_from_lidar``."""
    inputs, _ = collate([make_sample(frame, delta, network.config.volume_scales)])
    device = next(network.parameters()).device
    with torch.inference_mode(), autocast(device):
        return network.correction(network(inputs.to(device)))


def within(delta: Transform, range_: MiscalibrationRange) -> bool:
    """Whether an error is near enough to be corrected by a stage of these range_."""
    if not np.isfinite(delta).all():
        return False
    error = range_of(delta)
    return (
        error.rotation_deg < LARGEST_ROTATION * range_.rotation_deg
        and error.translation_m < LARGEST_TRANSLATION * range_.translation_m
    )
