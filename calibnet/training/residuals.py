"""What earlier looks leave behind: the errors, tails included, that the next look is trained to correct."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from calibnet.cascade.stage import Stage, load_stage
from calibnet.errors import CalibrationError
from calibnet.geometry import RANGES, MiscalibrationRange, invert, range_of, sample_miscalibration
from calibnet.geometry.types import Transform
from calibnet.training.samples import TrainingSamples
from calibnet.weights.manifest import load_manifest

LARGEST_ROTATION, LARGEST_TRANSLATION = 3.0, 6.0
"""Residuals beyond so many times the stage's own range are lost frames: there is nothing to learn from them.

A stage corrects less than it should of what is larger than all it has seen, so this is generous.
"""


def stages_before(preset: str, range_: MiscalibrationRange, folder: Path) -> list[Stage]:
    """The stages of wider ranges in ``folder``, coarse to fine; those without weights are left out."""
    manifest = load_manifest(preset, folder)
    wider = RANGES[: RANGES.index(range_)] if range_ in RANGES else ()
    stages = [load_stage(number, manifest, folder) for number in range(1, len(wider) + 1)]
    return [stage for stage in stages if stage is not None]


def residual_errors(
    stages: list[Stage],
    data: TrainingSamples,
    range_: MiscalibrationRange,
    count: int,
    start: Stage | None = None,
) -> list[Transform]:
    """Errors ``correction @ delta`` that the stages leave on ``count`` augmented training frames.

    Args:
        stages: run one after the other, each from where the one before arrived.
        data: where frames come from.
        range_: of the stage to be trained.
        count: frames to run; what is lost altogether is left out of the result.
        start: the stage itself as it was, if it looks more than once: what its first look leaves is added.
    """
    generator = np.random.default_rng([data.seed, 4])
    residuals = []
    for number in range(count):
        frame = data.draw_frame(number, generator, 1.0, whole=True)
        reference = frame.camera_from_lidar
        extrinsic = sample_miscalibration(stages[0].range if stages else range_, generator) @ reference
        left = []
        try:
            for stage in stages:
                extrinsic = stage.correct(frame, stage.view(frame), extrinsic).after
            left += [extrinsic] if stages else []
            if start is not None:
                left.append(start.look(frame, start.view(frame), extrinsic).after)
        except CalibrationError:  # too few points are left in the image: a lost frame
            pass
        residuals += [delta for after in left if within(delta := after @ invert(reference), range_)]
    return residuals


def within(delta: Transform, range_: MiscalibrationRange) -> bool:
    """Whether an error is near enough to be corrected by a stage of this range."""
    error = range_of(delta)
    return (
        error.rotation_deg < LARGEST_ROTATION * range_.rotation_deg
        and error.translation_m < LARGEST_TRANSLATION * range_.translation_m
    )
