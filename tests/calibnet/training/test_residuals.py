from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibnet.cascade import Stage
from calibnet.geometry import RANGES, MiscalibrationRange, miscalibration, rotation_vector
from calibnet.geometry.types import Transform
from calibnet.network.batch import NetworkInputs
from calibnet.network.network import NetworkOutput
from calibnet.training.residuals import residual_errors, stages_before, within
from calibnet.training.samples import Source, TrainingSamples
from calibnet.weights import save_network, weights_path
from calibnet.weights.manifest import StageSettings
from tests.support.scene import Scenes
from tests.support.tiny import TINY, tiny_network


def stage(number: int, seed: int, **settings: Any) -> Stage:
    return Stage(number, RANGES[number - 1], tiny_network(seed=seed, stage=number), StageSettings(**settings))


@pytest.fixture
def data() -> TrainingSamples:
    return TrainingSamples([Source(Scenes(), 1.0)], RANGES[3], TINY.scales, TINY.input_height * TINY.input_width, 2, 0)


def test_residuals_are_what_the_stages_leave_and_four_of_ten_that_are_drawn(data: TrainingSamples) -> None:
    stages = [stage(3, seed=1)]
    wide = MiscalibrationRange(30, 5)
    data.residuals = residual_errors(stages, data, wide, 6)
    assert len(data.residuals) == 6
    for one, again in zip(data.residuals, residual_errors(stages, data, wide, 6), strict=True):
        np.testing.assert_array_equal(one, again)
    generator = np.random.default_rng(0)
    drawn = [data.draw(generator) for _ in range(400)]
    stretches = [stretch for delta in drawn for residual in data.residuals if (stretch := stretched(delta, residual))]
    assert 0.3 < len(stretches) / len(drawn) < 0.5
    assert 0.7 <= min(stretches) < 0.8, "frames never trained on leave more behind than those measured"
    assert 1.7 < max(stretches) <= 1.8


def test_what_the_first_look_of_a_stage_leaves_is_for_its_second(data: TrainingSamples) -> None:
    start, wide = stage(2, seed=1, looks=2), MiscalibrationRange(30, 5)
    before = [stage(1, seed=2)]
    alone = residual_errors(before, data, wide, 4)
    both = residual_errors(before, data, wide, 4, start)
    assert len(both) == 8
    for one, first in zip(alone, both[::2], strict=True):
        np.testing.assert_array_equal(one, first)
    assert all(not np.allclose(first, second) for first, second in zip(both[::2], both[1::2], strict=True))
    of_the_first_stage = residual_errors([], data, wide, 4, start)
    assert len(of_the_first_stage) == 4, "without stages before, only what the look leaves: all else is drawn anyway"


def stretched(delta: Transform, residual: Transform) -> float | None:
    """How many times as far ``delta`` turns and moves as ``residual``, None if not about the same axes."""
    factors = np.concatenate(
        [
            rotation_vector(delta[:3, :3]) / rotation_vector(residual[:3, :3]),
            delta[:3, 3] / residual[:3, 3],
        ]
    )
    return float(factors[0]) if np.ptp(factors) < 1e-6 else None


def test_lost_frames_are_left_out() -> None:
    assert within(miscalibration([0, 0, 5.9], [1.1, 0, 0]), RANGES[3])
    assert not within(miscalibration([0, 0, 6.1], [0, 0, 0]), RANGES[3])
    assert not within(miscalibration([0, 0, 0], [0, 1.3, 0]), RANGES[3])


def test_stages_before_are_those_of_wider_ranges_that_have_weights(tmp_path: Path) -> None:
    for number in (1, 3, 5):
        network = tiny_network(seed=number, stage=number)
        save_network(weights_path("tiny", RANGES[number - 1], tmp_path), network, network.state_dict(), {})
    before = stages_before("tiny", RANGES[3], tmp_path)
    assert [(stage.number, stage.range) for stage in before] == [(1, RANGES[0]), (3, RANGES[2])]


def test_stages_before_see_the_whole_frame_at_their_own_size(data: TrainingSamples) -> None:
    data.magnification = 3.0
    zooming = stage(3, seed=1, image_size=2.0)
    sizes: list[tuple[int, int]] = []
    forward = zooming.network.forward

    def watched(inputs: NetworkInputs, *features: Any, **options: Any) -> NetworkOutput:
        sizes.append((inputs.image.shape[2], inputs.image.shape[3]))
        focal.append(float(inputs.intrinsics[0, 0, 0]) / inputs.image.shape[3])
        return forward(inputs, *features, **options)

    focal: list[float] = []
    zooming.network.forward = watched  # type: ignore[method-assign, assignment]
    residual_errors([zooming], data, MiscalibrationRange(30, 5), 4)
    assert all(height * width > 3 * TINY.input_height * TINY.input_width for height, width in sizes)
    wide = [data.draw_frame(n, np.random.default_rng(n), 1.0, whole=True) for n in range(20)]
    near = [data.draw_frame(n, np.random.default_rng(n), 1.0) for n in range(20)]
    lens = [[float(f.camera.matrix[0, 0] / f.camera.width) for f in frames] for frames in (wide, near)]
    assert np.median(lens[1]) > 1.5 * np.median(lens[0]), "magnified cuttings show a narrower view"
    assert max(focal) < np.median(lens[1]), "the stages before are not given cuttings"
