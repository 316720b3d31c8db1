from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from calibnet.cascade import Stage
from calibnet.geometry import RANGES, MiscalibrationRange, miscalibration, sample_miscalibration
from calibnet.network.batch import NetworkInputs
from calibnet.network.network import NetworkOutput
from calibnet.training.data import Source
from calibnet.training.frames import TrainingFrames
from calibnet.training.recipe import RECIPE, DrawRecipe
from calibnet.training.residuals import residual_errors, stages_before, within
from calibnet.weights import save_network, weights_path
from calibnet.weights.manifest import StageSettings
from tests.support.scene import Scenes
from tests.support.tiny import TINY, tiny_network


def stage(number: int, seed: int, **settings: Any) -> Stage:
    return Stage(number, RANGES[number - 1], tiny_network(seed=seed, stage=number), StageSettings(**settings))


def frames_of(magnification: float = 1.0) -> TrainingFrames:
    sources = [Source(Scenes(), 1.0)]
    return TrainingFrames(sources, RECIPE, TINY.input_height * TINY.input_width, 2, 0, magnification)


def on(count: int) -> DrawRecipe:
    """The recipe with residuals measured on so many frames."""
    return replace(RECIPE.draws, residuals=count)


def test_residuals_are_what_the_stages_leave() -> None:
    stages, wide = [stage(3, seed=1)], MiscalibrationRange(30, 5)
    residuals = residual_errors(stages, frames_of(), wide, on(6))
    assert len(residuals) == 6
    for one, again in zip(residuals, residual_errors(stages, frames_of(), wide, on(6)), strict=True):
        np.testing.assert_array_equal(one, again)
    generator, number = np.random.default_rng([0, 4]), 0
    frame = frames_of().draw(number, generator, whole=True)
    before = sample_miscalibration(RANGES[2], generator) @ frame.camera_from_lidar
    after = stages[0].correct(frame, stages[0].view(frame), before).after
    np.testing.assert_allclose(residuals[0] @ frame.camera_from_lidar, after, atol=1e-9)


def test_what_the_first_look_of_a_stage_leaves_is_for_its_second() -> None:
    frames = frames_of()
    start, wide = stage(2, seed=1, looks=2), MiscalibrationRange(30, 5)
    before = [stage(1, seed=2)]
    alone = residual_errors(before, frames, wide, on(4))
    both = residual_errors(before, frames, wide, on(4), start)
    assert len(both) == 8
    for one, first in zip(alone, both[::2], strict=True):
        np.testing.assert_array_equal(one, first)
    assert all(not np.allclose(first, second) for first, second in zip(both[::2], both[1::2], strict=True))
    of_the_first_stage = residual_errors([], frames, wide, on(4), start)
    assert len(of_the_first_stage) == 4, "without stages before, only what the look leaves: all else is drawn anyway"


def test_lost_frames_are_left_out() -> None:
    assert within(miscalibration([0, 0, 5.9], [1.1, 0, 0]), RANGES[3], RECIPE.draws)
    assert not within(miscalibration([0, 0, 6.1], [0, 0, 0]), RANGES[3], RECIPE.draws)
    assert not within(miscalibration([0, 0, 0], [0, 1.3, 0]), RANGES[3], RECIPE.draws)


def test_stages_before_are_those_of_wider_ranges_that_have_weights(tmp_path: Path) -> None:
    for number in (1, 3, 5):
        network = tiny_network(seed=number, stage=number)
        save_network(weights_path("tiny", RANGES[number - 1], tmp_path), network, network.state_dict(), {})
    before = stages_before("tiny", RANGES[3], tmp_path)
    assert [(stage.number, stage.range) for stage in before] == [(1, RANGES[0]), (3, RANGES[2])]


def test_stages_before_see_the_whole_frame_at_their_own_size() -> None:
    frames = frames_of(magnification=3.0)
    zooming = stage(3, seed=1, image_size=2.0)
    sizes: list[tuple[int, int]] = []
    forward = zooming.network.forward

    def watched(inputs: NetworkInputs, *features: Any, **options: Any) -> NetworkOutput:
        sizes.append((inputs.image.shape[2], inputs.image.shape[3]))
        focal.append(float(inputs.intrinsics[0, 0, 0]) / inputs.image.shape[3])
        return forward(inputs, *features, **options)

    focal: list[float] = []
    zooming.network.forward = watched  # type: ignore[method-assign, assignment]
    residual_errors([zooming], frames, MiscalibrationRange(30, 5), on(4))
    assert all(height * width > 3 * TINY.input_height * TINY.input_width for height, width in sizes)
    wide = [frames.draw(n, np.random.default_rng(n), whole=True) for n in range(20)]
    near = [frames.draw(n, np.random.default_rng(n)) for n in range(20)]
    lens = [[float(f.camera.matrix[0, 0] / f.camera.width) for f in drawn] for drawn in (wide, near)]
    assert np.median(lens[1]) > 1.5 * np.median(lens[0]), "magnified crops show a narrower view"
    assert max(focal) < np.median(lens[1]), "the stages before are not given crops"
