"""Residuals: the errors, outliers included, that earlier looks leave, and that the next look is trained to correct."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from calibnet.cascade.loading import load_stage
from calibnet.cascade.stage import Stage
from calibnet.errors import CalibrationError
from calibnet.geometry import RANGES, MiscalibrationRange, invert, range_of, sample_miscalibration
from calibnet.geometry.types import Transform
from calibnet.training.frames import TrainingFrames
from calibnet.training.recipe import DrawRecipe
from calibnet.weights.manifest import load_manifest


def stages_before(preset: str, range_: MiscalibrationRange, folder: Path) -> list[Stage]:
    """The stages of wider ranges in ``folder``, coarse to fine; those without weights are left out."""
    manifest = load_manifest(preset, folder)
    wider = RANGES[: RANGES.index(range_)] if range_ in RANGES else ()
    stages = [load_stage(number, manifest, folder) for number in range(1, len(wider) + 1)]
    return [stage for stage in stages if stage is not None]


def residual_errors(
    stages: list[Stage],
    frames: TrainingFrames,
    range_: MiscalibrationRange,
    recipe: DrawRecipe,
    start: Stage | None = None,
) -> list[Transform]:
    """Errors ``correction @ delta`` that the stages leave on some augmented training frames.

    Args:
        stages: stages to run in sequence, each from the result of the one before.
        frames: the training frames.
        range_: range of the stage to train.
        recipe: how many frames to use, and which errors are of lost frames and left out.
        start: the stage to train with its initial weights, if it looks more than once; the errors that its first look
            leaves are added.
    """
    generator = np.random.default_rng([frames.seed, 4])
    residuals = []
    for number in range(recipe.residuals):
        frame = frames.draw(number, generator, whole=True)
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
        residuals += [delta for after in left if within(delta := after @ invert(reference), range_, recipe)]
    return residuals


def within(delta: Transform, range_: MiscalibrationRange, recipe: DrawRecipe) -> bool:
    """Whether an error is small enough for a stage of this range to correct."""
    error = range_of(delta)
    return (
        error.rotation_deg < recipe.lost_rotation * range_.rotation_deg
        and error.translation_m < recipe.lost_translation * range_.translation_m
    )
