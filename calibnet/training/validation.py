"""Single-shot errors of one stage on held-out frames, under miscalibrations that never change."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch

from calibnet.datasets import Sequence
from calibnet.geometry import pose_error, sample_miscalibration
from calibnet.network.network import CalibrationNetwork
from calibnet.runtime.precision import autocast
from calibnet.training.samples import Sample, collate, make_sample, plain


class ValidationFigures(NamedTuple):
    """Errors before and after one shot of the stage: medians, and the rotation's 95th percentile."""

    initial_rotation_deg: float
    initial_translation_cm: float
    rotation_deg: float
    translation_cm: float
    rotation_p95_deg: float
    samples: int


class Validation:
    """The held-out samples, prepared once."""

    def __init__(self, sequences: list[Sequence], network: CalibrationNetwork, repeats: int, seed: int) -> None:
        config = network.config
        generator = np.random.default_rng([seed, 3])
        self.samples: list[Sample] = []
        for sequence in sequences:
            for frame in sequence:
                small = plain(frame, network.input_camera(frame.camera))
                self.samples += [
                    make_sample(small, sample_miscalibration(network.range, generator), config.volume_scales)
                    for _ in range(repeats)
                ]

    def __call__(self, network: CalibrationNetwork) -> ValidationFigures:
        """Run the network over all samples, one by one as the cascade does."""
        device = next(network.parameters()).device
        before, after = [], []
        training = network.training
        network.eval()
        with torch.inference_mode(), autocast(device):
            for sample in self.samples:
                inputs, _ = collate([sample])
                estimate = network(inputs.to(device)).pose.correction[0].double().cpu().numpy()
                truth = sample.correction.astype(np.float64)
                before.append(pose_error(np.eye(4), truth))
                after.append(pose_error(estimate, truth))
        network.train(training)
        rotation = [error.rotation_deg for error in after]
        return ValidationFigures(
            float(np.median([error.rotation_deg for error in before])),
            float(np.median([error.translation_cm for error in before])),
            float(np.median(rotation)),
            float(np.median([error.translation_cm for error in after])),
            float(np.percentile(rotation, 95)),
            len(self.samples),
        )
