from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibnet.training.data import Source
from calibnet.training.frames import TrainingFrames
from calibnet.training.recipe import RECIPE
from tests.support.scene import Scenes

AREA = 96 * 256


def frames_of(*sources: Source, batch: int = 4) -> TrainingFrames:
    return TrainingFrames(sources, RECIPE, AREA, batch, seed=0)


def draw(frames: TrainingFrames, count: int, variety: float = 1.0) -> None:
    for number in range(count):
        frames.draw(number, np.random.default_rng(number), variety)


def test_a_batch_has_one_size_and_batches_differ() -> None:
    frames = frames_of(Source(Scenes(), 1.0), batch=2)
    drawn = [frames.draw(number, np.random.default_rng(number)).image.shape[:2] for number in range(24)]
    sizes = list(zip(drawn[::2], drawn[1::2], strict=True))
    assert all(one == other for one, other in sizes)
    assert {size for size, _ in sizes} == set(frames.sizes) and len(frames.sizes) == 3
    assert all(side % 32 == 0 for size in frames.sizes for side in size)
    areas = [height * width for height, width in frames.sizes]
    assert areas == pytest.approx([AREA] * 3, rel=0.3), "whole numbers of the coarsest cells"


def test_sources_are_drawn_by_their_weight() -> None:
    often, seldom = Scenes(1), Scenes(1)
    draw(frames_of(Source(often, 3.0, synthetic=True), Source(seldom, 1.0, synthetic=True)), 60)
    assert 1.7 < often.reads / seldom.reads < 6.0


def test_real_frames_are_read_once_and_synthetic_ones_left_on_disk() -> None:
    real, synthetic = Scenes(2), Scenes(2)
    draw(frames_of(Source(real, 1.0)), 12)
    draw(frames_of(Source(synthetic, 1.0, synthetic=True)), 12)
    assert (real.reads, synthetic.reads) == (2, 12)


def test_the_synthetic_world_comes_in_with_the_variety_but_for_when_it_is_all_there_is() -> None:
    real, synthetic = Scenes(1), Scenes(1)
    world = Source(synthetic, 0.5, synthetic=True)
    draw(frames_of(Source(real, 0.5), world), 40, variety=0.0)
    assert synthetic.reads == 0
    draw(frames_of(Source(real, 0.5), world), 40)
    assert 10 < synthetic.reads < 30
    draw(frames_of(world), 5, variety=0.0)
    assert synthetic.reads > 14


def test_magnified_frames_are_cuttings_unless_they_are_asked_for_whole() -> None:
    frames = TrainingFrames([Source(Scenes(), 1.0)], RECIPE, AREA / 4, 4, 0, magnification=3.0)

    def focal(whole: bool) -> float:
        drawn = [frames.draw(n, np.random.default_rng(n), whole=whole) for n in range(20)]
        return float(np.median([frame.camera.matrix[0, 0] / frame.camera.width for frame in drawn]))

    assert focal(whole=False) > 1.5 * focal(whole=True)


def test_other_sizes_are_a_matter_of_the_recipe() -> None:
    recipe = replace(RECIPE, sample=replace(RECIPE.sample, sizes=((64, 64),), size_shares=(1.0,)))
    frames = TrainingFrames([Source(Scenes(), 1.0)], recipe, 128 * 128, 4, 0)
    assert frames.draw(7, np.random.default_rng(0)).image.shape == (128, 128, 3)
