from __future__ import annotations

from dataclasses import replace

import numpy as np

from calibnet.evaluation.audit import Altered, alterations, other_drive
from calibnet.evaluation.faults import grey, thinned
from tests.support.drive import Drive


def test_swapped_images_are_another_drive_s_at_the_frame_s_own_size() -> None:
    swap = alterations(Drive([0, 1], brightness=77))["swapped"]
    frame = replace(Drive([5])[0], image=np.zeros((16, 48, 3), np.uint8))
    frame = replace(frame, camera=frame.camera.resized(48, 16))
    swapped = swap(frame)
    assert swapped.image.shape == (16, 48, 3) and (swapped.image == 77).all()
    assert swapped.points is frame.points and swapped.camera is frame.camera


def test_a_grey_image_shows_nothing() -> None:
    frame = replace(Drive([0])[0], image=np.random.default_rng(0).integers(0, 255, (32, 64, 3), np.uint8))
    assert grey(frame).image.std() == 0 and grey(frame).image.shape == frame.image.shape


def test_thinning_drops_whole_rings_and_about_half_of_the_points() -> None:
    elevation = np.radians(np.arange(-24.87, 2.0, 0.4))
    azimuth = np.linspace(-1, 1, 200)
    e, a = np.meshgrid(elevation, azimuth, indexing="ij")
    points = np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e), 0 * e], axis=-1) * 10
    left = thinned(2)(replace(Drive([0])[0], points=points.reshape(-1, 4).astype(np.float32))).points
    assert 0.35 < len(left) / points[..., 0].size < 0.65
    rings, counts = np.unique(np.round(np.degrees(np.arcsin(left[:, 2] / 10)), 1), return_counts=True)
    assert (counts == 200).all() and len(rings) < len(elevation)


def test_the_donor_is_another_drive_where_there_is_one() -> None:
    here, there, folder = Drive([0], "a/04"), Drive([0], "a/05"), Drive([0], "a/00")
    assert other_drive(here, [here, there], list) is there
    assert other_drive(here, [here], lambda: [here, folder]) is folder
    assert other_drive(here, [here], list).name.startswith("synthetic")


def test_altered_sequences_are_sequences() -> None:
    altered = Altered(Drive([3, 4]), grey)
    assert [frame.index for frame in altered] == [3, 4] and len(altered) == 2
    assert (altered[0].image == 128).all()
    assert (altered.name, altered.rig) == ("test/drive", "test rig")
