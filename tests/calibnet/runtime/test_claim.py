"""Two processes on one recording, and what a kill leaves."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from calibnet.runtime.claim import BusyError, Claim
from calibnet.runtime.writing import Kind, OutputError

HEAD = b"RRF2 earlier"


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_a_claimed_file_is_nobody_elses(tmp_path: Path) -> None:
    claim = Claim(tmp_path / "run.rrd", Kind.RECORDING)
    with pytest.raises(BusyError, match="being written by another run"):
        Claim(tmp_path / "run.rrd", Kind.RECORDING)
    claim.release()
    Claim(tmp_path / "run.rrd", Kind.RECORDING).release()
    assert not names(tmp_path), "neither a file nor a lock is left of a run without a frame"


def test_the_earlier_file_goes_only_when_the_new_one_is_whole(tmp_path: Path) -> None:
    file = tmp_path / "run.rrd"
    file.write_bytes(HEAD)
    claim = Claim(file, Kind.RECORDING)
    assert file.read_bytes() == HEAD, "nothing changes before the first frame"
    claim.begin().write_bytes(b"RRF2 new")
    assert claim.earlier is not None
    assert claim.earlier.read_bytes() == HEAD
    claim.release()
    assert names(tmp_path) == {"run.rrd", claim.earlier.name}, "a run that did not end keeps both"

    claim = Claim(file, Kind.RECORDING)
    claim.begin().write_bytes(b"RRF2 newer")
    assert claim.complete()
    claim.release()
    assert file.read_bytes() == b"RRF2 newer"
    assert len(names(tmp_path)) == 2, "what the run before had put aside stays"


def test_what_a_killed_run_was_writing_goes_and_nothing_else(tmp_path: Path) -> None:
    kept = {
        ".run.rrd.partial",
        ".run.rrd.b.abcdefgh.partial",
        ".run.rrd.abcdefghi.partial",
        ".other.rrd.abcdefgh.partial",
    }
    for name in {".run.rrd.a1b2c3_4.partial", *kept}:
        (tmp_path / name).write_bytes(HEAD)
    claim = Claim(tmp_path / "run.rrd", Kind.RECORDING)
    claim.begin()
    claim.complete()
    claim.release()
    assert names(tmp_path) == {"run.rrd", *kept}


def test_names_of_ours_never_collide(tmp_path: Path) -> None:
    (tmp_path / "demo.rrd").write_bytes(HEAD)
    first, second = (Claim.of_new(tmp_path / "demo.rrd", Kind.RECORDING) for _ in range(2))
    assert (first.path.name, second.path.name) == ("demo-2.rrd", "demo-3.rrd")
    first.release()
    second.release()


@pytest.mark.parametrize("content", [b"my notes", b'{"a": 1}', b"\x89PNG\r\n"])
def test_a_file_of_another_kind_is_not_claimed(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "run.rrd").write_bytes(content)
    with pytest.raises(OutputError, match=r"is not a recording but .*--overwrite"):
        Claim(tmp_path / "run.rrd", Kind.RECORDING)
    assert (tmp_path / "run.rrd").read_bytes() == content
    assert names(tmp_path) == {"run.rrd"}


CLAIM_MANY = """
import sys
from pathlib import Path
from calibnet.runtime.claim import Claim
from calibnet.runtime.writing import Kind
claims = [Claim.of_new(Path(sys.argv[1]) / "demo.rrd", Kind.RECORDING) for _ in range(20)]
for claim in claims:
    claim.begin().write_text(claim.path.name)
print(*(claim.path.name for claim in claims), flush=True)
sys.stdin.read()
"""


def test_processes_that_start_at_once_get_different_names(tmp_path: Path) -> None:
    command, pipe = [sys.executable, "-c", CLAIM_MANY, str(tmp_path)], subprocess.PIPE
    processes = [subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) for _ in range(2)]
    taken: list[str] = []
    for process in processes:
        assert process.stdout is not None
        taken += process.stdout.readline().split()
    for process in processes:
        process.communicate(timeout=60)
    assert len(set(taken)) == 40
    assert all((tmp_path / name).read_text() == name for name in taken)
