"""`calib-inspect fleet` without an engine: rows, what is done already, failures, and the same as by hand."""

from __future__ import annotations

import json
import os
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml

from calibnet.geometry import miscalibration
from inspector.fleet.ledger import ENTRY
from inspector.fleet.table import FAILED
from tests.inspector.fleet.conftest import Invoke, rows_of
from tests.support.fakes import REFERENCE
from tests.support.folder import write_folder
from tests.support.judged_drives import JudgedCascade

HERE = ("--workers", "0")


def calibrate_with(folder: Path, extrinsic: np.ndarray) -> None:
    """Give a folder another extrinsic."""
    path = folder / "calibration.yaml"
    content = yaml.safe_load(path.read_text())
    path.write_text(yaml.safe_dump(content | {"camera_from_lidar": extrinsic.tolist()}))


def test_every_folder_is_a_drive_with_a_row_and_a_folder_of_its_own(invoke: Invoke, cars: Path) -> None:
    calibrate_with(cars / "tuesday", miscalibration([0.0, 0.0, 0.0], [0.0, 0.0, 0.2]) @ REFERENCE)
    code, out, _ = invoke("fleet", str(cars / "monday"), str(cars / "tuesday"), "--output", "all", *HERE)
    assert code == 0
    assert "2 of 2 drives: 1 accepted, 1 rejected" in out
    rows = rows_of(Path("all"))
    assert (rows["monday"].car, rows["monday"].verdict, rows["monday"].frames) == ("car-a", "accepted", 2)
    assert rows["tuesday"].verdict == "rejected"
    assert rows["tuesday"].moved_deg == pytest.approx(0.0, abs=1e-6)
    assert rows["tuesday"].moved_cm == pytest.approx(20.0, abs=1e-6)
    for row in rows.values():
        assert np.array_equal(row.extrinsic, REFERENCE)
        assert row.recording == f"drives/car-a/{row.drive}/recording.rrd"
        assert all((Path("all") / file).is_file() for file in (row.recording, row.report, row.json))


def test_a_drive_says_what_verify_says_of_it_by_hand(invoke: Invoke, cars: Path) -> None:
    calibrate_with(cars / "tuesday", miscalibration([1.0, 0.0, 0.0], [0.0, 0.0, 0.0]) @ REFERENCE)
    invoke("fleet", str(cars / "tuesday"), "--output", "all", *HERE)
    hand = (
        "verify",
        "folder",
        str(cars / "tuesday"),
        "--detail",
        "overview",
        "--report",
        "hand",
        "--json",
        "hand.json",
    )
    assert invoke(*hand)[0] == 1
    by_fleet, by_hand = (
        json.loads(Path(file).read_text()) for file in ("all/" + rows_of(Path("all"))["tuesday"].json, "hand.json")
    )
    assert by_fleet == by_hand
    fleet_figures = json.loads(Path("all/drives/car-a/tuesday/metrics.json").read_text())
    hand_figures = json.loads(Path("hand/metrics.json").read_text())
    assert fleet_figures["per_frame"] == hand_figures["per_frame"]


def test_the_same_call_again_does_nothing(invoke: Invoke, cars: Path, cascade: JudgedCascade) -> None:
    call = ("fleet", str(cars / "monday"), str(cars / "tuesday"), "--output", "all", *HERE)
    invoke(*call)
    first = rows_of(Path("all"))
    code, _, err = invoke(*call)
    assert code == 0
    assert cascade.solved == 2
    assert "2 of 2 drives are already done" in err
    assert rows_of(Path("all")) == first
    invoke(*call, "--force")
    assert cascade.solved == 4


def test_what_changed_is_done_again(invoke: Invoke, cars: Path, cascade: JudgedCascade) -> None:
    call = ("fleet", str(cars / "monday"), str(cars / "tuesday"), "--output", "all", *HERE)
    invoke(*call)
    calibrate_with(cars / "tuesday", miscalibration([0.0, 3.0, 0.0], [0.0, 0.0, 0.0]) @ REFERENCE)
    invoke(*call)
    assert cascade.solved == 3
    assert rows_of(Path("all"))["tuesday"].verdict == "rejected"
    invoke(*call, "--options", "--seed 1")
    assert cascade.solved == 5


def test_input_that_only_looks_different_is_not_done_again(invoke: Invoke, cars: Path, cascade: JudgedCascade) -> None:
    call = ("fleet", str(cars / "monday"), "--output", "all", *HERE)
    invoke(*call)
    os.utime(cars / "monday" / "images" / "0000.png")
    invoke(*call)
    shutil.copytree(cars / "monday", cars / "copy")
    shutil.rmtree(cars / "monday")
    (cars / "copy").rename(cars / "monday")
    invoke(*call)
    assert cascade.solved == 1


def test_results_that_are_gone_are_made_again(invoke: Invoke, cars: Path, cascade: JudgedCascade) -> None:
    call = ("fleet", str(cars / "monday"), "--output", "all", *HERE)
    invoke(*call)
    Path("all/drives/car-a/monday/recording.rrd").unlink()
    invoke(*call)
    assert cascade.solved == 2


def test_a_drive_that_cannot_be_read_is_a_row_with_its_sentence(
    invoke: Invoke, cars: Path, cascade: JudgedCascade
) -> None:
    for scan in (cars / "tuesday" / "clouds").iterdir():
        os.truncate(scan, 1001)
    call = ("fleet", str(cars / "monday"), str(cars / "tuesday"), "--output", "all", *HERE)
    code, out, err = invoke(*call)
    assert code == 0
    assert "1 accepted, 1 failed" in out
    row = rows_of(Path("all"))["tuesday"]
    assert row.verdict == FAILED
    assert "1 of 2 frames cannot be read" in row.reason
    assert "Scan clouds/0000.bin cannot be read" in row.reason, "the path of the drive is in its row"
    assert row.reason in err.replace("\n", "")
    assert row.report == ""
    assert (Path("all") / row.recording).is_file(), "the catalogue has a row of it as well"
    assert invoke(*call)[2].startswith("2 of 2 drives are already done"), "the same input would fail alike"


def test_a_fault_of_the_machine_is_tried_again_at_the_next_call(
    invoke: Invoke, cars: Path, cascade: JudgedCascade, monkeypatch: pytest.MonkeyPatch
) -> None:
    call = ("fleet", str(cars / "monday"), "--output", "all", *HERE)
    tries = []

    def full(*_: object, **__: object) -> None:
        tries.append(1)
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as broken:
        broken.setattr(JudgedCascade, "calibrate_drive", full)
        invoke(*call)
    assert len(tries) == 2
    row = rows_of(Path("all"))["monday"]
    assert (row.verdict, row.reason) == (FAILED, "No space left on device; free some space or write elsewhere.")
    invoke(*call)
    assert rows_of(Path("all"))["monday"].verdict == "accepted"


def test_a_failure_leaves_no_report_of_an_earlier_run(invoke: Invoke, cars: Path) -> None:
    call = ("fleet", str(cars / "monday"), "--output", "all", *HERE)
    invoke(*call)
    for scan in (cars / "monday" / "clouds").iterdir():
        os.truncate(scan, 1001)
    invoke(*call)
    assert rows_of(Path("all"))["monday"].verdict == FAILED
    assert not Path("all/drives/car-a/monday/index.html").exists()


def test_ctrl_c_keeps_what_is_done_and_says_how_to_go_on(
    invoke: Invoke, cars: Path, cascade: JudgedCascade, monkeypatch: pytest.MonkeyPatch
) -> None:
    solve = JudgedCascade.calibrate_drive

    def interrupted(self: JudgedCascade, *arguments: object) -> object:
        if self.solved:
            raise KeyboardInterrupt
        return solve(self, *arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(JudgedCascade, "calibrate_drive", interrupted)
    call = ("fleet", str(cars / "monday"), str(cars / "tuesday"), "--output", "all", *HERE)
    monkeypatch.setattr("sys.argv", ["calib-inspect", *call, "--force"])
    code, out, err = invoke(*call, "--force")
    assert code == 130
    assert "1 of 2 drives: 1 accepted" in out
    assert f"To continue with the others: calib-inspect {shlex.join(call)}" in err
    assert list(rows_of(Path("all"))) == ["monday"]
    monkeypatch.setattr(JudgedCascade, "calibrate_drive", solve)
    assert invoke(*call)[0] == 0
    assert cascade.solved == 2


def test_names_of_drives_are_quoted_in_paths(invoke: Invoke, tmp_path: Path) -> None:
    write_folder(tmp_path / "data", 2)
    Path("DRIVES.csv").write_text('path,car,drive\ndata,../../up,"<b>\n2"\n')
    assert invoke("fleet", "DRIVES.csv", "--output", "all", *HERE)[0] == 0
    (row,) = rows_of(Path("all")).values()
    assert row.drive == "<b>\\n2"
    assert row.folder == "drives/%2E.%2F..%2Fup/%3Cb%3E%5Cn2"
    assert (Path("all") / row.folder / ENTRY).is_file()


def test_a_list_of_kitti_and_folders_is_read(invoke: Invoke, cars: Path) -> None:
    Path("DRIVES.csv").write_text(
        "car,drive,date,path,frames,options\na,one,2026-01-02,car-a/monday,0:2,--seed 3\nb,two,,car-a/tuesday,0,\n"
    )
    assert invoke("fleet", "DRIVES.csv", "--output", "all", *HERE)[0] == 0
    rows = rows_of(Path("all"))
    assert (rows["one"].car, rows["one"].date, rows["one"].selection) == ("a", "2026-01-02T00:00:00", "0:2")
    assert (rows["one"].options, rows["two"].frames) == ("--seed 3", 1)


def test_two_fleets_do_not_write_one_folder(invoke: Invoke, cars: Path) -> None:
    from calibnet.runtime.claim import Claim
    from calibnet.runtime.writing import Kind

    Path("all").mkdir()
    claim = Claim(Path("all/fleet.parquet"), Kind.PARQUET)
    code, _, err = invoke("fleet", str(cars / "monday"), "--output", "all", *HERE)
    claim.release()
    assert code == 3
    assert "is being written by another run" in err
