"""Every dataset of the registry keeps the promises of `Sequence` and `Frame`."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from calibnet.datasets import Sequence, dataset_names, open_sequence
from calibnet.errors import ConfigError


@pytest.mark.parametrize("dataset", dataset_names())
def test_dataset_keeps_the_protocol(dataset, write_layout):
    layout = write_layout(dataset)
    sequence = layout.open()

    assert isinstance(sequence, Sequence)
    assert sequence.name
    assert sequence.rig
    frames = list(sequence)
    assert [frame.index for frame in frames] == layout.indices
    assert len(sequence) == len(frames)
    times = [frame.timestamp for frame in frames]
    assert times[0] == 0.0
    assert times == sorted(times)

    for frame in frames:
        height, width = frame.image.shape[:2]
        assert frame.image.dtype == np.uint8
        assert frame.image.shape == (height, width, 3)
        assert (frame.camera.width, frame.camera.height) == (width, height)
        np.testing.assert_allclose(frame.camera.matrix, layout.matrix, rtol=1e-12)
        assert frame.points.dtype == np.float32
        assert frame.points.ndim == 2
        assert frame.points.shape[1] == 4
        assert len(frame.points) > 0
        assert np.isfinite(frame.points).all()
        assert 0.0 <= frame.points[:, 3].min() <= frame.points[:, 3].max() <= 1.0
        assert frame.camera_from_lidar.dtype == np.float64
        np.testing.assert_allclose(frame.camera_from_lidar, layout.camera_from_lidar, rtol=0, atol=1e-12)
        assert frame.source

    for frame, pixels in zip(frames, layout.pixels, strict=bool(layout.pixels)):
        np.testing.assert_array_equal(frame.image, pixels)
    for frame, points in zip(frames, layout.points, strict=bool(layout.points)):
        np.testing.assert_array_equal(frame.points, points)


@pytest.mark.parametrize("dataset", dataset_names())
def test_frames_are_read_anew_and_by_position(dataset, write_layout):
    sequence = write_layout(dataset).open()
    first, again, last = sequence[0], sequence[0], sequence[-1]
    np.testing.assert_array_equal(first.image, again.image)
    np.testing.assert_array_equal(first.points, again.points)
    assert last.index == [frame.index for frame in sequence][-1]
    first.image[:] = 0  # frames are the reader's own: changing one changes no other
    first.points[:] = 0
    assert sequence[0].image.any()
    assert sequence[0].points.any()
    with pytest.raises(IndexError):
        sequence[len(sequence)]


def test_unknown_dataset_and_option_name_what_there_is(tmp_path: Path):
    with pytest.raises(ConfigError, match=r"'kiti'.*kitti-odometry.*folder"):
        open_sequence("kiti", tmp_path)
    with pytest.raises(ConfigError, match=r"kitti-raw takes \(root, date, drive, camera\).*'sequence'"):
        open_sequence("kitti-raw", tmp_path, date="x", drive="1", sequence="04")


def test_importing_the_package_loads_no_heavy_library():
    heavy = "{'cv2', 'pykitti', 'open3d', 'torch', 'rerun', 'matplotlib'}"
    command = f"import calibnet.datasets, sys; sys.exit(', '.join({heavy} & set(sys.modules)) or 0)"
    result = subprocess.run([sys.executable, "-c", command], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
