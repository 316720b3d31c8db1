"""The parts that pictures are made of: overlays, colours, channel grids, the chosen cell."""

from __future__ import annotations

import io
from types import ModuleType

import numpy as np
from PIL import Image

from inspector.channel_grid import channel_grid, channel_grid_png
from inspector.colors import EMPTY, depth_colors, flow_colors
from inspector.matches import chosen_match
from inspector.observation import Observation
from inspector.overlay import Thinning, make_overlay


def test_near_is_red_and_far_is_blue() -> None:
    near, far = depth_colors(np.array([2.0, 100.0], dtype=np.float32)).astype(int)
    assert near[0] > near[2] + 50
    assert far[2] > far[0] + 50


def test_flow_colors_tell_directions_apart_and_leave_zero_white() -> None:
    right, down, left, none = flow_colors(np.array([[1.0, 0], [0, 1], [-1, 0], [0, 0]]), reach=1.0).astype(int)
    assert tuple(right) == (255, 0, 0)
    assert down[1] == 255 and down[2] == 0
    assert tuple(left) == (0, 255, 255)
    assert tuple(none) == (255, 255, 255)
    assert EMPTY not in {tuple(color) for color in (right, down, left, none)}


def test_overlay_keeps_the_nearest_point_of_each_cell_and_draws_it_last(fakes: ModuleType) -> None:
    frame = fakes.make_frame(0)
    overlay = make_overlay(frame, frame.camera_from_lidar, Thinning(cells_across=40, pixel=0.25))
    in_camera = frame.points[:, :3] @ frame.camera_from_lidar[:3, :3].T + frame.camera_from_lidar[:3, 3]
    pixels = in_camera @ frame.camera.matrix.T
    pixels = pixels[:, :2] / pixels[:, 2:]
    depths = []
    for u, v in overlay.pixels:
        distance = np.hypot(*(pixels - (u, v)).T)
        distance[in_camera[:, 2] < 0.5] = np.inf
        assert distance.min() <= 0.25  # a real point, to the grid's rounding
        same_cell = (np.floor((pixels + 0.5) / 10) == np.floor((pixels[distance.argmin()] + 0.5) / 10)).all(axis=1)
        depth = in_camera[distance.argmin(), 2]
        assert depth <= in_camera[same_cell & (in_camera[:, 2] > 0.5), 2].min() + 1e-3
        depths.append(depth)
    assert np.all(np.diff(depths) <= 1e-6)
    assert len(overlay.pixels) > 100


def test_channel_grid_shows_the_liveliest_first_and_survives_flat_ones() -> None:
    maps = np.zeros((20, 3, 5), dtype=np.float16)
    maps[7, 0, 0] = 9.0
    maps[12, 2, 4] = 4.0
    grid = channel_grid(maps)
    assert grid.shape == (4 * 4 - 1, 4 * 6 - 1)
    assert grid[0, 0] == 255 and grid[2, 6 + 4] == 255
    assert (grid > 0).sum() == 2
    decoded = Image.open(io.BytesIO(channel_grid_png(maps)))
    assert decoded.size == (23, 15)


def test_chosen_cell_is_occupied_and_its_true_displacement_is_the_fields(fakes: ModuleType) -> None:
    frame = fakes.make_frame(0)
    trace = fakes.FakeCascade().calibrate(frame, fakes.DELTA @ frame.camera_from_lidar)
    stage = trace.stages[0]
    match = chosen_match(Observation(frame, trace, frame.camera_from_lidar), stage, stage.detail)
    x, y = match.cell(8)
    assert stage.detail.scales[0].occupied[y, x]
    np.testing.assert_allclose(match.true_displacement, stage.detail.displacement[y, x], atol=0.05)
    assert chosen_match(Observation(frame, trace), stage, stage.detail).true_displacement is None
