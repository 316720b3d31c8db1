"""Batches made on a device: the samples of the NumPy path, drawn alike."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors.torch import load_file

from calibnet.errors import ConfigError, DatasetError
from calibnet.geometry import RANGES, range_of
from calibnet.training.augmentation_recipe import CameraRecipe
from calibnet.training.data import Source
from calibnet.training.draws import Draws
from calibnet.training.frames import TrainingFrames
from calibnet.training.on_device import store as store_module
from calibnet.training.on_device.batches import Batch, DeviceSamples, good_ones
from calibnet.training.on_device.store import FrameStore
from calibnet.training.recipe import RECIPE, Recipe
from calibnet.training.samples import TrainingSamples, collate
from tests.calibnet.training.test_augmentation import HEIGHT, STEP, WIDTH, ramp_frame, triangle
from tests.calibnet.training.tiny_run import options, trainer_of
from tests.support.scene import Scenes, make_frame

SCALES = (8, 16, 32)
CPU = torch.device("cpu")
PLAIN = replace(
    RECIPE,
    scan=replace(RECIPE.scan, thinned=0.0, range_noise=0.0),  # all that a generator draws for single points
    picture=replace(RECIPE.picture, noisy=0.0),
)


def streams(
    scenes: Scenes, recipe: Recipe = PLAIN, batch: int = 4, warm_up: int = 0
) -> tuple[TrainingSamples, DeviceSamples]:
    """The same samples by NumPy and as tensor code."""
    recipe = replace(recipe, features=replace(recipe.features, warm_up=warm_up))
    sources = [Source(scenes, 0.7), Source(Scenes(2), 0.3, synthetic=True)]
    frames = TrainingFrames(sources, recipe, 96 * 256, batch, seed=3, magnification=1.4)
    samples = TrainingSamples(frames, Draws(RANGES[2], recipe.draws), SCALES)
    return samples, DeviceSamples(samples, FrameStore.load(sources, CPU))


def batches(samples: DeviceSamples, first: int = 0, batch: int = 4) -> Iterator[Batch]:
    numbers = iter(range(first, 10**6))
    drawn = samples.drawn
    return samples.made(drawn.collate([drawn[number * batch + n] for n in range(batch)]) for number in numbers)


def test_samples_are_those_of_numpy() -> None:
    by_numpy, on_device = streams(Scenes())
    for number, (inputs, target) in zip(range(6), batches(on_device), strict=False):
        expected, truth = collate([by_numpy[4 * number + n] for n in range(4)])
        assert inputs.image.shape == expected.image.shape and inputs.image.dtype == torch.uint8
        assert inputs.lidar.shape == expected.lidar.shape, "the same rows are cut"
        assert target.of_features == truth.of_features == (number % 3 == 2)
        for ours, theirs in ((inputs.intrinsics, expected.intrinsics), (target[0], truth[0]), (target[1], truth[1])):
            torch.testing.assert_close(ours, theirs, rtol=1e-5, atol=1e-5)
        for ours, theirs in zip((inputs.lidar, *inputs.cells), (expected.lidar, *expected.cells), strict=True):
            assert ((ours - theirs).abs() > 1e-3).any(1).float().mean() < 0.01
        for ours, theirs in zip(target.visible, truth.visible, strict=True):
            assert (ours != theirs).float().mean() < 0.01 < theirs.float().mean()
        off = (inputs.image.float() - expected.image.float()).abs()
        assert off.mean() < 5 and off.flatten().quantile(0.5) <= 2, "boxes' edges are averaged in another way"


class Ramps(Scenes):
    """Frames whose images are their own coordinates."""

    def __init__(self) -> None:
        super().__init__(0)
        self.frames = [ramp_frame(seed) for seed in range(3)]


@pytest.mark.parametrize("zoom", [(0.85, 1.5), (0.3, 0.5)])
def test_points_stay_on_the_image(zoom: tuple[float, float]) -> None:
    """Where a pixel is on its ramp tells which one of the stored image it shows; a tenth of a pixel matters."""
    recipe = replace(PLAIN, camera=CameraRecipe(zoom=zoom))
    _, samples = streams(Ramps(), recipe)
    drawn = samples.drawn
    shift = []
    for number in range(24):
        if (draw := drawn[number]).frame >= 3:
            continue
        draw = replace(draw, exposure=type(draw.exposure)())
        whole = samples.make(drawn.collate([draw]))
        image = whole.image[0].permute(1, 2, 0).double().numpy()
        rows, columns = np.mgrid[: image.shape[0], : image.shape[1]]
        u, v, scale = draw.to_image @ np.stack([columns.ravel(), rows.ravel(), np.ones(rows.size)])
        place = np.stack([u / scale, v / scale], axis=1)
        smooth = (np.abs((place / STEP + 0.5) % 1 - 0.5) > 0.08).all(axis=1)
        inner = (place > 6).all(axis=1) & (place < [WIDTH - 7, HEIGHT - 7]).all(axis=1) & smooth
        error = (image.reshape(-1, 3)[inner, :2] - triangle(place[inner])) * STEP / 255
        assert inner.sum() > 100 and np.abs(error).max() < 1.5
        shift.append((np.sign((place[inner] / STEP) % 2 - 1) * error).mean(axis=0))
    assert len(shift) > 8 and np.abs(shift).max() < 0.2, "half a grey value, where all pixels are rounded alike"
    assert np.abs(np.mean(shift, axis=0)).max() < 0.03


def test_a_batch_depends_on_seed_and_number_alone() -> None:
    _, samples = streams(Scenes(), RECIPE)
    first, second, third = (batch for _, batch in zip(range(3), batches(samples), strict=False))
    (again,) = (batch for _, batch in zip(range(1), batches(samples, first=1), strict=False))
    assert torch.equal(second[0].image, again[0].image) and torch.equal(second[0].lidar, again[0].lidar)
    for other in (first, third):
        assert other[0].lidar.shape != again[0].lidar.shape or not torch.equal(other[0].lidar, again[0].lidar)


def test_miscalibrations_are_drawn_as_ever() -> None:
    by_numpy, samples = streams(Scenes())
    deltas = [samples.drawn[number].delta for number in range(300)]
    generator = np.random.default_rng(0)
    expected = [by_numpy.draws.draw(generator) for _ in range(300)]
    for of in ("rotation_deg", "translation_m"):
        ours, theirs = (
            np.quantile([getattr(range_of(d), of) for d in some], (0.1, 0.5, 0.9)) for some in (deltas, expected)
        )
        np.testing.assert_allclose(ours, theirs, rtol=0.2, atol=0.05 * theirs.max())


def test_a_sample_without_points_is_replaced_by_another_of_its_batch() -> None:
    assert good_ones(torch.tensor([True, False, True, False, False])).tolist()[::2] == [0, 2, 0]
    chosen = good_ones(torch.tensor([False, False, True, True]))
    assert set(chosen.tolist()) == {2, 3} and chosen.tolist()[2:] == [2, 3]


def test_a_bad_scan_never_reaches_a_batch() -> None:
    scenes = Scenes(2)
    scenes.frames[1] = replace(make_frame(1), points=make_frame(1).points[:5])
    _, samples = streams(scenes)
    bad = [n for n in range(40) if samples.drawn[n].frame == 1]
    assert bad
    for _, (_, target) in zip(range(10), batches(samples), strict=False):
        assert (target.visible[0].flatten(1).sum(1) >= RECIPE.sample.fewest_visible_cells).all()


def test_frames_whose_calibration_is_wrong_are_one_sentence() -> None:
    behind = np.diag([-1.0, -1, 1, 1])

    class Wrong(Scenes):
        def __init__(self) -> None:
            super().__init__(2)
            self.frames = [replace(f, camera_from_lidar=f.camera_from_lidar @ behind) for f in self.frames]

    recipe, sources = PLAIN, [Source(Wrong(), 1.0)]
    frames = TrainingFrames(sources, recipe, 96 * 256, 4, seed=0)
    samples = TrainingSamples(frames, Draws(RANGES[2], recipe.draws), SCALES)
    with pytest.raises(DatasetError, match="calibration fits its scans"):
        next(batches(DeviceSamples(samples, FrameStore.load(sources, CPU))))


def test_more_frames_than_a_device_holds_are_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store_module, "LARGEST_BYTES", 1000)
    with pytest.raises(ConfigError, match="without --on-device"):
        FrameStore.load([Source(Scenes(), 1.0)], CPU)


def test_frames_are_read_only_until_they_are_too_many(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is read would fill the host's memory before it is refused."""

    class OneByOne:
        def __init__(self, count: int | None) -> None: ...

        map = staticmethod(map)

        def shutdown(self, cancel_futures: bool) -> None: ...

    scenes = Scenes(30)
    monkeypatch.setattr(store_module, "ThreadPoolExecutor", OneByOne)
    monkeypatch.setattr(store_module, "LARGEST_BYTES", 1000)
    with pytest.raises(ConfigError, match="The 30 training frames would take"):
        FrameStore.load([Source(scenes, 1.0)], CPU)
    assert scenes.reads == 1


def test_a_run_on_device_resumes_to_the_very_same_weights(tiny_world: Scenes, tmp_path: Path) -> None:
    def run(folder: str, **changes: Any) -> dict[str, torch.Tensor]:
        return load_file(trainer_of(options(tmp_path / folder, on_device=True, **changes), resume=True).run())

    whole = run("whole", batches=4)
    trainer = trainer_of(options(tmp_path / "halves", batches=4, on_device=True))
    step = trainer._step

    def two_steps(*batch: Any) -> Any:
        if trainer.steps == 2:
            raise KeyboardInterrupt
        return step(*batch)

    trainer._step = two_steps  # type: ignore[method-assign]
    with pytest.raises(KeyboardInterrupt):
        trainer.run()
    trainer._save_checkpoint()
    halves = run("halves", batches=4)
    assert halves.keys() == whole.keys() and all(torch.equal(halves[name], whole[name]) for name in whole)


def test_draws_may_come_from_another_process(tiny_world: Scenes, tmp_path: Path) -> None:
    alone, helped = (
        load_file(trainer_of(options(tmp_path / str(workers), on_device=True, workers=workers)).run())
        for workers in (0, 1)
    )
    assert all(torch.equal(alone[name], helped[name]) for name in alone)
