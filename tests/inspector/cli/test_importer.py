"""``rerun FOLDER``: what the importer takes for its own, and how it steps aside."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
import rerun as rr

from inspector.cli.importer import INCOMPATIBLE, recognise


def make(root: Path, *names: str) -> Path:
    for name in names:
        path = root / name
        if "." in path.name:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.touch()
        else:
            path.mkdir(parents=True, exist_ok=True)
    return root


def test_a_kitti_odometry_sequence(tmp_path: Path) -> None:
    make(tmp_path / "sequences" / "04", "image_2", "velodyne", "calib.txt")
    found = recognise(tmp_path / "sequences" / "04")
    assert found is not None
    assert (found.dataset, found.root, found.options) == ("kitti-odometry", tmp_path, {"sequence": "04"})


def test_a_kitti_raw_drive(tmp_path: Path) -> None:
    drive = "2011_09_26_drive_0005_sync"
    make(tmp_path / "2011_09_26", "calib_cam_to_cam.txt", f"{drive}/image_02", f"{drive}/velodyne_points")
    found = recognise(tmp_path / "2011_09_26" / drive)
    assert found is not None
    assert (found.root, found.options) == (tmp_path, {"date": "2011_09_26", "drive": "0005"})
    assert not found.as_is


def test_own_sensors_start_from_their_guess(tmp_path: Path) -> None:
    found = recognise(make(tmp_path, "images", "clouds", "calibration.yaml"))
    assert found is not None
    assert found.dataset == "folder"
    assert found.as_is


@pytest.mark.parametrize(
    "names", [(), ("images", "clouds"), ("image_2", "velodyne", "calib.txt"), ("calibration.yaml",)]
)
def test_other_folders_are_not_ours(tmp_path: Path, names: tuple[str, ...]) -> None:
    assert recognise(make(tmp_path, *names)) is None


def test_the_exit_code_is_reruns() -> None:
    assert rr.EXTERNAL_IMPORTER_INCOMPATIBLE_EXIT_CODE == INCOMPATIBLE


def test_it_steps_aside_silently_and_without_a_heavy_import(tmp_path: Path) -> None:
    broken = make(tmp_path / "broken", "images", "clouds", "calibration.yaml")
    for path in (tmp_path, tmp_path / "file.png", broken):
        code = f"import sys; sys.argv = ['importer', {str(path)!r}, '--application-id', 'a']\n"
        code += "import inspector.cli.importer as importer\n"
        code += "try:\n    importer.main()\nfinally:\n    heavy = 'torch' in sys.modules\n"
        code += f"    assert not heavy or {path == broken}\n"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout, done.stderr) == (INCOMPATIBLE, "", "")
