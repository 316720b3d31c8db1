"""Virtual rigs: their truth is exact, so a point is seen where its image is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibnet.evaluation.virtual import NARROWEST, Virtual, VirtualRig, virtual_rigs
from calibnet.geometry import project
from tests.support.boxes import boxes
from tests.support.drive import Drive

FRAME = boxes()


@pytest.mark.parametrize(
    "rig",
    [
        VirtualRig(1.0, (0.0, 0.0), (0.0, 0.0, 0.0), 1.0, False),
        VirtualRig(1.5, (0.1, -0.1), (0.0, 0.0, 0.0), 1.0, False),
        VirtualRig(1.2, (0.0, 0.0), (3.0, -6.0, 4.0), 0.8, False),
        VirtualRig.drawn(3, 7),
    ],
    ids=["itself", "narrower", "turned", "drawn"],
)
def test_a_point_is_seen_where_the_virtual_image_shows_it(rig: VirtualRig) -> None:
    # 10 m ahead, 1 m to the left, in the LiDAR frame
    point = np.array([[10.0, 1.0, 0.2, 0.5]], np.float32)
    u, v = project(point, FRAME.camera_from_lidar, FRAME.camera).pixels[0]
    image = np.zeros((FRAME.camera.height, FRAME.camera.width, 3), np.uint8)
    image[...] = 1  # what is black counts as beyond the image's border
    image[int(v) - 4 : int(v) + 5, int(u) - 4 : int(u) + 5] = 255
    seen = rig(replace(FRAME, image=image, points=point))
    assert seen.image.shape == (seen.camera.height, seen.camera.width, 3) and seen.image.dtype == np.uint8
    rows, columns = np.nonzero(seen.image[..., 0] > 128)
    expected = project(point, seen.camera_from_lidar, seen.camera).pixels[0]
    assert (columns.mean(), rows.mean()) == pytest.approx(tuple(expected), abs=1.2)
    assert seen.camera.focal[0] / seen.camera.width == pytest.approx(
        FRAME.camera.focal[0] / FRAME.camera.width * rig.zoom, rel=0.15
    )


def test_every_sequence_has_its_rigs_and_every_second_one_half_the_rings() -> None:
    rigs = virtual_rigs([Drive([0, 1], name="a"), Drive([0], name="b")], 2, seed=5)
    assert [rig.name for rig in rigs] == [
        f"{name}, virtual rig {n}" for name, n in (("a", 0), ("a", 1), ("b", 2), ("b", 3))
    ]
    assert [len(rig) for rig in rigs] == [2, 2, 1, 1] and ["half the rings" in rig.rig for rig in rigs] == [
        False,
        True,
    ] * 2
    drawn = [VirtualRig.drawn(5, number) for number in range(50)]
    assert drawn[0] == VirtualRig.drawn(5, 0) != VirtualRig.drawn(6, 0)
    assert all(1 <= rig.zoom <= NARROWEST for rig in drawn)


def test_one_drive_has_one_virtual_mount_and_keeps_its_points() -> None:
    class Boxes(Drive):
        def __getitem__(self, position: int):  # type: ignore[no-untyped-def]
            return replace(FRAME, index=position)

    first, second = Virtual(Boxes([0, 1]), 0, 1)
    assert np.array_equal(first.camera_from_lidar, second.camera_from_lidar)
    assert not np.array_equal(first.camera_from_lidar, FRAME.camera_from_lidar)
    assert np.array_equal(first.points, FRAME.points)
    thin = Virtual(Boxes([0, 1]), 1, 1)[0]
    assert 0.3 < len(thin.points) / len(FRAME.points) < 0.7
