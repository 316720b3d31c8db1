"""Every dataset of the registry keeps the promises of `Sequence` and `Frame`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from calibnet.conformance import check_dataset
from calibnet.datasets import DATASETS, dataset_names, open_sequence
from calibnet.datasets.discovery import find_sequences
from calibnet.errors import ConfigError
from tests.support.toy_package import install_toys


@pytest.mark.parametrize("dataset", DATASETS.own)
def test_dataset_keeps_the_protocol(dataset, write_layout):
    layout = write_layout(dataset)
    check_dataset(layout.open)


@pytest.mark.parametrize("dataset", DATASETS.own)
def test_what_is_on_disk_is_what_is_read(dataset, write_layout):
    layout = write_layout(dataset)
    frames = list(layout.open())
    assert [frame.index for frame in frames] == layout.indices
    for frame in frames:
        np.testing.assert_allclose(frame.camera.matrix, layout.matrix, rtol=1e-12)
        np.testing.assert_allclose(frame.camera_from_lidar, layout.camera_from_lidar, rtol=0, atol=1e-12)

    for frame, pixels in zip(frames, layout.pixels, strict=bool(layout.pixels)):
        np.testing.assert_array_equal(frame.image, pixels)
    for frame, points in zip(frames, layout.points, strict=bool(layout.points)):
        np.testing.assert_array_equal(frame.points, points)


def test_a_dataset_of_another_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    install_toys(tmp_path, monkeypatch)
    assert dataset_names()[-2:] == ("broken", "toy")
    check_dataset(lambda: open_sequence("toy", tmp_path / "drive", first=3))
    assert [frame.index for frame in open_sequence("toy", tmp_path, first=3)] == [3, 4]
    assert [one.name for one in find_sequences("toy", tmp_path, "drive")] == ["toy/drive"]
    with pytest.raises(ConfigError, match=r"toy takes \(root, first\)"):
        open_sequence("toy", tmp_path, camera=2)


def test_unknown_dataset_and_option_name_what_there_is(tmp_path: Path):
    with pytest.raises(ConfigError, match=r"'kiti'.*kitti-odometry.*folder"):
        open_sequence("kiti", tmp_path)
    with pytest.raises(ConfigError, match=r"kitti-raw takes \(root, date, drive, camera\).*'sequence'"):
        open_sequence("kitti-raw", tmp_path, date="x", drive="1", sequence="04")
