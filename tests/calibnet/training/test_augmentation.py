"""Every geometric augmentation must leave points on what they were on in the image."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from calibnet.datasets.frame import Frame
from calibnet.geometry import PinholeCamera, project, rotation_from_euler_xyz, transform
from calibnet.training.augmentation import augment, mirror, photometric, thin_scan, virtual_camera
from calibnet.training.recipe import RECIPE
from tests.support.wide import make_wide

WIDTH, HEIGHT = 620, 188
STEP = 100.0  # pixels from black to white


def ramp_frame(seed: int = 0) -> Frame:
    """An image that is its own coordinates: red tells the column, green the row; points all around."""
    generator = np.random.default_rng(seed)
    matrix = np.array([[360.0, 0.0, 305.3], [0.0, 352.0, 86.1], [0.0, 0.0, 1.0]])
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    image = np.stack([triangle(columns), triangle(rows), np.full(rows.shape, 255.0)], axis=-1)
    points = generator.uniform((3, -40, -5, 0), (50, 40, 8, 1), (6000, 4)).astype(np.float32)
    mount = transform(
        rotation_from_euler_xyz([0.02, -0.03, 0.01]) @ np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]]), [0.1, -0.2, -0.3]
    )
    return Frame(0, 0.0, image.round().astype(np.uint8), points, PinholeCamera(WIDTH, HEIGHT, matrix), mount, "ramps")


def triangle(position: NDArray[np.floating]) -> NDArray[np.floating]:
    """0 to 255 and back, so that a byte resolves less than half a pixel."""
    return 255 * np.abs((position / STEP) % 2 - 1)


def sampled(frame: Frame) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Colours ``[M, 3]``, interpolated, at the projections of the points, and the points' rows."""
    seen = project(frame.points, frame.camera_from_lidar, frame.camera)
    column, row = seen.pixels[:, 0], seen.pixels[:, 1]
    inner = (column > 1) & (column < frame.camera.width - 2) & (row > 1) & (row < frame.camera.height - 2)
    column, row, index = column[inner], row[inner], seen.index[inner]
    left, top = np.floor(column).astype(int), np.floor(row).astype(int)
    right, bottom = (column - left)[:, None], (row - top)[:, None]
    image = frame.image.astype(np.float64)
    upper = (1 - right) * image[top, left] + right * image[top, left + 1]
    lower = (1 - right) * image[top + 1, left] + right * image[top + 1, left + 1]
    return (1 - bottom) * upper + bottom * lower, index


def assert_points_stay_on_the_image(before: Frame, after: Frame) -> None:
    """Compare the colours at the points with the columns and rows they had at first."""
    original = project(before.points, before.camera_from_lidar, before.camera)
    place = np.full((len(before.points), 2), np.nan)
    place[original.index] = original.pixels
    colours, index = sampled(after)
    was = place[index]
    # away from the image's edge and from the ramps' turning points, where interpolation looks them off
    smooth = (np.abs((was / STEP + 0.5) % 1 - 0.5) > 0.06).all(axis=1)
    inner = (was > 6).all(axis=1) & (was < [WIDTH - 7, HEIGHT - 7]).all(axis=1) & smooth & (colours[:, 2] > 254)
    assert inner.sum() > 100
    error = (colours[inner, :2] - triangle(was[inner])) * STEP / 255  # pixels of the first image
    assert np.abs(error).max() < 1.0
    slope = np.sign((was[inner] / STEP) % 2 - 1)
    assert np.abs((slope * error).mean(axis=0)).max() < 0.1, "a constant shift, for instance of half a pixel"


def test_the_check_itself_sees_half_a_pixel() -> None:
    frame = ramp_frame()
    assert_points_stay_on_the_image(frame, frame)
    matrix = frame.camera.matrix.copy()
    matrix[0, 2] += 0.3
    with pytest.raises(AssertionError):
        assert_points_stay_on_the_image(frame, replace(frame, camera=PinholeCamera(WIDTH, HEIGHT, matrix)))


def test_mirrored_points_stay_on_the_image() -> None:
    frame = ramp_frame()
    mirrored = mirror(frame)
    assert_points_stay_on_the_image(frame, mirrored)
    assert np.linalg.det(mirrored.camera_from_lidar[:3, :3]) == pytest.approx(1.0)
    twice = mirror(mirrored)
    assert np.array_equal(twice.image, frame.image) and np.array_equal(twice.points, frame.points)
    np.testing.assert_allclose(twice.camera_from_lidar, frame.camera_from_lidar)
    np.testing.assert_allclose(twice.camera.matrix, frame.camera.matrix)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize(("height", "width"), [(160, 512), (224, 384)])
def test_a_turned_camera_with_another_lens_sees_the_points_where_they_were(seed: int, height: int, width: int) -> None:
    frame = ramp_frame(seed)
    turned = virtual_camera(frame, height, width, np.random.default_rng(seed), RECIPE.camera)
    assert turned.image.shape == (height, width, 3)
    assert (turned.camera.height, turned.camera.width) == (height, width)
    assert_points_stay_on_the_image(frame, turned)
    offset = turned.camera_from_lidar[:3, :3].T @ turned.camera_from_lidar[:3, 3]
    np.testing.assert_allclose(offset, frame.camera_from_lidar[:3, :3].T @ frame.camera_from_lidar[:3, 3])


def test_virtual_cameras_vary_lens_and_direction() -> None:
    frame = ramp_frame()
    cameras = [virtual_camera(frame, 160, 512, np.random.default_rng(seed), RECIPE.camera) for seed in range(20)]
    focal = np.array([camera.camera.focal for camera in cameras])
    assert focal[:, 0].max() > 1.3 * focal[:, 0].min()
    assert np.std(focal[:, 0] / focal[:, 1]) > 0.01
    forward = np.array([camera.camera_from_lidar[2, :3] for camera in cameras])
    assert np.degrees(np.arccos(np.clip(forward @ forward[0], -1, 1))).max() > 3


def test_thinning_keeps_points_on_their_rays() -> None:
    points = ramp_frame().points
    kept = [thin_scan(points, np.random.default_rng(seed), RECIPE.scan) for seed in range(20)]
    original = points[:, :3] / np.linalg.norm(points[:, :3], axis=1, keepdims=True)
    for scan in kept[:3]:
        rays = scan[:, :3] / np.linalg.norm(scan[:, :3], axis=1, keepdims=True)
        assert (rays @ original.T).max(axis=1).min() > 1 - 1e-6
    assert min(map(len, kept)) < 0.3 * len(points) and max(map(len, kept)) == len(points)
    intensity = np.concatenate([scan[:, 3] for scan in kept])
    assert intensity.min() >= 0 and intensity.max() <= 1
    assert all(scan.dtype == np.float32 for scan in kept)
    assert np.array_equal(points, ramp_frame().points), "the frame's own scan is left alone"


def test_thinning_takes_an_empty_scan() -> None:
    assert thin_scan(np.zeros((0, 4), np.float32), np.random.default_rng(0), RECIPE.scan).shape == (0, 4)


def test_photometric_changes_colours_only() -> None:
    image = ramp_frame().image
    changed = [photometric(image, np.random.default_rng(seed), RECIPE.picture) for seed in range(12)]
    assert all(other.shape == image.shape and other.dtype == np.uint8 for other in changed)
    for other in changed:  # bright stays bright: neither shifted nor inverted
        assert np.corrcoef(image[..., :2].mean(-1).ravel(), other.mean(-1).ravel())[0, 1] > 0.6
    assert len({other.tobytes() for other in changed}) == len(changed)


def test_augmentation_is_a_function_of_the_generator() -> None:
    frame = ramp_frame()
    one, two, other = (augment(frame, 160, 512, np.random.default_rng(seed), RECIPE) for seed in (1, 1, 2))
    assert np.array_equal(one.image, two.image) and np.array_equal(one.points, two.points)
    assert np.array_equal(one.camera_from_lidar, two.camera_from_lidar)
    assert not np.array_equal(one.image, other.image)


def test_a_magnified_camera_cuts_a_part_and_keeps_points_on_the_image() -> None:
    before = ramp_frame(2)
    for seed in range(4):
        after = virtual_camera(before, 96, 320, np.random.default_rng(seed), RECIPE.camera, magnification=1.6)
        assert_points_stay_on_the_image(before, after)
        assert after.image.shape == (96, 320, 3)


def test_magnifying_stops_at_the_pixels_that_there_are() -> None:
    before = ramp_frame(2)
    native = before.camera.matrix[0, 0] / 0.96
    for seed in range(30):
        after = virtual_camera(before, 160, 512, np.random.default_rng(seed), RECIPE.camera, magnification=5.0)
        enlarged = after.camera.matrix[0, 0] > 1.05 * native
        unmagnified = virtual_camera(before, 160, 512, np.random.default_rng(seed), RECIPE.camera)
        assert not enlarged or after.camera.matrix[0, 0] == unmagnified.camera.matrix[0, 0]


def test_beams_of_a_scanner_elsewhere_cross_those_of_the_true_one() -> None:
    points = np.column_stack([ring(0.0), np.ones(3600)]).astype(np.float32)
    recipe = replace(RECIPE.scan, banded=1.0, thinned=0.0, shortened=0.0, upended=0.0)
    level = replace(recipe, tilt_deg=0.0, apart_m=0.0)
    shares = {"level": [], "tilted": []}
    for seed in range(40):
        for name, of in (("level", level), ("tilted", recipe)):
            kept = thin_scan(points, np.random.default_rng(seed), of)
            shares[name].append(len(kept) / len(points))
    assert set(shares["level"]) == {0.0, 1.0}, "a ring is one beam, kept or not"
    partly = [0.1 < share < 0.9 for share in shares["tilted"]]
    assert sum(partly) > 30, "the beams of a tilted scanner have some points of each"


def ring(elevation_deg: float) -> NDArray[np.float64]:
    """Points all around at one elevation, 20 m away."""
    azimuth = np.linspace(-np.pi, np.pi, 3600, endpoint=False)
    height = np.full(3600, np.tan(np.radians(elevation_deg)))
    return 20 * np.column_stack([np.cos(azimuth), np.sin(azimuth), height])


def test_a_wide_lens_is_augmented_as_the_pinhole_in_its_middle() -> None:
    """Its faces were not mirrored and turned with it, so nobody may look through them."""
    frame = make_wide()
    assert len(frame.faces) == 3 and frame.original is not None
    for seed in range(3):
        after = augment(frame, HEIGHT, WIDTH, np.random.default_rng(seed), RECIPE)
        assert after.faces == () and after.original is None and after.image.shape == (HEIGHT, WIDTH, 3)
