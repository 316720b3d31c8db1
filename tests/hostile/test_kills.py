"""Kills at random moments, two processes on one output, a full disk: what was there stays, and what is new is whole."""

from __future__ import annotations

import os
import random
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from calibnet.runtime.claim import Claim
from calibnet.runtime.writing import Kind, OutputError, write_whole
from inspector.read.run import read_run
from tests import kills

SIZE = 4_000_000
WRITE_FOR_EVER = """
import sys
from pathlib import Path
from calibnet.runtime.writing import Kind, write_whole
print("started", flush=True)
number = 0
while True:
    number += 1
    digits = str(number).encode()
    write_whole(Path(sys.argv[1]), b'{"number": "' + digits * (4_000_000 // len(digits)) + b'"}', Kind.JSON)
"""
RECORD_ON_A_FULL_DISK = """
import resource, signal, sys
import numpy as np
import rerun as rr
from pathlib import Path
from rerun.blueprint import Blueprint
from inspector.cli import main
from inspector.record import flushing
from inspector.record.stream import Stream
flushing.FLUSH_TIMEOUT_S = 1.0
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (3_000_000, resource.RLIM_INFINITY))
stream = Stream("calib-inspect", "id", "title", [Path(sys.argv[1])], Blueprint())
code = 0
try:
    for number in range(100):
        stream.rec.log("a", rr.Image(np.random.default_rng(number).integers(0, 256, (1000, 1000), np.uint8)))
        stream.flush()
except flushing.RecordingLostError as error:
    print(error, flush=True)
    code = 3
main.leave(code)
"""
RECORD_FOR_EVER = """
import sys
from pathlib import Path
from calibnet.runtime.claim import Claim
from calibnet.runtime.writing import Kind
claim = Claim(Path(sys.argv[1]), Kind.RECORDING)
print("claimed", flush=True)
with claim.begin().open("ab", buffering=0) as file:
    while True:
        file.write(b"RRF2" * 250)
"""


def started(script: str, file: Path) -> subprocess.Popen[str]:
    """A process that has begun its work."""
    process = subprocess.Popen([sys.executable, "-c", script, str(file)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline()
    return process


def killed(process: subprocess.Popen[str], draw: random.Random) -> None:
    """The process killed within a fifth of a second."""
    time.sleep(draw.uniform(0, 0.2))
    os.kill(process.pid, signal.SIGKILL)
    process.wait()


@contextmanager
def files_of_at_most(size: int) -> Iterator[None]:
    """A disk that is full after so many bytes of a file."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    previous = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, previous)


def test_a_file_is_whole_whenever_its_writer_is_killed(tmp_path: Path) -> None:
    draw, file = random.Random(1), tmp_path / "out.json"
    file.write_bytes(b'{"earlier": true}')
    for _ in range(4):
        killed(started(WRITE_FOR_EVER, file), draw)
        content = file.read_bytes()
        assert content == b'{"earlier": true}' or (content.startswith(b'{"number": "') and content.endswith(b'"}'))
        assert len(content) in (17, *range(SIZE - 20, SIZE + 20))


def test_a_killed_recording_leaves_itself_and_the_earlier_one(tmp_path: Path) -> None:
    draw, file = random.Random(2), tmp_path / "run.rrd"
    file.write_bytes(b"RRF2 earlier")
    for number in range(1, 4):
        killed(started(RECORD_FOR_EVER, file), draw)
        aside = list(tmp_path.glob("run.earlier-*.rrd"))
        contents = [path.read_bytes() for path in [file, *aside] if path.exists()]
        assert contents.count(b"RRF2 earlier") == 1, f"after {number} kills"
        assert all(content[:4] in (b"RRF2", b"") for content in contents)


@pytest.mark.parametrize("kind", ["recording", "indexing"])
def test_a_killed_run_leaves_every_frame_that_was_recorded(kind: str, tmp_path: Path) -> None:
    """Many more by hand: ``python -m tests.kills``."""
    kills.killed(kills.KINDS[kind], tmp_path, random.Random(3))
    assert read_run(tmp_path / "run.rrd").frames


def test_two_processes_on_one_recording(tmp_path: Path) -> None:
    first = started(RECORD_FOR_EVER, tmp_path / "run.rrd")
    try:
        with pytest.raises(OutputError, match="being written by another run"):
            Claim(tmp_path / "run.rrd", Kind.RECORDING)
        claim = Claim.of_new(tmp_path / "run.rrd", Kind.RECORDING)
        assert claim.path.name == "run-2.rrd"
        claim.release()
    finally:
        first.kill()
        first.wait()
    Claim(tmp_path / "run.rrd", Kind.RECORDING).release()


def test_a_process_whose_recording_is_lost_says_so_and_ends(tmp_path: Path) -> None:
    command = [sys.executable, "-c", RECORD_ON_A_FULL_DISK, str(tmp_path / "run.rrd")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout[:42]) == (3, "The recording can no longer be written: the d"[:42]), done.stderr
    assert (tmp_path / "run.rrd").read_bytes()[:3] == b"RRF"


def test_a_full_disk_leaves_what_was_there(tmp_path: Path) -> None:
    file = tmp_path / "out.json"
    file.write_bytes(b'{"earlier": true}')
    with files_of_at_most(1000), pytest.raises(OSError, match="File too large") as caught:
        write_whole(file, b'{"new": "' + bytes(5000) + b'"}', Kind.JSON)
    assert caught.value.filename == str(file)
    assert file.read_bytes() == b'{"earlier": true}'
    assert list(tmp_path.iterdir()) == [file]
