"""Running a row in this process, under a limit of memory and of time, and seeing what became of it and of its files."""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import resource
import signal
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

import psutil

from tests.hostile.rows import Row

SECONDS, GIGABYTES = 120, 1.5
"""Limits of one row; a busy machine takes long for nothing, and what hangs does so for ever."""


class TooSlowError(BaseException):
    """No ``Exception``, so that nothing on the way takes it for bad input."""


@dataclass(frozen=True)
class Outcome:
    """What became of a row.

    Attributes:
        code: of the exit; None where it never came.
        said: on stdout and stderr.
        lost: files that were there and are not what they were.
        megabytes: by which the process has grown at its largest.
        ended: ``"exit"``, ``"traceback"``, ``"hang"`` or ``"memory"``.
    """

    code: int | None
    said: str
    lost: tuple[str, ...]
    megabytes: float
    ended: str

    def verdict(self, row: Row) -> str:
        """``"as it should"``, or what is wrong."""
        if self.ended != "exit":
            return self.ended
        if self.lost:
            return f"lost {', '.join(self.lost)}"
        if self.code == 70 or "Traceback" in self.said:
            return "traceback"
        if any(not one.isprintable() and one not in "\n\r\t" for one in self.said):
            return "raw control characters"
        if self.code != row.code:
            return f"code {self.code} instead of {row.code}"
        missing = [word for word in row.words if word not in self.said.replace("\n", " ")]
        return f"does not say {missing[0]!r}" if missing else "as it should"


def try_row(row: Row, root: Path) -> Outcome:
    """Make the input and run the command in its folder."""
    from inspector.cli.errors import run
    from inspector.cli.main import cli

    command = row.make(root)
    before = _contents(root)
    out = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", errors="strict")
    process, ended, code = psutil.Process(), "exit", None
    at_start = process.memory_info().rss
    previous = Path.cwd()
    os.chdir(root)
    try:
        with _limits(process), contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
            try:
                code = int(run(cli, command))
            except TooSlowError:
                ended = "hang"
            except MemoryError:
                ended = "memory"
            except BaseException as error:
                ended = "traceback"
                out.write(f"\n{type(error).__name__}: {error}".encode("ascii", "backslashreplace").decode())
    finally:
        os.chdir(previous)
    out.flush()
    said = out.buffer.getvalue().decode("utf-8", "replace")  # type: ignore[attr-defined]
    after = _contents(root)
    lost = tuple(name for name, was in before.items() if after.get(name) != was and name not in row.replaced)
    return Outcome(code, said, lost, (process.memory_info().rss - at_start) / 1e6, ended)


@contextlib.contextmanager
def _limits(process: psutil.Process) -> Iterator[None]:
    def ring(_: int, __: FrameType | None) -> None:
        raise TooSlowError

    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    previous = signal.signal(signal.SIGALRM, ring)
    resource.setrlimit(resource.RLIMIT_AS, (process.memory_info().vms + int(GIGABYTES * (1 << 30)), hard))
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
        signal.signal(signal.SIGALRM, previous)


def _contents(root: Path) -> dict[str, str]:
    """What every path below a folder is: digest of a file, target of a link, kind of all else."""
    found = {}
    for path in sorted(root.rglob("*")):
        name = os.fsencode(path.relative_to(root)).decode("ascii", "backslashreplace")
        if path.is_symlink():
            found[name] = f"link to {os.readlink(path)}"  # noqa: PTH115 - as text
        elif path.is_file():
            size = path.stat().st_size
            content = path.read_bytes() if size < 64 << 20 else b""
            found[name] = f"{size} {hashlib.sha256(content).hexdigest()}"
        elif not path.is_dir():
            found[name] = "special"
    return found


def main() -> None:
    """Try every row against the code that is imported, and count how they end: ``python -m tests.hostile.tried``."""
    import tempfile
    from collections import Counter

    from tests.hostile.table import ROWS, prepared

    counts: Counter[str] = Counter()
    started = time.monotonic()
    with prepared(), tempfile.TemporaryDirectory() as base:
        for number, row in enumerate(ROWS):
            root = Path(base) / str(number)
            root.mkdir()
            try:
                outcome = try_row(row, root)
                verdict = outcome.verdict(row)
            except Exception as error:
                verdict = f"not tried ({type(error).__name__}: {error})"
            kind = verdict.split(" ")[0] if verdict.startswith(("lost", "code", "does not")) else verdict
            counts[kind] += 1
            if verdict != "as it should":
                sys.stdout.write(f"{row.what}: {verdict}\n")
                if "-v" in sys.argv:
                    sys.stdout.write(f"    {outcome.said.strip()[-300:]!r}\n")
    sys.stdout.write(f"{len(ROWS)} inputs in {time.monotonic() - started:.0f} s: {dict(counts.most_common())}\n")


if __name__ == "__main__":
    main()
