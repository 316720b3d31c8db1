"""The commands ``seq raw object folder demo``: what they run, where they save, what they refuse."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from rerun.chunk import RrdReader

from inspector.cli.errors import run
from inspector.cli.main import cli
from inspector.record import indexing, stream
from tests.support.bags import write_bag
from tests.support.folder import write_folder

Invoke = Callable[..., tuple[int, str, str]]


@pytest.fixture
def invoke(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str], fakes: ModuleType
) -> Invoke:
    """``invoke("seq", "04", ...)`` in an empty folder without a display, with the fake cascade."""
    from calibnet.cascade.cascade import Cascade

    def load(
        preset: str = "compact", stages: tuple[int, ...] | None = None, folder: Any = None, *_: Any, **__: Any
    ) -> Any:
        return fakes.FakeCascade(stages or (1, 2, 3, 4, 5))

    monkeypatch.setattr(Cascade, "load", staticmethod(load))
    monkeypatch.chdir(tmp_path)
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "KITTI_ROOT"):
        monkeypatch.delenv(name, raising=False)

    def call(*arguments: str) -> tuple[int, str, str]:
        code = run(cli, list(arguments))
        out, err = capsys.readouterr()
        return code, out, err

    return call


@pytest.fixture
def own_folder(tmp_path: Path) -> Path:
    """Two frames of the fake car as a plain folder."""
    return write_folder(tmp_path / "own", 2)


def entities_of(file: Path) -> set[str]:
    return {str(column.entity_path) for column in RrdReader(file).store().schema().component_columns()}


def test_a_folder_starts_from_its_calibration_and_has_no_errors(invoke: Invoke, own_folder: Path) -> None:
    code, out, _ = invoke("folder", str(own_folder), "--save", "own.rrd")
    assert code == 0
    assert "no reference" in out
    assert "/error/rotation/initial" not in entities_of(Path("own.rrd"))


def test_a_folder_with_a_range_takes_its_calibration_for_the_reference(invoke: Invoke, own_folder: Path) -> None:
    code, out, _ = invoke("folder", str(own_folder), "--range", "2/0.2", "--seed", "1", "--save", "own.rrd")
    assert code == 0
    assert "corrected." in out
    paths = entities_of(Path("own.rrd"))
    assert "/error/rotation/initial" in paths
    assert "/overlay/stage_4" in paths
    assert "/overlay/stage_3" not in paths


def test_without_display_and_save_the_recording_goes_to_recordings(invoke: Invoke, own_folder: Path) -> None:
    code, out, _ = invoke("folder", str(own_folder), "--frames", "1")
    file = Path("recordings/folder-own.rrd")
    assert code == 0
    assert f"Saved {file}" in out
    *before, last = out.splitlines()
    for command in (
        f"rerun {file}",
        f"calib-inspect report {file} --output report/",
        f"calib-inspect export {file} --format",
    ):
        assert any(command in line for line in before), command
    assert last == "Verdict: accepted. Image and scan fit together."
    assert file.is_file()


def test_demo_needs_nothing_and_is_kept_in_recordings(invoke: Invoke, read: Any, fakes: ModuleType) -> None:
    code, out, _ = invoke("demo", "--length", "2", "--detail", "overview")
    assert code == 0
    assert "2 frames in" in out
    frames = [frame for frame, _ in read(Path("recordings/demo.rrd"), "image", "EncodedImage:blob")]
    assert frames == [0, 1]


def test_kitti_of_the_real_layout(invoke: Invoke, kitti_folder: Path, read: Any) -> None:
    root = str(kitti_folder / "odometry")
    code, out, _ = invoke("seq", "04", "--root", root, "--frames", "0:2", "--stages", "4-5", "--save", "04.rrd")
    assert code == 0, out
    paths = entities_of(Path("04.rrd"))
    assert {"/overlay/stage_4", "/overlay/stage_5"} <= paths
    assert "/overlay/stage_3" not in paths


@pytest.mark.parametrize("command", [("seq", "04"), ("raw", "2011_09_26", "0005"), ("object",)])
def test_without_a_root_it_says_how_to_get_one(invoke: Invoke, command: tuple[str, ...]) -> None:
    code, _, err = invoke(*command)
    assert code != 0
    assert err.count("\n") == 1
    assert all(text in err for text in ("--root", "KITTI_ROOT", "calib-inspect demo"))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--range", "5/0.5", "--miscalibrate", "1,1,1,0,0,0"), "not both"),
        (("--miscalibrate", "1,1,1,0,0,0", "--per-frame"), "--per-frame"),
        (("--save", "."), "names a folder"),
        (("--connect", "rerun+http://127.0.0.1:1/proxy"), "No viewer listens"),
        (("--frames", "7:9"), "select nothing"),
    ],
)
def test_options_that_cannot_be_met(invoke: Invoke, own_folder: Path, options: tuple[str, ...], message: str) -> None:
    code, _, err = invoke("folder", str(own_folder), *options)
    assert code != 0
    assert message in err
    assert "Traceback" not in err


def test_a_broken_second_scan_keeps_the_first_frame(invoke: Invoke, own_folder: Path, read: Any) -> None:
    scan = own_folder / "clouds" / "0001.bin"
    scan.write_bytes(scan.read_bytes()[:-7])
    code, _, err = invoke("folder", str(own_folder), "--save", "own.rrd", "--on-bad-frame", "stop")
    assert code == 3
    assert "0001.bin" in err
    assert "1 of 2 frames" in err
    assert [frame for frame, _ in read(Path("own.rrd"), "image", "EncodedImage:blob")] == [0]


def test_given_miscalibration_arrives_as_given(invoke: Invoke, own_folder: Path, read: Any) -> None:
    invoke("folder", str(own_folder), "--miscalibrate", "0,0,3,0,0,0", "--save", "own.rrd")
    errors = [value.as_py()[0] for _, value in read(Path("own.rrd"), "error/rotation/initial", "Scalars:scalars")]
    np.testing.assert_allclose(errors, [3.0, 3.0], atol=1e-6)


def test_report_keeps_the_recording_where_no_other_place_is_named(invoke: Invoke, own_folder: Path) -> None:
    code, out, _ = invoke("folder", str(own_folder), "--range", "2/0.2", "--report", "report")
    assert code == 0, out
    assert "Report: report/index.html" in out
    assert not Path("recordings").exists()
    assert {path.name for path in Path("report").iterdir()} == {
        "index.html",
        "metrics.json",
        "pictures",
        "recording.rrd",
    }
    invoke("folder", str(own_folder), "--range", "2/0.2", "--save", "own.rrd", "--report", "other")
    assert Path("own.rrd").read_bytes() == Path("other/recording.rrd").read_bytes()


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("--color", "error"), "has none; give --range or --miscalibrate"),
        (("--log", "curves,pictures"), "'pictures' is not a part of a frame; choose from curves,"),
        (("--log", "curves", "--detail", "full"), "give both or neither"),
        (("--detail", "custom"), "give both or neither"),
    ],
)
def test_contents_that_make_no_sense_are_wrong_usage(
    invoke: Invoke, own_folder: Path, options: tuple[str, ...], sentence: str
) -> None:
    code, _, err = invoke("folder", str(own_folder), "--save", "own.rrd", *options)
    assert code == 2
    assert sentence in " ".join(err.split())
    assert not Path("own.rrd").exists()


class AskedError(BaseException):
    """Raised instead of running, with what was asked for."""


def test_several_frames_of_one_mount_are_solved_as_a_drive_by_default(
    invoke: Invoke, own_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from inspector.run.session import Session

    def run(session: Session) -> None:
        raise AskedError(session.drive)

    monkeypatch.setattr(Session, "run", run)
    one = ("--frames", "0")
    for given, drive in (
        (("--drive",), True),
        ((), True),
        (one, False),
        (("--drive", *one), True),
        (("--no-drive",), False),
    ):
        with pytest.raises(AskedError) as asked:
            invoke("folder", str(own_folder), "--save", "own.rrd", *given)
        assert asked.value.args == (drive,), given
    code, _, err = invoke("folder", str(own_folder), "--drive", "--range", "5/0.5", "--per-frame")
    assert code == 2 and "--drive needs one mount" in err


def test_help_names_what_a_drive_is_told_by(invoke: Invoke) -> None:
    assert "Usage: calib-inspect raw [OPTIONS] DATE DRIVE" in invoke("raw", "--help")[1]


def test_log_alone_means_custom_and_the_end_says_what_bytes_go_to(invoke: Invoke, own_folder: Path) -> None:
    code, out, _ = invoke("folder", str(own_folder), "--frames", "0", "--save", "own.rrd", "--log", "overlays,scene")
    assert code == 0
    assert "Kilobytes per frame: " in out
    assert "3D scene" in out
    assert "hourglass" not in out


@pytest.mark.parametrize(
    ("options", "code", "message"),
    [
        (("--bind", "0.0.0.0"), 2, "--bind needs --serve"),
        (("--serve", "--bind", "999.1.1.1"), 3, "is not an address of this machine"),
    ],
)
def test_an_address_to_serve_at_is_checked_before_weights_are_loaded(
    invoke: Invoke, own_folder: Path, monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...], code: int, message: str
) -> None:
    from calibnet.cascade.cascade import Cascade

    def load(*_: Any) -> None:
        raise AssertionError("too early")

    monkeypatch.setattr(Cascade, "load", staticmethod(load))
    found, _, err = invoke("folder", str(own_folder), *options)
    assert (found, message in err) == (code, True), err


def test_a_run_without_room_for_an_index_ends_with_its_result_and_report(
    invoke: Invoke, own_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_room(file: Path, *_: Any) -> None:
        raise indexing.NotIndexedError(file, "since the disk lacks 3 MB", "free some space")

    monkeypatch.setattr(stream, "index", no_room)
    code, out, err = invoke("folder", str(own_folder), "--save", "own.rrd", "--report", "page")
    assert code == 0, err
    assert "own.rrd has no index, since the disk lacks 3 MB" in err.replace("\n", " ")
    assert "Saved own.rrd" in out and "Kilobytes per frame" not in out
    assert out.splitlines()[-1].startswith("Verdict: ")
    assert Path("page/index.html").is_file()


def test_a_bag_is_calibrated_from_its_transforms(invoke: Invoke, tmp_path: Path, fakes: ModuleType) -> None:
    path = write_bag(tmp_path / "drive", "mcap", [fakes.make_frame(number, points=3000) for number in range(2)])
    code, out, err = invoke("bag", str(path), "--save", "bag.rrd", "--every", "0.5")
    assert code == 0, err
    assert "no reference" in out
    assert "/cam/image_raw/compressed (2) and /points (4): 2 frames, 2 of them at a standstill" in err
    code, out, err = invoke("bag", str(path), "--save", "again.rrd", "--range", "5/0.5", "--frames", "0")
    assert code == 0 and "no reference" not in out
    code, _, err = invoke("bag", str(path), "--headless", "--points", "/lidar")
    assert code == 3 and "there are: /points (4 PointCloud2)" in err


def test_a_folder_takes_its_guess_from_another_file(invoke: Invoke, own_folder: Path, tmp_path: Path) -> None:
    guess = tmp_path / "guess.yaml"
    guess.write_text("camera_from_lidar: {translation: [0, 0, 0], quaternion_xyzw: [0.5, -0.5, 0.5, 0.5]}\n")
    code, _, err = invoke("folder", str(own_folder), "--save", "own.rrd", "--guess", str(guess), "--fix", "x,y,z")
    assert code == 0, err
    assert "x, y, z fixed" in err
    code, _, err = invoke("folder", str(own_folder), "--headless", "--fix", "x,q")
    assert code == 2 and "'q' is not an axis" in err
