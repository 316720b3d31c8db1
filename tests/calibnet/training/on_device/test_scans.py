"""Projection, z-buffer and labels of a batch are those that NumPy makes of each of its samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import Tensor

from calibnet.datasets.frame import Frame
from calibnet.geometry import invert, miscalibration, project
from calibnet.geometry.projection import nearest_per_cell
from calibnet.geometry.types import Transform
from calibnet.training.augmentation import elevation_for_another
from calibnet.training.augmentation_draws import Scanner
from calibnet.training.on_device.draws import Scanners, single
from calibnet.training.on_device.scans import EMPTY, LOW, Cells, Scans, coarser, nearest, rescanned, see
from calibnet.training.recipe import RECIPE
from calibnet.training.samples import make_sample
from tests.support.scene import make_frame

SCALES = (8, 16, 32)
WIDTH, HEIGHT = 256, 96


def scans_of(*frames: Frame) -> Scans:
    """A batch of scans of any lengths."""
    most = max(len(frame.points) for frame in frames)
    padded = np.zeros((len(frames), most, 4), np.float32)
    for row, frame in zip(padded, frames, strict=True):
        row[: len(frame.points)] = frame.points
    there = torch.arange(most) < torch.tensor([len(frame.points) for frame in frames])[:, None]
    x, y, z, intensity = torch.from_numpy(padded).unbind(2)
    return Scans(x, y, z, intensity, there)


def seen(frames: list[Frame], deltas: list[Transform], shift: tuple[float, float] = (0.0, 0.0)) -> Cells:
    return see(
        scans_of(*frames),
        single([delta @ frame.camera_from_lidar for delta, frame in zip(deltas, frames, strict=True)]),
        single([frame.camera_from_lidar for frame in frames]),
        single([invert(delta) for delta in deltas]),
        single([frame.camera.matrix for frame in frames]),
        single([shift] * len(frames)),
        (HEIGHT, WIDTH),
        SCALES,
        RECIPE.sample,
    )


def off_the_pixels(frame: Frame, generator: np.random.Generator) -> Frame:
    """The frame with points that are not, all of them, seen in the very middle of pixels."""
    return replace(frame, points=frame.points + generator.uniform(0, 0.02, frame.points.shape).astype(np.float32))


@pytest.mark.parametrize("shift", [(0.0, 0.0), (9.3, -17.8)])
def test_a_batch_is_what_numpy_makes_of_each_sample(shift: tuple[float, float]) -> None:
    generator = np.random.default_rng(3)
    frames = [off_the_pixels(make_frame(seed, WIDTH, HEIGHT, n), generator) for seed, n in enumerate((5000, 900, 3000))]
    deltas = [miscalibration(generator.uniform(-9, 9, 3), generator.uniform(-0.9, 0.9, 3)) for _ in frames]
    batch = seen(frames, deltas, shift)
    for number, (frame, delta) in enumerate(zip(frames, deltas, strict=True)):
        sample = make_sample(frame, delta, SCALES, RECIPE.sample, shift)
        assert_alike(batch.image[number], sample.lidar.image)
        for cells, expected in zip(batch.cells, sample.lidar.cells, strict=True):
            assert_alike(cells[number], expected)
        assert sample.visible[0].any() and not sample.visible[0].all()
        for visible, mask in zip(batch.visible, sample.visible, strict=True):
            assert (visible[number].numpy() != mask).sum() <= 2, "points on the very edge of the image"


def assert_alike(made: Tensor, expected: np.ndarray) -> None:
    """Equal, but for the cells of a point whose pixel was rounded to the next one."""
    off = (np.abs(made.numpy() - expected) > 1e-4).any(0)
    assert off.mean() < 0.002
    assert (expected != 0).any(0).mean() > 0.02


def test_the_nearest_point_wins_and_the_last_one_of_equals() -> None:
    points = np.array([[0, 0, 9], [0, 0, 4], [0, 0, 4], [0, 0, 5], [0, 0, 0.4]], np.float32)
    frame = replace(make_frame(), points=np.pad(points, ((0, 0), (0, 1))), camera_from_lidar=np.eye(4))
    keys = nearest(scans_of(frame), single(frame.camera.matrix)[None], HEIGHT, WIDTH)
    (row,), (column,) = np.nonzero((keys[0] != EMPTY).numpy())
    assert (row, column) == (round(frame.camera.center[1]), round(frame.camera.center[0]))
    assert len(points) - 1 - int(keys[0, row, column] & LOW) == 2
    expected = nearest_per_cell(project(frame.points, np.eye(4), frame.camera), frame.camera)
    assert expected[row, column] == 2


def test_coarser_cells_are_those_of_their_own_z_buffer() -> None:
    frame = make_frame(4)
    keys = nearest(
        scans_of(frame).moved(single(frame.camera_from_lidar)[None]), single(frame.camera.matrix)[None], 96, 256
    )
    projection = project(frame.points, frame.camera_from_lidar, frame.camera)
    for stride in (1, 4, 8, 32):
        winner = nearest_per_cell(projection, frame.camera, stride)
        index = np.append(projection.index, -1)[winner]
        coarse = coarser(keys, stride)[0]
        ours = torch.where(coarse == EMPTY, -1, len(frame.points) - 1 - (coarse & LOW)).numpy()
        assert (ours != index).mean() < 0.005


def test_points_that_are_none_and_points_behind_are_never_seen() -> None:
    frame = make_frame(points=200)
    turned = miscalibration([0, 0, 180], [0, 0, 0])
    assert not seen([frame], [turned]).image.any()
    longer = make_frame(1, points=3000)
    alone, beside = seen([frame], [np.eye(4)]), seen([frame, longer], [np.eye(4)] * 2)
    assert torch.equal(alone.image[0], beside.image[0]), "what pads a scan is no point at the scanner's place"


BANDED = Scanner(
    turn=np.array([[0.995, 0, 0.0998], [0, 1, 0], [-0.0998, 0, 0.995]]),
    place=np.array([0.2, -0.4, 0.1]),
    band_rad=0.008,
    period=3,
    phase=2,
)


def rescan(frame: Frame, *scanners: Scanner) -> Scans:
    scans = scans_of(*[frame] * len(scanners))
    return rescanned(scans, Scanners.of(scanners), torch.Generator().manual_seed(1))


def test_a_scanner_that_changes_nothing_changes_nothing() -> None:
    frame = make_frame()
    for ours, theirs in zip(rescan(frame, Scanner()), scans_of(frame), strict=True):
        assert torch.equal(ours, theirs)


def test_bands_reach_and_share_keep_the_points_that_they_keep_in_numpy() -> None:
    frame = make_frame()
    near = Scanner(reach_m=20.0)
    banded, short, few, none = rescan(frame, BANDED, near, Scanner(kept=0.3), Scanner(kept=0.0)).there.numpy()
    elevation = elevation_for_another(frame.points, BANDED)
    expected = np.floor(elevation / BANDED.band_rad).astype(int) % 3 == 2
    assert (banded != expected).mean() < 0.002 and 0.2 < banded.mean() < 0.45
    assert np.array_equal(short, np.linalg.norm(frame.points[:, :3], axis=1) < 20.0) and 0 < short.mean() < 1
    assert abs(few.mean() - 0.3) < 0.03 and not none.any()


def test_noise_moves_points_along_their_rays_and_intensity_answers() -> None:
    frame = make_frame()
    scans = rescan(frame, Scanner(range_noise=0.01), Scanner(response=1.5, gamma=0.7), Scanner(response=0.0, gamma=1.2))
    moved = torch.stack(scans[:3], dim=2).numpy()[0]
    ratio = moved / frame.points[:, :3]
    np.testing.assert_allclose(ratio - ratio[:, :1], 0, atol=1e-4)
    assert abs(ratio[:, 0].std() - 0.01) < 1e-3 and abs(ratio.mean() - 1) < 1e-3
    np.testing.assert_allclose(scans.intensity[1], np.clip(1.5 * frame.points[:, 3] ** 0.7, 0, 1), rtol=1e-5)
    assert not scans.intensity[2].any()
