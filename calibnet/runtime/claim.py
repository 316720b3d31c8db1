"""A file that one process writes bit by bit, as a recording is: locked against others, and the earlier one put aside.

A run that is killed leaves what it had written under the file's own name, and what was there before under another.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import secrets
from collections.abc import Iterator
from pathlib import Path

from filelock import FileLock, Timeout

from calibnet.runtime.writing import Kind, OutputError, check_output, remove_partials

PATIENCE_S = 0.2
"""How long a lock is waited for: the last run that had it may just be ending."""


class Claim:
    """The right to write a file, from now until `release`.

    Attributes:
        path: the file.
        earlier: where a file of the same kind lies that was there before; None without one.
    """

    def __init__(self, path: Path, kind: Kind, patience_s: float = PATIENCE_S) -> None:
        """Claim a file that is new or of the same kind; nothing of it changes before `begin`.

        Args:
            path: the file.
            kind: what it holds.
            patience_s: how long another process that writes it is waited for.

        Raises:
            OutputError: it may not be written (see `check_output`), or another process is writing it.
        """
        self.path, self.kind = path, kind
        self.earlier: Path | None = None
        self._lock: FileLock | None = None
        check_output(path, kind)
        self._lock = _lock(path, patience_s)

    @classmethod
    def of_new(cls, path: Path, kind: Kind) -> Claim:
        """Claim a file that is not there yet: ``path``, or with a number before its ending, ``demo-2.rrd``."""
        for number in itertools.count(1):
            candidate = path if number == 1 else path.with_stem(f"{path.stem}-{number}")
            if os.path.lexists(candidate):
                continue
            with contextlib.suppress(BusyError):
                claim = cls(candidate, kind, patience_s=0)  # the next name is as good
                if not os.path.lexists(candidate):
                    return claim
                claim.release()  # another run has just ended
        raise AssertionError("numbers do not end")

    def begin(self) -> Path:
        """Put an earlier file aside and make an empty one in its place; returns its path.

        What a killed run left half written beside it, see `write_whole`, goes.

        Raises:
            OutputError: it may not be written any more.
            OSError: it cannot be.
        """
        check_output(self.path, self.kind)
        remove_partials(self.path)  # of a run that was killed at its end: we have the lock
        if self.path.exists():
            earlier = self.path.with_stem(f"{self.path.stem}.earlier-{secrets.token_hex(4)}")
            self.path.rename(earlier)
            self.earlier = earlier
        os.close(os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
        return self.path

    def complete(self) -> bool:
        """Remove the earlier file, as the new one is whole; returns whether there was one."""
        replaced, self.earlier = self.earlier, None
        if replaced is not None:
            with contextlib.suppress(OSError):
                replaced.unlink()
        return replaced is not None

    def release(self) -> None:
        """Let others write the file; an earlier one stays where it was put."""
        lock, self._lock = self._lock, None
        if lock is not None:
            _unlock(lock)


class BusyError(OutputError):
    """Another process writes the file."""


@contextlib.contextmanager
def locked(path: Path, patience_s: float = PATIENCE_S) -> Iterator[None]:
    """Be the only process that writes a file, which is replaced as a whole again and again, while this lasts.

    Args:
        path: the file.
        patience_s: how long another process is waited for.

    Raises:
        BusyError: another process has it, for longer than that.
        OutputError: the folder cannot be written.
    """
    lock = _lock(path, patience_s)
    try:
        yield
    finally:
        _unlock(lock)


def _lock(path: Path, patience_s: float) -> FileLock:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        lock = FileLock(path.with_name(f".{path.name}.lock"), timeout=patience_s)
        lock.acquire()
    except Timeout:
        raise BusyError(f"{path} is being written by another run; choose another name, or wait for it.") from None
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else str(error)
        raise OutputError(f"{path} cannot be written ({reason}); choose another path.") from None
    return lock


def _unlock(lock: FileLock) -> None:
    """Release a lock and leave no file of it.

    The file goes while the lock is still held, and all work under it is done. Whoever had opened it before then gets a
    lock on a file without a name, which filelock (from 3.21 on) notices, and it opens a new one.
    """
    with contextlib.suppress(OSError):
        Path(lock.lock_file).unlink()
    lock.release()
