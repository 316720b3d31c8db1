"""Drives and results in a bucket, here fsspec's own in memory; what counts as the same input."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import pytest

from inspector.fleet.drives import Drive
from inspector.fleet.places import content, items_of, on_this_machine, seen
from tests.calibnet.datasets.published import write_kitti_360
from tests.inspector.fleet.conftest import Invoke
from tests.support.folder import write_folder
from tests.support.judged_drives import JudgedCascade

fsspec = pytest.importorskip("fsspec", reason="the extra [fleet] is not installed")


@pytest.fixture
def bucket(tmp_path: Path) -> str:
    """A drive in memory."""
    memory = fsspec.filesystem("memory")
    memory.store.clear()
    memory.pseudo_dirs[:] = [""]
    memory.put(f"{write_folder(tmp_path / 'blue' / 'monday', 2)}/", "/fleet/blue/monday/", recursive=True)
    return "memory://fleet/blue/monday"


class Quiet(SimpleHTTPRequestHandler):
    """Serves a folder, and says nothing of it."""

    def log_message(self, *arguments: object) -> None:
        """Not even that."""


@pytest.fixture
def site(tmp_path: Path) -> Iterator[str]:
    """A web server with a drive."""
    pytest.importorskip("aiohttp", reason="what fsspec opens web servers with is not installed")
    write_folder(tmp_path / "site" / "blue" / "monday", 2)
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(tmp_path / "site")))
    thread = Thread(target=server.serve_forever)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}/blue/monday"
    server.shutdown()
    thread.join()
    server.server_close()


def of_folder(path: object, **more: object) -> Drive:
    return Drive("car", "drive", "folder", str(path), **more)  # type: ignore[arg-type]


def test_a_copy_has_the_same_content_wherever_it_lies(bucket: str, tmp_path: Path) -> None:
    there, here = of_folder(bucket), of_folder(tmp_path / "blue" / "monday")
    with on_this_machine(there) as copy:
        assert copy.name == "monday"
        assert content(copy, there) == content(Path(here.path), here)
    assert not copy.exists()
    assert [item.path for item in items_of(there)] == [item.path for item in items_of(here)]


def test_a_drive_on_a_web_server_is_told_by_its_content(
    site: str, invoke: Invoke, cascade: JudgedCascade, tmp_path: Path
) -> None:
    there, call = of_folder(site), ("fleet", "DRIVES.csv", "--output", "all", "--workers", "0")
    with on_this_machine(there) as copy:
        assert content(copy, there) == content(tmp_path / "site/blue/monday", of_folder(tmp_path / "site/blue/monday"))
    assert seen(items_of(there)) == "", "it says nothing of times or sizes"
    Path("DRIVES.csv").write_text(f"path,drive\n{site},monday\n")
    for solved in (1, 1):
        assert invoke(*call)[0] == 0
        assert cascade.solved == solved, "the same is not done again"
    shutil.copy(tmp_path / "site/blue/monday/clouds/0001.bin", tmp_path / "site/blue/monday/clouds/0000.bin")
    assert invoke(*call)[0] == 0
    assert cascade.solved == 2, "what changed is"


def test_content_and_look_change_with_a_byte(tmp_path: Path) -> None:
    drive = of_folder(write_folder(tmp_path / "own", 1))
    before = content(Path(drive.path), drive), seen(items_of(drive))
    cloud = tmp_path / "own" / "clouds" / "0000.bin"
    times = cloud.stat().st_atime_ns, cloud.stat().st_mtime_ns
    data = bytearray(cloud.read_bytes())
    data[5] ^= 1
    cloud.write_bytes(data)
    os.utime(cloud, ns=times)
    assert content(Path(drive.path), drive) != before[0]
    assert seen(items_of(drive)) != before[1], "also where somebody sets the time back"


def test_what_is_linked_counts(tmp_path: Path) -> None:
    write_folder(tmp_path / "street", 1)
    own = tmp_path / "own"
    own.mkdir()
    (own / "clouds").symlink_to(tmp_path / "street" / "clouds")
    (own / "loop").symlink_to(own)
    assert [item.path for item in items_of(of_folder(own))] == ["clouds/0000.bin"]


def test_of_a_dataset_with_many_drives_only_its_own_files_count(tmp_path: Path) -> None:
    for name in ("sequences/04/calib.txt", "sequences/05/calib.txt", "poses/04.txt"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(name)
    drive = Drive("car", "04", "kitti-odometry", str(tmp_path), sequence="04")
    assert [item.path for item in items_of(drive)] == ["sequences/04/calib.txt"]
    assert items_of(replace(drive, sequence="4")) == items_of(drive)


def test_files_of_a_drive_of_kitti_360_are_its_own_and_the_calibrations(tmp_path: Path) -> None:
    write_kitti_360(tmp_path)
    drive = Drive("car", "3", "kitti-360", str(tmp_path), sequence="3")
    assert {item.path.split("/")[0] for item in items_of(drive)} == {"calibration", "data_2d_raw", "data_3d_raw"}
    assert items_of(replace(drive, sequence="4")) == [one for one in items_of(drive) if one.path < "data"]


def test_a_guess_is_input_as_well(tmp_path: Path) -> None:
    drive = of_folder(write_folder(tmp_path / "own", 1), options=("--guess", str(tmp_path / "guess.yaml")))
    before = seen(items_of(drive)), content(Path(drive.path), drive)
    (tmp_path / "guess.yaml").write_text("one")
    assert seen(items_of(drive)) != before[0]
    assert content(Path(drive.path), drive) != before[1]


def test_a_bucket_is_read_and_written_as_a_folder_is(invoke: Invoke, bucket: str, cascade: JudgedCascade) -> None:
    memory = fsspec.filesystem("memory")
    Path("DRIVES.csv").write_text(f"path\n{bucket}\n")
    call = ("fleet", "DRIVES.csv", "--output", "memory://results/all", "--workers", "0")
    code, out, _ = invoke(*call)
    assert code == 0
    assert "1 accepted" in out
    names = {name.removeprefix("/results/all/") for name in memory.find("/results/all")}
    assert {"fleet.parquet", "drives/blue/monday/recording.rrd", "drives/blue/monday/drive.json"} <= names
    invoke(*call)
    assert cascade.solved == 1


def test_a_drive_that_fails_shows_nothing_of_an_earlier_run_in_a_bucket(
    invoke: Invoke, bucket: str, cascade: JudgedCascade, monkeypatch: pytest.MonkeyPatch
) -> None:
    memory = fsspec.filesystem("memory")
    call = ("fleet", "DRIVES.csv", "--output", "memory://results/all", "--workers", "0")
    Path("DRIVES.csv").write_text(f"path\n{bucket}\n")
    out = invoke(*call)[1]
    assert "copy memory://results/all to this machine, then: calib-inspect fleet-report" in out
    there = "/results/all/drives/blue/monday"
    before = {name.removeprefix(f"{there}/") for name in memory.find(there)}
    assert {"index.html", "verdict.json", "drive.json", "metrics.json"} <= before

    def fault(self: JudgedCascade, *_: object) -> None:
        raise ZeroDivisionError("by zero")

    monkeypatch.setattr(JudgedCascade, "calibrate_drive", fault)
    invoke(*call, "--force")
    assert {name.removeprefix(f"{there}/") for name in memory.find(there)} == {"log.txt", "recording.rrd"}
    assert b"ZeroDivisionError" in memory.cat_file(f"{there}/log.txt")


def test_a_sentence_names_the_file_of_the_drive_and_not_the_copy(invoke: Invoke, bucket: str) -> None:
    memory = fsspec.filesystem("memory")
    for name in memory.find("/fleet/blue/monday/clouds"):
        memory.pipe_file(name, memory.cat_file(name)[:1001])
    Path("DRIVES.csv").write_text(f"path\n{bucket}/\n")
    err = invoke("fleet", "DRIVES.csv", "--output", "memory://results/all", "--workers", "0")[2]
    said = err.replace("\n", "")
    assert re.search(r"blue/monday.*Scan clouds/0000\.bin cannot be read", said) and "/tmp" not in said


def test_an_address_that_nothing_reads_is_a_sentence(invoke: Invoke) -> None:
    Path("DRIVES.csv").write_text("path\nnosuch://bucket/drive\n")
    code, _, err = invoke("fleet", "DRIVES.csv", "--output", "all", "--workers", "0")
    assert code == 0
    assert "nosuch://bucket/drive cannot be opened" in err
