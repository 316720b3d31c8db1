"""Drives on Dask: another worker takes over from one that is killed, failures are tried twice, a stop is orderly."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from calibnet.errors import ConfigError
from calibnet.runtime.interruption import StopRequest
from inspector.fleet import engine as module
from inspector.fleet.engine import Engine, EngineError, run_all

CommClosedError = pytest.importorskip("distributed", reason="the extra [fleet] is not installed").comm.CommClosedError


def note(folder: Path, line: str) -> None:
    """Add a line to a file that all workers share."""
    with (folder / "log.txt").open("a") as file:
        file.write(f"{line}\n")


def square(piece: tuple[Path, int]) -> int:
    folder, number = piece
    note(folder, f"{number} {os.getpid()}")
    return number * number


def die_once(piece: tuple[Path, int]) -> int:
    """Number 1 ends its worker as the kernel does, the first time."""
    folder, number = piece
    note(folder, f"{number}")
    if number == 1 and not (folder / "died").exists():
        (folder / "died").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def always_die(piece: tuple[Path, int]) -> int:
    folder, number = piece
    note(folder, f"{number}")
    if number == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


class LastingError(Exception):
    """The input is to blame."""

    lasting = True


def fail_for_good(piece: tuple[Path, int]) -> int:
    folder, number = piece
    note(folder, f"{number}")
    raise LastingError("never")


def fail(piece: tuple[Path, int]) -> int:
    folder, number = piece
    note(folder, f"{number}")
    raise ValueError(f"no {number}")


def slow(piece: tuple[Path, int]) -> int:
    folder, number = piece
    note(folder, f"{number}")
    time.sleep(1.0)
    return number


def held_but_the_first(piece: tuple[Path, int]) -> int:
    """The first is done at once, others when the test opens."""
    folder, number = piece
    note(folder, f"{number}")
    while number and not (folder / "open").exists():
        time.sleep(0.05)
    return number


kept: list[bytearray] = []


def hoard(piece: tuple[Path, int]) -> int:
    """Keeps 100 MB of every piece."""
    folder, number = piece
    note(folder, f"{number} {os.getpid()}")
    kept.append(bytearray(os.urandom(1 << 20) * 100))
    return number


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    """Two workers of 600 MB, as the command starts them; once for all tests, for that takes longer than they do."""
    with module._client(Engine(2, memory="600MB")) as started:
        yield started


@pytest.fixture
def two(client: Any, monkeypatch: pytest.MonkeyPatch) -> Engine:
    """The engine that runs on them."""

    @contextmanager
    def shared(engine: Engine) -> Iterator[Any]:
        yield client

    monkeypatch.setattr(module, "_client", shared)
    return Engine(2)


@pytest.fixture(params=[0, 2])
def any_engine(request: pytest.FixtureRequest) -> Engine:
    """In this process, and on two workers."""
    return request.getfixturevalue("two") if request.param else Engine(0)


def lines(folder: Path) -> list[str]:
    return (folder / "log.txt").read_text().splitlines()


def test_every_piece_is_done_once(tmp_path: Path, any_engine: Engine) -> None:
    pieces = [(tmp_path, number) for number in range(6)]
    done = {outcome.work[1]: outcome.done for outcome in run_all(any_engine, square, pieces, StopRequest())}
    assert done == {number: number * number for number in range(6)}
    assert sorted(line.split()[0] for line in lines(tmp_path)) == list("012345")
    processes = {line.split()[1] for line in lines(tmp_path)}
    assert (str(os.getpid()) in processes) == (any_engine.workers == 0)


def test_what_fails_is_tried_twice(tmp_path: Path, any_engine: Engine) -> None:
    (outcome,) = run_all(any_engine, fail, [(tmp_path, 7)], StopRequest())
    assert str(outcome.error) == "no 7"
    assert lines(tmp_path) == ["7", "7"]


def test_what_would_fail_alike_is_tried_once(tmp_path: Path, any_engine: Engine) -> None:
    (outcome,) = run_all(any_engine, fail_for_good, [(tmp_path, 7)], StopRequest())
    assert str(outcome.error) == "never"
    assert lines(tmp_path) == ["7"]


def test_a_worker_that_is_killed_loses_only_what_it_was_doing(tmp_path: Path, two: Engine) -> None:
    pieces = [(tmp_path, number) for number in range(6)]
    done = sorted(outcome.done or 0 for outcome in run_all(two, die_once, pieces, StopRequest()))
    assert done == list(range(6))
    assert sorted(lines(tmp_path)) == ["0", "1", "1", "2", "3", "4", "5"], "nothing twice but what was lost"


def test_what_kills_two_workers_is_given_up(tmp_path: Path, two: Engine) -> None:
    pieces = [(tmp_path, number) for number in range(4)]
    outcomes = {outcome.work[1]: outcome for outcome in run_all(two, always_die, pieces, StopRequest())}
    assert type(outcomes[1].error).__name__ == "KilledWorker"
    assert [outcomes[number].done for number in (0, 2, 3)] == [0, 2, 3]
    assert lines(tmp_path).count("1") == 2


def test_a_stop_ends_after_what_is_under_way(tmp_path: Path, two: Engine, monkeypatch: pytest.MonkeyPatch) -> None:
    """However busy the machine is: what has begun is held until the rest is called off."""
    not_begun = module._not_begun

    def then_open(*arguments: Any) -> Iterator[Any]:
        yield from not_begun(*arguments)
        threading.Timer(1.0, (tmp_path / "open").touch).start()

    monkeypatch.setattr(module, "_not_begun", then_open)
    stop, done = StopRequest(), []
    for outcome in run_all(two, held_but_the_first, [(tmp_path, number) for number in range(20)], stop):
        done.append(outcome.done)
        stop.requested = True
    assert 1 <= len(done) <= 5, "the first, and of each of two workers what it does and what it has next"
    assert len(lines(tmp_path)) == len(done)


def test_servers_listen_on_this_machine_only(client: Any) -> None:
    addresses = [client.scheduler_info()["address"], *client.scheduler_info()["workers"]]
    assert client.dashboard_link.startswith("http://127.0.0.1:")
    nannies = [worker["nanny"] for worker in client.scheduler_info()["workers"].values()]
    assert all(address.startswith("tls://127.0.0.1:") for address in [*addresses, *nannies])


def test_workers_keep_no_samples_of_what_they_did(client: Any) -> None:
    callbacks = client.run(lambda dask_worker: list(dask_worker.periodic_callbacks))
    assert len(callbacks) == 2
    assert not any("profile" in names for names in callbacks.values())


def test_a_worker_whose_memory_fills_starts_anew_between_two_pieces(tmp_path: Path, two: Engine) -> None:
    pieces = [(tmp_path, number) for number in range(7)]  # one of the workers gets four
    done = sorted(outcome.done or 0 for outcome in run_all(two, hoard, pieces, StopRequest()))
    assert done == list(range(7))
    processes = [line.split()[1] for line in lines(tmp_path)]
    assert len(set(processes)) >= 3


def test_a_cluster_of_two_processes_is_used_by_its_address_until_it_goes_away(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    address, root = f"tcp://127.0.0.1:{module_port()}", Path(__file__).resolve().parents[3]
    environment = os.environ | {"PYTHONPATH": str(root)}
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": environment, "cwd": root}
    scheduler = ["scheduler", "--host", "127.0.0.1", "--port", address.rpartition(":")[2], "--no-dashboard"]
    worker = ["worker", address, "--host", "127.0.0.1", "--nthreads", "1", "--no-dashboard", "--no-nanny"]
    running = [
        subprocess.Popen([sys.executable, "-m", "dask", *arguments], **quiet)  # type: ignore[call-overload]
        for arguments in (scheduler, worker, worker)
    ]
    try:
        engine = Engine(0, address)
        done = sorted(one.done or 0 for one in run_all(engine, slow, [(tmp_path, n) for n in range(3)], StopRequest()))
        assert done == [0, 1, 2]
        with pytest.raises(EngineError, match=rf"The connection to the scheduler at {address} was lost"):
            for _ in run_all(engine, slow, [(tmp_path, number) for number in range(20)], StopRequest()):
                running[0].kill()
        assert "Traceback" not in capfd.readouterr().err
    finally:
        for process in running:
            process.kill()
        for process in running:
            process.wait(30)


def test_no_scheduler_is_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "PATIENCE_S", 1.0)
    with pytest.raises(ConfigError, match=r"No scheduler answers at tcp://127\.0\.0\.1"):
        list(run_all(Engine(0, f"tcp://127.0.0.1:{module_port()}"), square, [], StopRequest()))


def module_port() -> int:
    from inspector.programs import free_port

    return free_port()


class DyingWorkers:
    """A client some of whose workers die while they are prepared."""

    def __init__(self, deaths: int) -> None:
        self.deaths, self.asked = deaths, 0

    def register_plugin(self, plugin: Any, name: str) -> None:
        self.asked += 1
        if self.asked <= self.deaths:
            raise CommClosedError("Stream is closed")


def test_a_worker_that_dies_while_it_is_prepared_is_no_end() -> None:
    client = DyingWorkers(deaths=2)
    module._register(client, None)  # type: ignore[arg-type]
    assert client.asked == 3


def test_workers_that_always_die_before_they_begin_are_one_sentence() -> None:
    with pytest.raises(EngineError, match="Workers die before they start"):
        module._register(DyingWorkers(deaths=99), None)  # type: ignore[arg-type]
