from __future__ import annotations

import numpy as np
import pytest
import torch

from calibnet.datasets.images.files import resize_image
from calibnet.geometry import PinholeCamera, project, transform
from calibnet.network.batch import Cut, lidar_input, make_batch

CAMERA_FROM_LIDAR = transform([[0, -1, 0], [0, 0, -1], [1, 0, 0]], [0.05, -0.1, -0.2])


def camera(width: int, height: int) -> PinholeCamera:
    return PinholeCamera(
        width, height, np.array([[0.6 * width, 0, 0.49 * width], [0, 0.62 * width, 0.52 * height], [0, 0, 1]])
    )


def scan(count: int, seed: int = 0) -> np.ndarray:
    generator = np.random.default_rng(seed)
    points = generator.uniform((-10, -12, -4, 0), (40, 12, 4, 1), (count, 4))
    return points.astype(np.float32)


@pytest.mark.parametrize(
    ("width", "height"), [(1242, 375), (1226, 370), (1600, 900), (640, 480), (480, 1240), (64, 64)]
)
def test_input_keeps_aspect_area_and_whole_cells(width: int, height: int) -> None:
    resized = camera(width, height).fitted(160, 512, 32)
    assert resized.width % 32 == 0 and resized.height % 32 == 0
    assert resized.width * resized.height == pytest.approx(160 * 512, rel=0.2)
    assert resized.width / resized.height == pytest.approx(width / height, rel=0.2)


def test_extreme_aspects_keep_at_least_one_coarse_cell() -> None:
    resized = camera(4000, 20).fitted(64, 128, 32)
    assert (resized.height, resized.width % 32) == (32, 0)


@pytest.mark.parametrize(("width", "height"), [(1242, 375), (200, 90)])
def test_resized_image_and_camera_agree(width: int, height: int) -> None:
    """A bright spot at a point's projection is at the point's projection after resizing."""
    original = camera(width, height)
    resized = original.fitted(160, 512, 32)
    points = np.array([[12.0, 2.0, 0.7, 0.0]], np.float32)
    u, v = project(points, CAMERA_FROM_LIDAR, original).pixels[0]
    rows, columns = np.mgrid[:height, :width]
    blob = 255 * np.exp(-((columns - u) ** 2 + (rows - v) ** 2) / (2 * 4.0**2))
    image = resize_image(np.repeat(blob[..., None], 3, axis=2).astype(np.uint8), resized)
    assert image.shape == (resized.height, resized.width, 3)
    weight = image[..., 0].astype(float)
    rows, columns = np.mgrid[: resized.height, : resized.width]
    centroid = (columns * weight).sum() / weight.sum(), (rows * weight).sum() / weight.sum()
    assert centroid == pytest.approx(project(points, CAMERA_FROM_LIDAR, resized).pixels[0], abs=0.06)


@pytest.mark.parametrize("scales", [(8, 16, 32), (8,)])
def test_cells_hold_their_nearest_point(scales: tuple[int, ...]) -> None:
    points, view = scan(1500), camera(128, 64)
    lidar = lidar_input(points, CAMERA_FROM_LIDAR, view, scales)
    assert lidar.image.shape == (2, 64, 128)
    for scale, cells in zip((1, *scales), (None, *lidar.cells), strict=True):
        nearest: dict[tuple[int, int], tuple[float, np.ndarray, float]] = {}
        for x, y, z, intensity in points:
            in_camera = CAMERA_FROM_LIDAR[:3, :3] @ [x, y, z] + CAMERA_FROM_LIDAR[:3, 3]
            if in_camera[2] <= 0.5:
                continue
            u, v, _ = view.matrix @ in_camera / in_camera[2]
            if -0.5 < u < 127.5 and -0.5 < v < 63.5:
                key = int((v + 0.5) // scale), int((u + 0.5) // scale)
                if key not in nearest or in_camera[2] < nearest[key][0]:
                    nearest[key] = in_camera[2], in_camera, intensity
        assert len(nearest) > 20 or scale > 8
        for row in range(64 // scale):
            for column in range(128 // scale):
                depth, in_camera, intensity = nearest.get((row, column), (0.0, np.zeros(3), 0.0))
                if cells is None:
                    assert lidar.image[:, row, column] == pytest.approx([depth, intensity], rel=1e-5)
                else:
                    assert cells[:, row, column] == pytest.approx(in_camera, rel=1e-4, abs=1e-5)


def test_no_point_in_view_gives_empty_inputs() -> None:
    behind = scan(50) * np.array([-1, 1, 1, 1], np.float32) - np.array([50, 0, 0, 0], np.float32)
    for points in (behind, np.zeros((0, 4), np.float32)):
        lidar = lidar_input(points, CAMERA_FROM_LIDAR, camera(64, 32), (8, 16, 32))
        assert not lidar.image.any() and not any(cells.any() for cells in lidar.cells)
        assert lidar.image.dtype == np.float32 and all(cells.dtype == np.float32 for cells in lidar.cells)


def test_rows_above_the_scan_are_left_out_and_put_back() -> None:
    points, view = scan(3000), camera(128, 128)
    whole = lidar_input(points, CAMERA_FROM_LIDAR, view, (8, 16, 32))
    assert Cut.of([whole]) == (0, 4)
    low = points[project(points, CAMERA_FROM_LIDAR, view).index]
    pixel = project(low, CAMERA_FROM_LIDAR, view)
    low = low[pixel.index[pixel.pixels[:, 1] > 70]]
    scanned = lidar_input(low, CAMERA_FROM_LIDAR, view, (8, 16, 32))
    assert Cut.of([whole, scanned]) == (0, 4), "nothing is lost of any scan of a batch"
    cut = Cut.of([scanned])
    assert cut == (2, 4), "of four rows of 32 pixels, those above pixel 64"
    batch = make_batch(torch.zeros(1, 3, 128, 128), [scanned], [view.matrix])
    np.testing.assert_array_equal(batch.lidar[0].numpy(), scanned.image[:, 64:])
    for scale, cells, rest in zip((8, 16, 32), scanned.cells, batch.cells, strict=True):
        np.testing.assert_array_equal(rest[0].numpy(), cells[:, 64 // scale :])
        np.testing.assert_array_equal(cut.undo(rest[0]).numpy(), cells)


def test_a_scan_out_of_view_keeps_a_row() -> None:
    empty = lidar_input(np.zeros((0, 4), np.float32), CAMERA_FROM_LIDAR, camera(128, 128), (8, 16, 32))
    cut = Cut.of([empty])
    assert cut == (3, 4) and cut.apply(empty.cells[-1]).shape == (3, 1, 4)
