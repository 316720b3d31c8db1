"""Runs drives on Dask, on a cluster of this machine or a running one, with an orderly end whatever happens.

Dask schedules, moves the work of a dead worker to another, retries failures and shows progress on its dashboard. This
module adds what a fleet needs: one drive per worker at a time, bounded threads and memory, and Ctrl-C.
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
"""Number of tries of a drive that fails or whose worker dies."""
FULL = 0.6
"""Share of a worker's memory beyond which a new process replaces it."""
POLL_S = 0.1
FETCH_S = 2.0
PATIENCE_S = 15.0
"""Seconds to wait for a scheduler's answer."""
SETTINGS = {
    "distributed.scheduler.worker-saturation": 1.0,  # a worker holds only the drive it runs, so no more can be lost
    "distributed.scheduler.allowed-failures": TRIES - 1,
    "distributed.admin.tick.limit": "1h",  # do not look fifty times a second whether the machine is busy
    "distributed.admin.tick.interval": "1s",
    "distributed.worker.memory.terminate": 0.95,
    "distributed.worker.profile.enabled": False,  # samples of the stack would take 3 MB per drive
    "distributed.deploy.lost-worker-timeout": "1000h",  # or a worker that takes long to restart is given up for good
}


class EngineError(CalibnetError):
    """The cluster is gone or cannot be reached."""


@dataclass(frozen=True)
class Engine:
    """Where drives run.

    Attributes:
        workers: number of processes on this machine; 0 runs them one after the other in this process, without Dask.
        scheduler: address of a running scheduler to use instead.
        memory: memory of a worker, in bytes or as a text such as ``"4GB"``; ``"auto"`` for its share of the machine.
        prepare: called in every worker before its first drive with the number of threads to use, or 0 for no limit.
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
    """The result of one piece of work, or the error that prevented it."""

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
    """Run all pieces, in any order; after a stop is requested, only those that a worker has begun.

    Args:
        engine: where to run them.
        act: function to call with a piece, importable by workers.
        pieces: pieces of work.
        stop: request to stop.
        tell: called with sentences for the user, for instance on the dashboard.

    Raises:
        ConfigError: the extra is not installed, or there is no scheduler.
        EngineError: the connection to the scheduler was lost.
    """
    if not engine.workers and engine.scheduler is None:
        yield from _here(engine, act, pieces, stop)
        return
    with _client(engine) as client:
        if client.dashboard_link and engine.scheduler is None:
            tell(f"Progress of every worker: {client.dashboard_link}")
        if engine.scheduler is not None and not client.scheduler_info()["workers"]:
            tell("The scheduler has no workers yet; drives will start when one connects.")
        yield from _on(client, act, pieces, stop)


def _here(
    engine: Engine, act: Callable[[Work], Done], pieces: Sequence[Work], stop: StopRequest
) -> Iterator[Outcome[Work, Done]]:
    """Run the pieces one after the other in this process."""
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
    """Whether another try would fail too, according to the error's attribute ``lasting``."""
    return bool(getattr(error, "lasting", False))


def _on_a_worker(act: Callable[[Work], Done], piece: Work) -> Outcome[Work, Done]:
    """Run a piece on a worker with enough memory; one without retires first, and its nanny starts a new one.

    An error that is not lasting is raised, so that Dask tries again.

    Libraries may hold on to memory after their work. At this moment nothing runs, so nothing is lost by retiring;
    beyond a share of 0.8 Dask would assign the worker no more work, and beyond 0.95 kill it in the middle of a piece. A
    worker that simply exited would count as a failed try of its piece, and all workers fill up at about the same time.
    """
    from distributed import Reschedule, get_worker

    worker = get_worker()
    limit = worker.memory_manager.memory_limit
    if limit and worker.nanny and worker.monitor.get_process_memory() > FULL * limit:
        time.sleep(FETCH_S)  # lets the scheduler fetch the previous result, which this worker holds
        worker.loop.add_callback(_retire, worker)
        raise Reschedule
    try:
        return Outcome(piece, act(piece))
    except Exception as error:
        if is_lasting(error):
            return Outcome(piece, error=error)
        raise


async def _retire(worker: Any) -> None:
    """Tell the scheduler, and exit; an orderly close of a worker sometimes never ends."""
    leave = {"close_workers": False, "remove": True, "stimulus_id": f"memory-{time.time()}"}
    await worker.scheduler.retire_workers(workers=[worker.address], **leave)
    os._exit(0)


def _not_begun(client: Client, works: dict[Any, Any]) -> list[Any]:
    """The pieces that no worker has begun."""
    begun = {str(key) for keys in client.processing().values() for key in keys}
    return [future for future in works if str(future.key) not in begun and not future.done()]


def _register(client: Client, plugin: Any) -> None:
    """Have every worker prepared, now or when it connects; one that dies meanwhile is replaced and tried again.

    Raises:
        EngineError: it happens again and again.
    """
    for rest in reversed(range(1 + TRIES)):
        try:
            client.register_plugin(plugin, name="calib-inspect")
            return
        except OSError:  # Dask's error for a closed connection
            if not rest:
                raise EngineError(
                    "Workers die before they start; give them more memory with --memory, or use fewer --workers."
                ) from None
            time.sleep(POLL_S)


def _lost(client: Client) -> EngineError:
    where = client.scheduler.address if client.scheduler is not None else "the scheduler"
    return EngineError(
        f"The connection to the scheduler at {where} was lost, and with it the running drives; start it again."
    )


@contextmanager
def _client(engine: Engine) -> Iterator[Client]:
    """A client of the cluster, and the cluster itself if it is ours."""
    require_extra("distributed", "bokeh", "cryptography")
    import dask
    from distributed import Client, LocalCluster
    from distributed.security import Security

    for name in ("distributed", "distributed.client"):  # Dask gives some of them levels of their own
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
            # not Dask's MALLOC_TRIM_THRESHOLD_, which halves the speed of networks; a drive returns memory at its end
            stack.enter_context(dask.config.set({**SETTINGS, "distributed.nanny.pre-spawn-environ": environment}))
            cluster = stack.enter_context(
                LocalCluster(
                    n_workers=engine.workers,
                    threads_per_worker=1,
                    memory_limit=engine.memory,
                    host=LOCALHOST,
                    protocol="tls://",  # or other users of this machine could run code on the scheduler
                    security=Security.temporary(),
                    dashboard_address=f"{LOCALHOST}:0",
                    silence_logs=logging.CRITICAL,
                )
            )
            client = stack.enter_context(Client(cluster))
            _register(client, _worker_plugin(engine.prepare, engine.threads, ours=True))
        yield client


def _worker_plugin(prepare: Callable[[int], None], threads: int, ours: bool) -> Any:
    """A plugin that prepares every worker when it starts, replacements included."""
    from distributed import WorkerPlugin

    class Prepared(WorkerPlugin):
        def setup(self, worker: Any) -> None:
            if ours:  # Ctrl-C reaches all processes of the terminal; workers end when the command tells them
                signal.signal(signal.SIGINT, signal.SIG_IGN)
            prepare(threads)

    return Prepared()
