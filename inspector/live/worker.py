"""Runs jobs beside the page, one at a time: the newest that somebody waits for, and the others when idle."""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import Awaitable, Callable, Coroutine
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

from calibnet.errors import CalibnetError

GRACE_S = 0.6
"""Seconds by which jobs that can wait are put off after every answer, so that a slider that moves on is served
first."""


class StoppedError(Exception):
    """The job was told to stop."""


class YieldedError(Exception):
    """The job makes room for one that somebody waits for."""


@dataclass(frozen=True)
class Job:
    """A job to compute.

    Attributes:
        name: name to show.
        compute: runs in the worker's thread; it may call its argument with (done, total), which raises `StoppedError`
            when the job is to stop, and `YieldedError` when it can wait and somebody waits for another.
        finish: runs in the server's thread, with the result.
    """

    name: str
    compute: Callable[[Callable[[int, int], None]], Any]
    finish: Callable[[Any], Awaitable[None]]


class Worker:
    """Runs jobs in a thread of its own.

    Attributes:
        busy: name of the running job; empty when idle.
        progress: done and total of the running job; None if unknown.
    """

    def __init__(
        self, changed: Callable[[], Coroutine[Any, Any, None]], failed: Callable[[str], Awaitable[None]]
    ) -> None:
        """Start idle.

        Args:
            changed: called when `busy` or `progress` has changed.
            failed: called with one sentence when a job fails.
        """
        self._changed, self._failed = changed, failed
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="live")
        self._next: Job | None = None
        self._later: list[Job] = []
        self._task: asyncio.Task[None] | None = None
        self._asked = asyncio.Event()
        self._stop = threading.Event()
        self.busy = ""
        self.progress: tuple[int, int] | None = None

    def ask(self, job: Job) -> None:
        """Run a job as soon as the running one ends; jobs that waited before are dropped."""
        self._next = job
        self._asked.set()
        self._wake()

    def ask_later(self, job: Job) -> None:
        """Run a job when nothing else waits, the newest first; it restarts after making room for another."""
        self._later.append(job)
        self._wake()

    def stop(self) -> None:
        """Stop the running job at its next report of progress, and drop those that wait."""
        self._next = None
        self._stop.set()

    def _wake(self) -> None:
        if self._task is None or self._task.done():
            self._task = asyncio.get_running_loop().create_task(self._run())

    async def idle(self) -> None:
        """Return when nothing runs or waits."""
        if self._task is not None:
            await self._task

    def close(self) -> None:
        """Stop the worker."""
        self._next, self._later = None, []
        self._stop.set()
        self._thread.shutdown(wait=True, cancel_futures=True)

    async def _run(self) -> None:
        loop = asyncio.get_running_loop()
        while self._next is not None or self._later:
            if self._next is None:
                self._asked.clear()
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(self._asked.wait(), GRACE_S)
            if self._next is None and not self._later:
                break  # closed meanwhile
            can_wait = self._next is None
            job, self._next = self._next or self._later.pop(), None
            self.busy, self.progress = job.name, None
            self._stop.clear()
            await self._changed()

            def tell(done: int, total: int, can_wait: bool = can_wait) -> None:
                if self._stop.is_set():
                    raise StoppedError
                if can_wait and self._next is not None:
                    raise YieldedError
                self.progress = (done, total)
                asyncio.run_coroutine_threadsafe(self._changed(), loop)

            try:
                await job.finish(await loop.run_in_executor(self._thread, job.compute, tell))
            except YieldedError:
                self._later.append(job)
            except StoppedError:
                await self._failed(f"Stopped: {job.name}.")
            except CalibnetError as error:
                await self._failed(str(error))
            except Exception as error:  # an internal error, which the page reports and survives
                await self._failed(
                    f"Internal error in calib-inspect ({type(error).__name__}: {error}). Please report it."
                )
            finally:
                self.busy, self.progress = "", None
            await self._changed()
