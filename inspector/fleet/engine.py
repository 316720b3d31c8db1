"""Drives on Dask: a cluster on this machine, or one that runs somewhere, and an orderly end whatever happens to it.

Dask schedules, moves the work of a worker that dies to another, tries again what fails, and shows on its dashboard how
far it is. Here is only what a fleet adds: one drive at a time a worker, bounded threads and memory, and Ctrl-C.
"""

from __future__ import annotations

import asyncio
import logging
import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from calibnet.errors import CalibnetError, ConfigError
from calibnet.runtime.interruption import StopRequest
from calibnet.runtime.threads import cores
from inspector.fleet.extra import require_extra
from inspector.programs import LOCALHOST

if TYPE_CHECKING:
    from distributed import Client

Work = TypeVar("Work")
Done = TypeVar("Done")

TRIES = 2
"""Tries of a drive that fails, and of one whose worker dies."""
FULL = 0.6
"""Share of a worker's memory beyond which another process takes its place."""
POLL_S = 0.1
FETCH_S = 2.0
PATIENCE_S = 15.0
"""For a scheduler to answer."""
SETTINGS = {
    "distributed.scheduler.worker-saturation": 1.0,  # a worker has what it does and no more: that is all it can lose
    "distributed.scheduler.allowed-failures": TRIES - 1,
    "distributed.admin.tick.limit": "1h",  # a busy machine is no news, and not looked for fifty times a second
    "distributed.admin.tick.interval": "1s",
    "distributed.worker.memory.terminate": 0.95,
    "distributed.worker.profile.enabled": False,  # samples of the stack, kept for an hour: 3 MB a drive
    "distributed.deploy.lost-worker-timeout": "1000h",  # or one that takes long to come back is given up for ever
}


class EngineError(CalibnetError):
    """The cluster is gone, or cannot be had."""


@dataclass(frozen=True)
class Engine:
    """Where drives are done.

    Attributes:
        workers: processes on this machine; 0 does them one after the other in this process, without Dask.
        scheduler: address of one that runs already, instead.
        memory: bytes, or a text such as ``"4GB"``, that a worker may have; ``"auto"`` for its share of the machine.
        prepare: called in every worker before its first drive, with the threads it may use or 0 to leave that alone.
    """

    workers: int
    scheduler: str | None = None
    memory: int | str = "auto"
    prepare: Callable[[int], None] = field(default=lambda threads: None)

    @property
    def threads(self) -> int:
        """Threads of each worker on this machine."""
        return max(1, cores() // max(1, self.workers))


@dataclass(frozen=True)
class Outcome(Generic[Work, Done]):
    """What came of one piece of work: its result, or why there is none."""

    work: Work
    done: Done | None = None
    error: BaseException | None = None


def run_all(
    engine: Engine,
    act: Callable[[Work], Done],
    pieces: Sequence[Work],
    stop: StopRequest,
    tell: Callable[[str], None] = lambda sentence: None,
) -> Iterator[Outcome[Work, Done]]:
    """Do every piece, in any order; after a stop is requested only those that a worker has begun.

    Args:
        engine: where.
        act: what to do with a piece, importable by workers.
        pieces: what to do it with.
        stop: asks to end.
        tell: hears sentences for the user, for instance where the dashboard is.

    Raises:
        ConfigError: the extra is not installed, or there is no scheduler.
        EngineError: the scheduler went away.
    """
    if not engine.workers and engine.scheduler is None:
        yield from _here(engine, act, pieces, stop)
        return
    with _client(engine) as client:
        if client.dashboard_link and engine.scheduler is None:
            tell(f"Progress of every worker: {client.dashboard_link}")
        if engine.scheduler is not None and not client.scheduler_info()["workers"]:
            tell("The scheduler has no workers yet; drives begin when one comes.")
        yield from _on(client, act, pieces, stop)


def _here(
    engine: Engine, act: Callable[[Work], Done], pieces: Sequence[Work], stop: StopRequest
) -> Iterator[Outcome[Work, Done]]:
    """One after the other: what the engine is measured against."""
    engine.prepare(0)
    for piece in pieces:
        if stop.requested:
            return
        for rest in reversed(range(TRIES)):
            try:
                outcome = Outcome(piece, act(piece))
            except Exception as error:
                outcome = Outcome(piece, error=error)
                if rest and not is_lasting(error):
                    continue
            yield outcome
            break


def _on(
    client: Client, act: Callable[[Work], Done], pieces: Sequence[Work], stop: StopRequest
) -> Iterator[Outcome[Work, Done]]:
    from distributed import CancelledError, as_completed

    run = f"{os.getpid()}-{time.time_ns():x}"
    works = {
        client.submit(_on_a_worker, act, piece, key=f"drive-{run}-{number}", retries=TRIES - 1, pure=False): piece
        for number, piece in enumerate(pieces)
    }
    waiting = as_completed(list(works))
    stopping = False
    while works:
        for future in waiting.next_batch(block=False):
            if future not in works:
                continue
            piece = works.pop(future)
            try:
                outcome = future.result()
            except (CancelledError, asyncio.CancelledError):
                if not stop.requested:
                    raise _lost(client) from None
                continue
            except Exception as error:
                outcome = Outcome(piece, error=error)
            future.release()
            yield outcome
        if client.status not in ("running", "connecting"):
            raise _lost(client)
        if stop.requested and not stopping:
            stopping = True
            for future in _not_begun(client, works):
                del works[future]
                future.cancel()
        time.sleep(POLL_S)


def is_lasting(error: Exception) -> bool:
    """Whether another try would fail alike, as the error says by an attribute ``lasting``."""
    return bool(getattr(error, "lasting", False))


def _on_a_worker(act: Callable[[Work], Done], piece: Work) -> Outcome[Work, Done]:
    """Do a piece on a worker that has room; one whose memory is taken retires first, and its nanny starts another.

    An error that is not lasting is raised, so that Dask tries again.

    Libraries may keep some memory of whatever they did. Nothing is under way at this moment, so nothing is lost; beyond
    0.8 Dask would give the worker nothing any more, and beyond 0.95 end it in the middle. A worker that simply ended
    would count against its piece, which finds the next one as full, for all fill alike.
    """
    from distributed import Reschedule, get_worker

    worker = get_worker()
    limit = worker.memory_manager.memory_limit
    if limit and worker.nanny and worker.monitor.get_process_memory() > FULL * limit:
        time.sleep(FETCH_S)  # for the result of the piece before, which lies here
        worker.loop.add_callback(_retire, worker)
        raise Reschedule
    try:
        return Outcome(piece, act(piece))
    except Exception as error:
        if is_lasting(error):
            return Outcome(piece, error=error)
        raise


async def _retire(worker: Any) -> None:
    """Take leave of the scheduler, and end; a worker that closes in order sometimes never does."""
    leave = {"close_workers": False, "remove": True, "stimulus_id": f"memory-{time.time()}"}
    await worker.scheduler.retire_workers(workers=[worker.address], **leave)
    os._exit(0)


def _not_begun(client: Client, works: dict[Any, Any]) -> list[Any]:
    """Those that no worker has."""
    begun = {str(key) for keys in client.processing().values() for key in keys}
    return [future for future in works if str(future.key) not in begun and not future.done()]


def _register(client: Client, plugin: Any) -> None:
    """Have every worker prepared, now or when it comes; one that dies meanwhile is replaced, and asked again.

    Raises:
        EngineError: it happens again and again.
    """
    for rest in reversed(range(1 + TRIES)):
        try:
            client.register_plugin(plugin, name="calib-inspect")
            return
        except OSError:  # as Dask says that a connection was closed
            if not rest:
                raise EngineError(
                    "Workers die before they begin; see whether the machine has memory for them."
                ) from None
            time.sleep(POLL_S)


def _lost(client: Client) -> EngineError:
    where = client.scheduler.address if client.scheduler is not None else "the scheduler"
    return EngineError(f"The scheduler at {where} went away, and what it was doing with it.")


@contextmanager
def _client(engine: Engine) -> Iterator[Client]:
    """A client of the cluster, and the cluster itself where it is ours."""
    require_extra("distributed", "bokeh", "cryptography")
    import dask
    from distributed import Client, LocalCluster
    from distributed.security import Security

    for name in ("distributed", "distributed.client"):  # it gives some of them levels of their own
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    with ExitStack() as stack:
        if engine.scheduler is not None:
            try:
                client = stack.enter_context(Client(engine.scheduler, timeout=PATIENCE_S))
            except (OSError, ValueError, TimeoutError) as error:
                raise ConfigError(
                    f"No scheduler answers at {engine.scheduler} ({type(error).__name__}); start one with "
                    "`dask scheduler`, or leave --scheduler out."
                ) from None
            _register(client, _worker_plugin(engine.prepare, 0, ours=False))
        else:
            environment = {name: str(engine.threads) for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS")}
            environment["MALLOC_TRIM_THRESHOLD_"] = "65536"  # give back what a large drive took
            stack.enter_context(dask.config.set({**SETTINGS, "distributed.nanny.pre-spawn-environ": environment}))
            cluster = stack.enter_context(
                LocalCluster(
                    n_workers=engine.workers,
                    threads_per_worker=1,
                    memory_limit=engine.memory,
                    host=LOCALHOST,
                    protocol="tls://",  # who reaches a scheduler runs code on it: other users of this machine, too
                    security=Security.temporary(),
                    dashboard_address=f"{LOCALHOST}:0",
                    silence_logs=logging.CRITICAL,
                )
            )
            client = stack.enter_context(Client(cluster))
            _register(client, _worker_plugin(engine.prepare, engine.threads, ours=True))
        yield client


def _worker_plugin(prepare: Callable[[int], None], threads: int, ours: bool) -> Any:
    """What every worker does when it starts, those that take the place of others included."""
    from distributed import WorkerPlugin

    class Prepared(WorkerPlugin):
        def setup(self, worker: Any) -> None:
            if ours:  # Ctrl-C reaches the whole terminal; the command tells its workers when to end
                signal.signal(signal.SIGINT, signal.SIG_IGN)
            prepare(threads)

    return Prepared()
