"""``rerun FOLDER``: what the importer takes for its own, and how it steps aside."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
import rerun as rr
from rerun.chunk import RrdReader

from inspector.cli.importer import INCOMPATIBLE, ids, is_read_already, recognise
from tests.support.folder import write_folder


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


def test_files_of_an_opened_folder_are_taken_and_others_are_not(tmp_path: Path) -> None:
    car = make(tmp_path / "car", "images", "clouds/0000.bin", "calibration.yaml", "clouds/deep/er/0000.bin")
    drive = make(tmp_path / "sequences" / "04", "image_2", "velodyne/000000.bin", "calib.txt")
    assert is_read_already(car / "clouds" / "0000.bin", "car")
    assert is_read_already(car / "calibration.yaml", "car")
    assert is_read_already(drive / "velodyne" / "000000.bin", "04")
    assert not is_read_already(car / "clouds" / "0000.bin", "0000.bin"), "it is opened by itself"
    assert not is_read_already(car / "clouds" / "deep" / "er" / "0000.bin", "car")
    assert not is_read_already(make(tmp_path / "other", "a.bin") / "a.bin", "other")


def test_the_viewer_says_which_recording_it_has_begun() -> None:
    assert ids(["--application-id", "car", "--recording-id", "rec_1", "--static"]) == ("car", "rec_1")
    assert ids(["--application-id", "car"]) is None
    assert ids([]) is None


def test_what_it_writes_is_part_of_the_viewers_own_recording(tmp_path: Path) -> None:
    car = write_folder(tmp_path / "car", 2)
    code = f"import sys; sys.argv = ['importer', {str(car)!r}, '--application-id', 'car', '--recording-id', 'rec_1']\n"
    code += "from calibnet.cascade.cascade import Cascade\nfrom tests.support.fakes import FakeCascade\n"
    code += "Cascade.load = lambda **_: FakeCascade()\nfrom inspector.cli.importer import main\nmain()\n"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
    file = tmp_path / "imported.rrd"
    file.write_bytes(done.stdout)
    stores = RrdReader(file)
    assert [(one.application_id, one.recording_id) for one in stores.recordings()] == [("car", "rec_1")]
    assert [one.application_id for one in stores.blueprints()] == ["car"]


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
