"""The parts that pictures are made of: overlays, colours, channel grids, the chosen cell."""

from __future__ import annotations

import io
from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest
from PIL import Image

from calibnet.geometry import PinholeCamera, project
from calibnet.trace import ScaleTrace
from inspector.colors import EMPTY, GROUND, depth_colors, flow_colors
from inspector.record.contents import Coloring
from inspector.record.observation import Observation
from inspector.record.pictures.captions import caption_strip
from inspector.record.pictures.channel_grid import (
    GAP,
    HEADER,
    HIGHEST,
    LOWEST,
    TEXT,
    channel_grid,
    liveliest_channels,
    palette_png,
    slice_grid,
)
from inspector.record.pictures.matches import Match, StartingPoints, chosen_match
from inspector.record.pictures.overlay import Thinning, make_overlay
from inspector.record.pictures.painting import depth_edges, make_painter
from inspector.record.pictures.search_window import SearchWindow


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
    trace = fakes.FakeCascade().calibrate(frame, fakes.DELTA @ frame.camera_from_lidar)
    projection = Observation(frame, trace).projected(frame.camera_from_lidar)
    overlay = make_overlay(projection, frame.camera, Thinning(cells_across=40, pixel=0.25))
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


def test_channel_grid_numbers_the_liveliest_and_keeps_the_colour_scale_it_is_given() -> None:
    maps = np.zeros((20, 3, 64), dtype=np.float16)
    maps[7, 0, 0], maps[12, 2, 4] = 9.0, 4.5
    channels = liveliest_channels(maps)
    assert channels.tolist() == [7, 12]
    grid = channel_grid(maps[channels], 0.0, 9.0, channels)
    assert grid.shape == (2 * 3 + 2 * HEADER, 4 * 130 - 2)
    assert grid[2 * HEADER, 0] == HIGHEST  # channel 7 comes first
    assert grid[2 * HEADER + 4, 130 + 8] == (LOWEST + HIGHEST) // 2  # half as bright as 9
    assert grid[2 * HEADER, 2 * 130] == GAP  # dead channels are left out
    assert all((grid[row * HEADER : (row + 1) * HEADER, :128] == TEXT).any() for row in (0, 1)), "scale and number"
    decoded = Image.open(io.BytesIO(palette_png(grid)))
    assert decoded.size == grid.shape[::-1]


def test_slices_lie_where_their_displacement_points() -> None:
    volume = np.zeros((3, 3, 2, 4))
    volume[0, 2] = 1.0  # up and right
    occupied = np.array([[True, True, True, False]] * 2)
    grid = slice_grid(volume, occupied, 1.0)
    assert grid.shape == (9, 15)
    assert (grid[:2, 10:13] == HIGHEST).all()
    assert (grid[:2, 13] == GAP).all()
    assert (grid == HIGHEST).sum() == 6


def test_chosen_cell_is_occupied_and_its_true_displacement_is_the_fields(fakes: ModuleType) -> None:
    frame = fakes.make_frame(0)
    trace = fakes.FakeCascade().calibrate(frame, fakes.DELTA @ frame.camera_from_lidar)
    stage = trace.stages[0]
    points = StartingPoints.of(Observation(frame, trace, frame.camera_from_lidar), stage)
    match = chosen_match(points, stage.detail)
    x, y = match.cell(8)
    assert stage.detail.scales[0].occupied[y, x]
    np.testing.assert_allclose(match.true_displacement, stage.detail.displacement[y, x], atol=0.05)
    np.testing.assert_allclose(points.true_field(8), stage.detail.displacement, atol=0.05)
    unknown = StartingPoints.of(Observation(frame, trace), stage)
    assert chosen_match(unknown, stage.detail).true_displacement is None
    assert unknown.true_field(8) is None


def test_a_search_window_has_no_colour_outside_the_image() -> None:
    volume = np.ones((5, 5, 4, 6), np.float16)
    volume[1, 2], volume[:, :, 0, 0] = 0.0, 0.5
    volume[2, 2, 0, 0] = 0.75
    channels = np.zeros((1, 4, 6), np.float16)
    best, occupied = np.zeros((4, 6, 2), np.int64), np.ones((4, 6), bool)
    scale = ScaleTrace(8, volume, volume, best, channels, channels, occupied)
    shown = SearchWindow(scale, Match((1.0, 1.0), None)).scores()
    picture = np.asarray(shown.buffer.as_arrow_array().to_pylist()[0], np.uint8).reshape(5, 5, 3)
    outside = (picture == GROUND).all(axis=2)
    assert outside[:2].all() and outside[:, :2].all() and not outside[2:, 2:].any()
    assert picture[2, 2].sum() > picture[3, 3].sum()


@pytest.mark.parametrize(
    ("image", "figures", "lines"), [((1242, 375), True, 1), ((1920, 1080), True, 2), ((1920, 1080), False, 1)]
)
def test_a_caption_leaves_no_line_empty(image: tuple[int, int], figures: bool, lines: int) -> None:
    strip = caption_strip(image, figures)
    assert (strip.lines, strip.height) == (lines, round(1.3 * strip.letters * lines))


def test_an_edge_is_a_point_that_stands_before_something_farther() -> None:
    azimuth = np.radians(np.arange(-20.0, 20.0, 0.25))
    distance = np.where(np.abs(azimuth) < np.radians(5.0), 10.0, 30.0)
    scan = np.stack([distance * np.cos(azimuth), distance * np.sin(azimuth), 0 * azimuth, 0 * azimuth], axis=1)
    edges = depth_edges(scan.astype(np.float32))
    assert edges.any()
    assert (distance[edges] == 10.0).all()
    assert np.degrees(np.abs(azimuth[edges])).min() > 4.0


def test_error_colours_tell_pixels_from_the_reference(fakes: ModuleType) -> None:
    frame = fakes.make_frame(0)
    trace = fakes.FakeCascade().calibrate(frame, fakes.DELTA @ frame.camera_from_lidar)
    observation = Observation(frame, trace, frame.camera_from_lidar)
    paint, thinning = make_painter(observation, Coloring.ERROR), Thinning(cells_across=40, pixel=0.25)
    right, wrong = (
        make_overlay(observation.projected(extrinsic), frame.camera, thinning, paint).colors.astype(int)
        for extrinsic in (frame.camera_from_lidar, trace.initial)
    )
    assert (right == right[0]).all() and right[0, 2] > right[0, 0]  # blue: in place
    assert np.median(wrong[:, 0] - wrong[:, 2]) > 50  # red: far off


def test_edges_stand_out_by_size(fakes: ModuleType) -> None:
    frame = fakes.make_frame(0)
    trace = fakes.FakeCascade().calibrate(frame, fakes.DELTA @ frame.camera_from_lidar)
    observation = Observation(frame, trace)
    projection = observation.projected(frame.camera_from_lidar)
    thinning, paint = Thinning(cells_across=400, pixel=0.25), make_painter(observation, Coloring.EDGE)
    overlay = make_overlay(projection, frame.camera, thinning, paint)
    large = overlay.sizes == overlay.sizes.max()
    assert 0.0 < large.mean() < 0.5
    assert (overlay.colors[large] == overlay.colors[large][0]).all()


def test_a_projection_keeps_its_points_and_goes_far_to_near(fakes: ModuleType) -> None:
    frame = fakes.make_frame(0)
    trace = fakes.FakeCascade().calibrate(frame, fakes.DELTA @ frame.camera_from_lidar)
    projection = Observation(frame, trace).projected(trace.initial)
    exact = project(frame.points, trace.initial, frame.camera)
    assert (np.diff(projection.depth) <= 0).all()
    assert set(projection.index) == set(exact.index)
    order = np.argsort(projection.index)
    np.testing.assert_array_equal(projection.pixels[order], exact.pixels)


def test_the_volumes_of_a_camera_on_its_head_speak_of_the_upright_picture(fakes: ModuleType) -> None:
    """The frame is the same, but for its picture and extrinsics, which are turned: so are not the cells."""
    frame = fakes.make_frame(0)
    trace = fakes.FakeCascade().calibrate(frame, fakes.DELTA @ frame.camera_from_lidar)
    stage = trace.stages[0]
    standing = StartingPoints.of(Observation(frame, trace, frame.camera_from_lidar), stage)
    turn = np.diag([-1.0, -1.0, 1.0, 1.0])
    matrix = frame.camera.matrix.copy()
    matrix[:2, 2] = frame.camera.width - 1 - matrix[0, 2], frame.camera.height - 1 - matrix[1, 2]
    lying = replace(
        frame,
        image=np.ascontiguousarray(frame.image[::-1, ::-1]),
        camera=PinholeCamera(frame.camera.width, frame.camera.height, matrix),
        camera_from_lidar=turn @ frame.camera_from_lidar,
    )
    turned = replace(stage, before=turn @ stage.before, after=turn @ stage.after, upright=turn[:3, :3])
    observation = Observation(lying, trace, lying.camera_from_lidar)
    points = StartingPoints.of(observation, turned)
    np.testing.assert_allclose(points.projection.pixels, standing.projection.pixels, atol=1e-2)
    assert points.displacement is not None and standing.displacement is not None
    np.testing.assert_allclose(points.displacement, standing.displacement, atol=2e-2)
    assert observation.image_px(turned, 2.0) == pytest.approx(observation.image_px(stage, 2.0), rel=1e-6)
