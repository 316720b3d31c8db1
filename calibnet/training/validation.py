"""Measures the errors that one look of a stage leaves on held-out frames, under fixed miscalibrations."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from calibnet.datasets import Frame, Sequence
from calibnet.datasets.images.files import resize_image
from calibnet.errors import CalibrationError
from calibnet.geometry import pose_error, sample_miscalibration
from calibnet.geometry.types import Extrinsic
from calibnet.training.trained import TrainedNetwork, TrainedStage


class ValidationFigures(NamedTuple):
    """Errors before and after one look with its gain: medians, and the 95th percentile of the rotation."""

    initial_rotation_deg: float
    initial_translation_cm: float
    rotation_deg: float
    translation_cm: float
    rotation_p95_deg: float
    samples: int


class Validation:
    """The held-out frames with their miscalibrations, prepared once."""

    def __init__(self, sequences: list[Sequence], stage: TrainedStage, repeats: int, seed: int) -> None:
        """Draw ``repeats`` miscalibrations of the stage's range for every frame."""
        generator = np.random.default_rng([seed, 3])
        self.stage = stage
        self.cases: list[tuple[Frame, Extrinsic]] = []
        for sequence in sequences:
            for frame in sequence:
                camera = stage.camera(frame)  # kept at the stage's input size, which is smaller
                small = replace(frame, image=resize_image(frame.image, camera), camera=camera, faces=())
                deltas = [sample_miscalibration(stage.range, generator) for _ in range(repeats)]
                self.cases += [(small, delta @ frame.camera_from_lidar) for delta in deltas]

    def __call__(self, network: TrainedNetwork) -> ValidationFigures:
        """Run one look at every frame with ``network``, as the cascade does."""
        changes: dict[str, Any] = {"network": network}  # of the same kind as the stage's own
        stage = replace(self.stage, **changes)
        before, after = [], []
        training = network.training
        network.eval()
        for frame, initial in self.cases:
            corrected = initial
            with contextlib.suppress(CalibrationError):  # a frame without a result counts with its initial error
                corrected = stage.look(frame, stage.view(frame), initial).after
            before.append(pose_error(initial, frame.camera_from_lidar))
            after.append(pose_error(corrected, frame.camera_from_lidar))
        network.train(training)
        rotation = [error.rotation_deg for error in after]
        return ValidationFigures(
            float(np.median([error.rotation_deg for error in before])),
            float(np.median([error.translation_cm for error in before])),
            float(np.median(rotation)),
            float(np.median([error.translation_cm for error in after])),
            float(np.percentile(rotation, 95)),
            len(self.cases),
        )
