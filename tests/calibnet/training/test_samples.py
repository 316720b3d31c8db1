from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from calibnet.datasets.frame import Frame
from calibnet.errors import DatasetError
from calibnet.geometry import RANGES, invert, miscalibration, project
from calibnet.network.batch import Cut, lidar_input
from calibnet.network.displacement import DisplacementField
from calibnet.network.pose import GeometricHead
from calibnet.network.target import true_displacement
from calibnet.training.data import Source
from calibnet.training.draws import Draws
from calibnet.training.frames import TrainingFrames
from calibnet.training.recipe import RECIPE
from calibnet.training.samples import Sample, TrainingSamples, collate, make_sample, visible_cells
from tests.support.scene import REFERENCE, Scenes, make_frame
from tests.support.tiny import TINY

SCALES = (8, 16, 32)
DELTA = miscalibration([1.0, -2.0, 3.0], [0.2, -0.1, 0.3])


def stream(seed: int = 0, batch: int = 4, warm_up: int = 0, **features: int) -> TrainingSamples:
    recipe = replace(RECIPE, features=replace(RECIPE.features, warm_up=warm_up, **features))
    frames = TrainingFrames([Source(Scenes(), 1.0)], recipe, 96 * 256, batch, seed)
    return TrainingSamples(frames, Draws(RANGES[2], recipe.draws), SCALES)


def same(one: Sample, other: Sample) -> bool:
    return np.array_equal(one.image, other.image) and all(
        np.array_equal(a, b)
        for a, b in zip(
            (one.lidar.image, *one.lidar.cells, one.intrinsics, one.correction, one.shift, *one.visible),
            (other.lidar.image, *other.lidar.cells, other.intrinsics, other.correction, other.shift, *other.visible),
            strict=True,
        )
    )


def lowered(frame: Frame, row: int) -> Frame:
    """The frame with only those points that, miscalibrated by DELTA, fall below a row of its image."""
    projection = project(frame.points, DELTA @ frame.camera_from_lidar, frame.camera)
    return replace(frame, points=frame.points[projection.index[projection.pixels[:, 1] > row]])


def test_a_sample_is_a_function_of_seed_and_number() -> None:
    first, second = stream(), stream()
    forwards = [first[number] for number in range(6)]
    backwards = [second[number] for number in reversed(range(6))][::-1]
    assert all(same(one, other) for one, other in zip(forwards, backwards, strict=True))
    assert not any(same(forwards[0], sample) for sample in (*forwards[1:], stream(seed=1)[0]))


def test_the_correction_undoes_the_miscalibration() -> None:
    frame = make_frame()
    sample = make_sample(frame, DELTA, SCALES, RECIPE.sample)
    np.testing.assert_allclose(sample.correction @ DELTA @ REFERENCE, REFERENCE, atol=1e-6)
    expected = lidar_input(frame.points, DELTA @ REFERENCE, frame.camera, SCALES)
    assert np.array_equal(sample.lidar.image, expected.image)


def test_a_field_that_tells_the_truth_solves_to_the_correction() -> None:
    """Cells, displacements and the solver must mean the same pixels and the same point."""
    inputs, target = collate([make_sample(make_frame(), DELTA, SCALES, RECIPE.sample)])
    truth = true_displacement(inputs.cells[0], target.correction, inputs.intrinsics)
    field = DisplacementField(truth, torch.full_like(truth, -2.0), torch.empty(0))
    estimate = GeometricHead(TINY, RANGES[2])(field, inputs.cells[0], inputs.intrinsics).correction[0]
    np.testing.assert_allclose(estimate.numpy(), target.correction[0].numpy(), atol=2e-3)


def test_the_warm_up_displaces_the_lidar_image() -> None:
    frame, shift = make_frame(), (9.0, -17.0)
    still, displaced = (
        make_sample(frame, DELTA, SCALES, RECIPE.sample),
        make_sample(frame, DELTA, SCALES, RECIPE.sample, shift),
    )
    moved = np.zeros_like(still.lidar.image)
    moved[:, :-17, 9:] = still.lidar.image[:, 17:, :-9]
    common = (slice(None), slice(0, -17), slice(9, None))
    np.testing.assert_allclose(displaced.lidar.image[common], moved[common], atol=1e-4)
    assert np.array_equal(displaced.shift, np.float32(shift)) and not still.shift.any()
    assert np.array_equal(displaced.intrinsics, still.intrinsics)


def test_the_warm_up_and_every_third_batch_are_displaced() -> None:
    samples = stream(batch=2, warm_up=3)
    shifts = [np.abs(samples[number].shift).max() for number in range(12)]
    assert [shift > 0 for shift in shifts] == [True] * 3 + [False, True, True] + [False] * 4 + [True] * 2
    assert [samples.largest_shift(number) for number in (0, 2, 3, 4, 5, 6, 10, 11)] == [40, 40, 0, 24, 24, 0, 24, 24]
    assert all(shift <= samples.largest_shift(number) for number, shift in enumerate(shifts))


def test_a_displaced_batch_trains_features_alone() -> None:
    displaced = make_sample(make_frame(), DELTA, SCALES, RECIPE.sample, (0.0, -3.0))
    still = make_sample(make_frame(), DELTA, SCALES, RECIPE.sample)
    assert [collate(batch)[1].of_features for batch in ([still, still], [still, displaced])] == [False, True]


def test_no_batch_is_displaced_where_features_never_train_alone() -> None:
    samples = stream(every=0)
    assert [samples.largest_shift(number) for number in range(24)] == [0.0] * 24


def test_samples_get_more_varied_in_the_warm_up() -> None:
    samples = stream(warm_up=100)
    assert [samples.variety(number) for number in (0, 50, 75, 100, 500)] == [0.5, 0.5, 0.75, 1.0, 1.0]
    assert stream().variety(0) == 1.0


def test_collated_samples_keep_their_order_and_types() -> None:
    frames = [make_frame(seed, 128, 64) for seed in range(2)]
    samples = [make_sample(frame, DELTA, SCALES, RECIPE.sample) for frame in frames]
    inputs, target = collate(samples)
    assert inputs.image.shape == (2, 3, 64, 128) and inputs.lidar.shape == (2, 2, 64, 128)
    assert [tuple(cells.shape) for cells in inputs.cells] == [(2, 3, 8, 16), (2, 3, 4, 8), (2, 3, 2, 4)]
    assert [tuple(mask.shape) for mask in target.visible] == [(2, 8, 16), (2, 4, 8), (2, 2, 4)]
    assert np.array_equal(inputs.image[1].permute(1, 2, 0).numpy(), frames[1].image)
    assert np.array_equal(inputs.cells[0][1].numpy(), samples[1].lidar.cells[0])


def test_collated_scans_lose_only_the_rows_that_are_empty_in_all() -> None:
    frames = [make_frame(seed, 128, 128) for seed in range(2)]
    samples = [
        make_sample(lowered(frame, row), DELTA, SCALES, RECIPE.sample)
        for frame, row in zip(frames, (100, 70), strict=True)
    ]
    assert [Cut.of([sample.lidar]).rows for sample in samples] == [3, 2]
    inputs, target = collate(samples)
    assert inputs.image.shape == (2, 3, 128, 128) and inputs.lidar.shape == (2, 2, 64, 128)
    for scale, cells, mask, position in zip(SCALES, inputs.cells, target.visible, range(3), strict=True):
        assert cells.shape[2:] == mask.shape[1:] == (64 // scale, 128 // scale)
        for number, sample in enumerate(samples):
            assert np.array_equal(cells[number].numpy(), sample.lidar.cells[position][:, 64 // scale :])
            assert np.array_equal(mask[number].numpy(), sample.visible[position][64 // scale :])


def test_everything_is_visible_from_the_scanner_s_own_place() -> None:
    frame = make_frame()
    for delta in (np.eye(4), DELTA):
        sample = make_sample(frame, delta, SCALES, RECIPE.sample)
        for cells, visible in zip(sample.lidar.cells, sample.visible, strict=True):
            occupied = cells[2] > 0
            assert not (visible & ~occupied).any()
            assert visible.sum() > 0.6 * occupied.sum()


def lidar_point(u: float, v: float, depth: float) -> np.ndarray:
    """The scan's point that the true camera sees at a pixel of `make_frame`."""
    in_camera = depth * (np.linalg.inv(make_frame().camera.matrix) @ [u, v, 1.0])
    return np.append(invert(REFERENCE)[:3] @ np.append(in_camera, 1.0), 0.5).astype(np.float32)


def test_points_behind_others_are_not_visible() -> None:
    camera = make_frame().camera
    hidden, free = lidar_point(120, 40, 30.0), lidar_point(200, 40, 30.0)
    points = np.array([*(lidar_point(u, v, 6.0) for u in range(100, 150, 2) for v in range(20, 70, 2)), hidden, free])
    # from a place further left, parallax takes the hidden point out of the near ones' cells
    delta = miscalibration([0, 0, 6.0], [1.5, 0, 0])
    lidar = lidar_input(points, delta @ REFERENCE, camera, (8,))
    (visible,) = visible_cells(lidar, points, REFERENCE, camera, invert(delta), RECIPE.sample)
    far = lidar.cells[0][2] > 15
    u, v, _ = camera.matrix @ (delta @ REFERENCE @ np.append(free[:3], 1.0))[:3]
    w = (delta @ REFERENCE @ np.append(free[:3], 1.0))[2]
    assert far.sum() == 2
    assert [tuple(cell) for cell in np.argwhere(far & visible)] == [(int((v / w + 0.5) // 8), int((u / w + 0.5) // 8))]


def test_points_outside_the_image_are_not_visible() -> None:
    camera, turned = make_frame().camera, miscalibration([0, 0, 15.0], [0, 0, 0])
    points = lidar_point(20, 40, 30.0)[None]
    lidar = lidar_input(points, REFERENCE, camera, (8,))
    assert (lidar.cells[0][2] > 0).sum() == 1
    assert visible_cells(lidar, points, REFERENCE, camera, np.eye(4), RECIPE.sample)[0].sum() == 1
    assert not visible_cells(lidar, points, invert(turned) @ REFERENCE, camera, invert(turned), RECIPE.sample)[0].any()


def test_nothing_is_visible_where_the_camera_sees_no_point() -> None:
    frame = make_frame()
    behind = replace(frame, camera_from_lidar=miscalibration([0, 0, 180.0], [0, 0, 0]) @ REFERENCE)
    sample = make_sample(behind, miscalibration([0, 0, 180.0], [0, 0, 0]), SCALES, RECIPE.sample)
    assert sample.lidar.cells[0].any(), "under the miscalibration it does"
    assert not any(mask.any() for mask in sample.visible)


def test_frames_that_never_give_a_sample_are_named() -> None:
    samples = stream()
    sequence = samples.frames.sources[0].sequence
    assert isinstance(sequence, Scenes)
    sequence.frames = [replace(frame, points=frame.points[:5]) for frame in sequence.frames]
    with pytest.raises(DatasetError, match=r"None of 100 draws gave 40 cells.*scene"):
        samples[0]


def test_how_many_cells_a_sample_has_at_least_is_the_recipe_s() -> None:
    samples = stream()
    fewest = min(int(samples[number].visible[0].sum()) for number in range(8))
    samples.recipe = replace(samples.recipe, fewest_visible_cells=fewest + 1)
    assert all(samples[number].visible[0].sum() > fewest for number in range(8))
