"""How a run ends: by itself, by a signal, by a bad frame, by a full disk; and what is kept then."""

from __future__ import annotations

import io
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from rerun.chunk import RrdReader
from rich.console import Console

from calibnet.errors import ConfigError, DatasetError
from inspector import programs
from inspector.read.file import RecordingFile
from inspector.read.run import read_run
from inspector.record import outputs as outputs_module
from inspector.record.outputs import Outputs, has_display
from inspector.run.progress import frame_progress

Read = Callable[..., list[tuple[Any, Any]]]

LONG_RUN = """
import importlib.util, sys
from pathlib import Path
spec = importlib.util.spec_from_file_location("fakes", sys.argv[1])
fakes = importlib.util.module_from_spec(spec)
sys.modules["fakes"] = fakes
spec.loader.exec_module(fakes)
from rich.console import Console
from calibnet.geometry import MiscalibrationRange
from inspector.cli.run import finish
from inspector.record.contents import Contents, Detail
from inspector.record.outputs import Outputs, has_display
from inspector.record.recording import RunDescription
from inspector.run.session import Session
from inspector.run.start import Start
outputs = Outputs(Path(sys.argv[2]))
session = Session(sequence=fakes.FakeSequence(100_000), positions=range(100_000), cascade=fakes.FakeCascade(),
                  start=Start(MiscalibrationRange(5, 0.5)), outputs=outputs, contents=Contents.of(Detail.FULL),
                  description=RunDescription("fake/00", {"seed": 0}), console=Console(quiet=True))
sys.exit(finish(session.run(), outputs, None))
"""

SEVERAL_FRAMES = 16_000_000
"""Bytes of a file that has more than two frames in full detail, of some 3 MB each."""


def start_long_run(file: Path) -> subprocess.Popen[str]:
    """Record for ever; return once a few frames are on disk."""
    command = [sys.executable, "-c", LONG_RUN, str(Path(__file__).parents[2] / "support" / "fakes.py"), str(file)]
    pipe = subprocess.PIPE
    process = subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True)
    deadline = time.monotonic() + 60.0
    while not file.exists() or file.stat().st_size < SEVERAL_FRAMES:
        assert process.poll() is None, process.communicate()[1]
        assert time.monotonic() < deadline, "nothing was recorded"
        time.sleep(0.05)
    return process


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_closes_the_recording(tmp_path: Path, read: Read, number: signal.Signals) -> None:
    file = tmp_path / "run.rrd"
    process = start_long_run(file)
    process.send_signal(number)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert f"Saved {file}" in out
    assert "Traceback" not in err
    RrdReader(file).store()  # needs the footer
    frames = [frame for frame, _ in read(file, "image", "EncodedImage:blob")]
    assert frames == list(range(len(frames)))
    assert f"{len(frames)} frames in" in out


def test_a_killed_run_leaves_what_it_had_recorded(tmp_path: Path) -> None:
    file = tmp_path / "run.rrd"
    process = start_long_run(file)
    process.kill()
    process.communicate(timeout=60)
    # the kill may cut the last chunk short, which Rerun's own reader refuses
    chunks = RecordingFile(file).chunks("image")
    assert sum(chunk.to_record_batch().num_rows for chunk in chunks) >= 2


SMALL: dict[str, Any] = {"detail": "overview", "stages": (5,), "strides": (32,)}
"""As little of a frame as can be recorded."""


class BrokenSequence:
    """Raises as a data set would when a file is cut short."""

    name, rig = "fake/broken", "a fake car"

    def __init__(self, inner: Any, bad: int | tuple[int, ...]) -> None:
        self.inner, self.bad = inner, (bad,) if isinstance(bad, int) else bad

    def __len__(self) -> int:
        return len(self.inner)

    def __getitem__(self, position: int) -> Any:
        if position in self.bad:
            raise DatasetError("velodyne/000002.bin is cut short; copy it again.")
        return self.inner[position]


def test_a_bad_frame_keeps_those_before_it(
    record: Callable[..., Any], tmp_path: Path, read: Read, fakes: ModuleType
) -> None:
    file = tmp_path / "run.rrd"
    with pytest.raises(DatasetError, match=r"000002\.bin is cut short.* \(2 of 4 frames\)") as failure:
        record(file, length=4, **SMALL, sequence=BrokenSequence(fakes.FakeSequence(4), bad=2), stop_on_bad_frame=True)
    assert str(file) in str(failure.value)
    assert [frame for frame, _ in read(file, "image", "EncodedImage:blob")] == [0, 1]


def test_bad_frames_are_skipped_named_and_counted(
    record: Callable[..., Any], tmp_path: Path, read: Read, fakes: ModuleType
) -> None:
    file = tmp_path / "run.rrd"
    summary = record(file, length=5, **SMALL, sequence=BrokenSequence(fakes.FakeSequence(5), bad=(0, 2)))
    assert summary.frames == 3 and [bad.frame for bad in summary.skipped] == [0, 2]
    assert "2 frames skipped because they could not be used: 0, 2." in summary.lines()
    assert [frame for frame, _ in read(file, "image", "EncodedImage:blob")] == [1, 3, 4]
    told = read(file, "skipped", "TextLog:text")
    assert [frame for frame, _ in told] == [0, 2] and "cut short" in told[1][1].as_py()[0]


class NumberedFrom1(BrokenSequence):
    """Frames whose files are numbered from 1 on."""

    def index_of(self, position: int) -> int:
        return position + 1

    def __getitem__(self, position: int) -> Any:
        return replace(super().__getitem__(position), index=position + 1)


def test_a_frame_that_cannot_be_read_has_the_number_that_its_file_has(
    record: Callable[..., Any], tmp_path: Path, read: Read, fakes: ModuleType
) -> None:
    file = tmp_path / "run.rrd"
    summary = record(file, length=5, **SMALL, sequence=NumberedFrom1(fakes.FakeSequence(5), bad=2))
    assert [bad.frame for bad in summary.skipped] == [3]
    assert [frame for frame, _ in read(file, "image", "EncodedImage:blob")] == [1, 2, 4, 5]
    assert [frame for frame, _ in read(file, "skipped", "TextLog:text")] == [3]


def test_half_of_the_frames_are_too_many_to_skip(record: Callable[..., Any], tmp_path: Path, fakes: ModuleType) -> None:
    with pytest.raises(DatasetError, match=r"2 of 4 frames cannot be used.*Frame 1: .*Frame 3: .*cut short") as failure:
        record(tmp_path / "run.rrd", length=4, **SMALL, sequence=BrokenSequence(fakes.FakeSequence(4), bad=(1, 3)))
    assert "(2 of 4 frames) is in" in str(failure.value)


def test_a_bad_first_frame_leaves_an_older_file_alone(
    record: Callable[..., Any], tmp_path: Path, fakes: ModuleType
) -> None:
    file = tmp_path / "run.rrd"
    file.write_bytes(b"an older recording")
    with pytest.raises(DatasetError):
        record(file, length=1, **SMALL, sequence=BrokenSequence(fakes.FakeSequence(1), bad=0))
    assert file.read_bytes() == b"an older recording"


def test_a_full_disk_stops_in_time_and_leaves_what_was_recorded(
    record: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "run.rrd"
    free = iter([1 << 40, 1 << 40, 1000, 1000])

    class Usage:
        def __init__(self, _: Path) -> None:
            self.free = next(free)

    monkeypatch.setattr(outputs_module.shutil, "disk_usage", Usage)
    with pytest.raises(ConfigError, match=r"is full.*2 of 4 frames"):
        record(file, length=4, **SMALL)
    assert [frame.index for frame in read_run(file).frames] == [0, 1], "there is no room for an index, and none needed"
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("value", ["off", "0", "False"])
def test_a_rerun_that_is_switched_off_is_said_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, value: str
) -> None:
    monkeypatch.setenv("RERUN", value)
    with pytest.raises(ConfigError, match="switches Rerun off"):
        Outputs(tmp_path / "run.rrd").check()
    assert not list(tmp_path.iterdir())


def test_outputs_refuse_what_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for bad in (tmp_path, tmp_path / "file" / "run.rrd", Path(os.devnull)):
        with pytest.raises(ConfigError, match=r"^[^\n]+ (cannot be written|not a file)[^\n]+\.$"):
            Outputs(bad).check()
    target = tmp_path / "new" / "run.rrd"
    Outputs(target).check()
    assert target.parent.is_dir()
    assert not target.exists()


@pytest.mark.parametrize("url", ["rerun+http://127.0.0.1:1/proxy", "http://127.0.0.1", "nonsense"])
def test_connect_says_when_nobody_listens(url: str) -> None:
    with pytest.raises(ConfigError, match=r"No viewer listens|not a valid address"):
        Outputs(connect=url).check()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="displays are named by DISPLAY on Linux only")
def test_a_display_that_is_not_there_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("DISPLAY", ":4711")
    assert not has_display()
    monkeypatch.setenv("DISPLAY", "elsewhere:10.0")
    assert has_display()


def test_a_viewer_that_does_not_start_leaves_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(programs, "rerun_binary", lambda: "false")
    assert len(Outputs(tmp_path / "run.rrd", viewer=True).open()) == 1
    with pytest.raises(ConfigError, match="did not start"):
        Outputs(viewer=True).open()


def test_a_bar_shows_a_foreign_name_as_it_is() -> None:
    shown = io.StringIO()
    with frame_progress(Console(file=shown, width=100)) as progress:
        progress.add_task("a [red]b[/] \x1b[2J\nTr: 1", total=1)
    assert "a [red]b[/] \\x1b[2J\\nTr: 1" in shown.getvalue()
    assert "\x1b" not in shown.getvalue()
