"""A file that one process writes bit by bit, such as a recording: locked against others, with the earlier one kept.

A killed run leaves what it has written under the file's own name, and the earlier file under another name.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import secrets
from collections.abc import Iterator
from pathlib import Path

from filelock import FileLock, Timeout

from calibnet.runtime.writing import Kind, OutputError, check_output, hidden, remove_partials

PATIENCE_S = 0.2
"""Seconds to wait for a lock, whose last owner may just be ending."""


class Claim:
    """The right to write a file, from now until `release`.

    Attributes:
        path: the file.
        earlier: path of an earlier file of the same kind; None without one.
    """

    def __init__(self, path: Path, kind: Kind, patience_s: float = PATIENCE_S) -> None:
        """Claim a file that is new or of the same kind; it does not change before `begin`.

        Args:
            path: the file.
            kind: kind of its content.
            patience_s: seconds to wait for another process that writes it.

        Raises:
            OutputError: it must not be written (see `check_output`), or another process is writing it.
        """
        self.path, self.kind = path, kind
        self.earlier: Path | None = None
        self._lock: FileLock | None = None
        check_output(path, kind)
        self._lock = _lock(path, patience_s)

    @classmethod
    def of_new(cls, path: Path, kind: Kind) -> Claim:
        """Claim a file that does not exist yet: ``path``, or a name with a number such as ``demo-2.rrd``."""
        for number in itertools.count(1):
            candidate = path if number == 1 else path.with_stem(f"{path.stem}-{number}")
            if os.path.lexists(candidate):
                continue
            with contextlib.suppress(BusyError):
                claim = cls(candidate, kind, patience_s=0)  # the next name will do as well
                if not os.path.lexists(candidate):
                    return claim
                claim.release()  # another run has just finished
        raise AssertionError("unreachable: there is always another number")

    def begin(self) -> Path:
        """Rename an earlier file and make an empty one in its place; returns its path.

        Partial files of killed runs, see `write_whole`, are removed.

        Raises:
            OutputError: it must no longer be written.
            OSError: it cannot be written.
        """
        check_output(self.path, self.kind)
        remove_partials(self.path)  # left by a run that was killed; safe, since we have the lock
        if self.path.exists():
            earlier = self.path.with_stem(f"{self.path.stem}.earlier-{secrets.token_hex(4)}")
            self.path.rename(earlier)
            self.earlier = earlier
        os.close(os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
        return self.path

    def complete(self) -> bool:
        """Remove the earlier file, since the new one is complete; returns whether there was one."""
        replaced, self.earlier = self.earlier, None
        if replaced is not None:
            with contextlib.suppress(OSError):
                replaced.unlink()
        return replaced is not None

    def release(self) -> None:
        """Let others write the file; an earlier one keeps its new name."""
        lock, self._lock = self._lock, None
        if lock is not None:
            _unlock(lock)


class BusyError(OutputError):
    """Another process is writing the file."""


@contextlib.contextmanager
def locked(path: Path, patience_s: float = PATIENCE_S) -> Iterator[None]:
    """A context in which only this process writes a file, which is replaced as a whole repeatedly.

    Args:
        path: the file.
        patience_s: seconds to wait for another process.

    Raises:
        BusyError: another process has it for longer.
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
        lock = FileLock(path.with_name(f"{hidden(path)}lock"), timeout=patience_s)
        lock.acquire()
    except Timeout:
        raise BusyError(f"{path} is being written by another run; choose another name, or wait for it.") from None
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else str(error)
        raise OutputError(f"{path} cannot be written ({reason}); choose another path.") from None
    return lock


def _unlock(lock: FileLock) -> None:
    """Release a lock and remove its file.

    The file is removed while the lock is still held, after all work under it. A process that had opened it before gets
    a lock on a file without a name, which filelock (since 3.21) notices, and opens a new one.
    """
    with contextlib.suppress(OSError):
        Path(lock.lock_file).unlink()
    lock.release()
