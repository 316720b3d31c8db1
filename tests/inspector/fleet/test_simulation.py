"""A fleet of synthetic drives: what is wrong with each, and that all can be opened but those that are cut off."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from calibnet.datasets import open_sequence
from calibnet.datasets.synthetic import KITTI_LIKE
from calibnet.errors import ConfigError, DatasetError
from calibnet.geometry import pose_error
from inspector.fleet import simulation
from inspector.fleet.drives import find_drives
from inspector.fleet.simulation import FOCAL, draw, simulate
from tests.support.fakes import make_frame


class Street:
    """Instead of rendering."""

    def __init__(self, seed: int, length: int, rig: object) -> None:
        self.length = length

    def __iter__(self) -> object:
        return (make_frame(index) for index in range(self.length))


def test_every_fault_is_drawn_and_a_mount_stays_where_it_moved_to() -> None:
    fleet = draw(60, 4, np.random.default_rng(0))
    faults = [one.fault for one in fleet]
    assert {fault: faults.count(fault) for fault in ("moved", "camera", "truncated")} == {
        "moved": 5,
        "camera": 10,
        "truncated": 1,
    }
    moved = [one for one in fleet if one.fault == "moved"]
    assert len({one.car for one in moved}) == 1
    assert all(np.array_equal(one.move, moved[0].move) for one in moved)
    error = pose_error(moved[0].move, np.eye(4))
    assert error.rotation_deg == pytest.approx(2.0, abs=0.02)
    assert all(np.array_equal(one.move, np.eye(4)) for one in fleet if one.fault != "moved")


def test_the_drives_are_what_the_truth_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulation, "SyntheticSequence", Street)
    file = simulate(tmp_path / "fleet", 20, 0, frames=2)
    with (tmp_path / "fleet" / "truth.csv").open() as text:
        truth = {(row["car"], row["drive"]): row["fault"] for row in csv.DictReader(text)}
    drawn = draw(20, 4, np.random.default_rng([0, 22]))
    moves = {(f"car-{one.car:04d}", f"drive-{one.drive:02d}"): one.move for one in drawn}
    drives = find_drives([str(file)])
    assert len(drives) == len(truth) == 20
    assert sum(1 for _ in (tmp_path / "fleet" / "streets").rglob("*.png")) == 8, "frames are written once"
    for drive in drives:
        fault = truth[drive.car, drive.drive]
        sequence = open_sequence("folder", drive.path)
        assert len(sequence) == 2
        camera, extrinsic = sequence.calibration.camera, sequence.calibration.camera_from_lidar  # type: ignore[attr-defined]
        assert camera.matrix[0, 0] == pytest.approx(720.0 * (FOCAL if fault == "camera" else 1.0))
        error = pose_error(extrinsic, KITTI_LIKE.camera_from_lidar)
        assert error.rotation_deg < 1.0 and error.translation_cm < 10.0, "a moved mount keeps its calibration"
        if fault == "truncated":
            with pytest.raises(DatasetError):
                sequence[0]
            continue
        scan = np.fromfile(Path(drive.path) / "clouds" / "0000.bin", "<f4").reshape(-1, 4)
        seen, there = np.c_[scan[:, :3], np.ones(len(scan))], np.c_[make_frame(0).points[:, :3], np.ones(len(scan))]
        true = KITTI_LIKE.camera_from_lidar
        assert (np.abs(seen - there).max() > 0.1) == (fault == "moved")
        np.testing.assert_allclose(seen @ (moves[drive.car, drive.drive] @ true).T, there @ true.T, atol=1e-3)


def test_a_folder_with_something_in_it_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "mine").touch()
    with pytest.raises(ConfigError, match="is not empty"):
        simulate(tmp_path, 2, 0)
