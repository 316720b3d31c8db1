"""One job at a time, and what waits."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

from inspector.live.worker import Job, Worker


def run(scenario: Callable[[Worker, list[str], list[str]], Any]) -> tuple[list[str], list[str]]:
    done: list[str] = []
    problems: list[str] = []

    async def changed() -> None:
        pass

    async def failed(text: str) -> None:
        problems.append(text)

    async def all_of_it() -> None:
        worker = Worker(changed, failed)
        await scenario(worker, done, problems)
        await worker.idle()
        worker.close()

    asyncio.run(all_of_it())
    return done, problems


def job(name: str, done: list[str], until: threading.Event | None = None) -> Job:
    def compute(_: Callable[[int, int], None]) -> str:
        if until is not None:
            assert until.wait(20)
        return name

    async def finish(result: str) -> None:
        done.append(result)

    return Job(name, compute, finish)


def test_of_those_that_wait_only_the_newest_runs_and_later_ones_all_the_newest_first() -> None:
    async def scenario(worker: Worker, done: list[str], _: list[str]) -> None:
        go = threading.Event()
        worker.ask(job("first", done, go))
        await asyncio.sleep(0)
        worker.ask_later(job("later 1", done))
        worker.ask_later(job("later 2", done))
        worker.ask(job("old", done))
        worker.ask(job("new", done))
        go.set()

    assert run(scenario)[0] == ["first", "new", "later 2", "later 1"]


def test_what_can_wait_makes_room_and_runs_again() -> None:
    async def scenario(worker: Worker, done: list[str], _: list[str]) -> None:
        running = threading.Event()

        def compute(tell: Callable[[int, int], None]) -> str:
            first = not running.is_set()
            running.set()
            for number in range(1_000 if first else 1):
                time.sleep(0.01)
                tell(number, 1_000)
            return "recorded"

        async def finish(result: str) -> None:
            done.append(result)

        worker.ask_later(Job("recording", compute, finish))
        await asyncio.to_thread(running.wait, 20)
        worker.ask(job("answer", done))

    assert run(scenario) == (["answer", "recorded"], [])


def test_that_a_job_is_done_is_told_before_the_next_may_begin() -> None:
    busy: list[str] = []

    async def all_of_it() -> None:
        async def changed() -> None:
            busy.append(worker.busy)

        async def failed(_: str) -> None: ...

        worker = Worker(changed, failed)
        worker.ask_later(job("recording", []))
        worker.ask(job("answer", []))
        await worker.idle()
        worker.close()

    asyncio.run(all_of_it())
    assert busy == ["answer", "", "recording", ""]


def test_a_job_that_tells_how_far_it_is_can_be_stopped() -> None:
    async def scenario(worker: Worker, done: list[str], _: list[str]) -> None:
        started = threading.Event()

        def compute(tell: Callable[[int, int], None]) -> None:
            for number in range(10_000_000):
                tell(number, 10_000_000)
                started.set()

        async def finish(_: object) -> None:
            done.append("finished")

        worker.ask(Job("long", compute, finish))
        await asyncio.to_thread(started.wait, 20)
        assert worker.busy == "long" and worker.progress is not None
        worker.stop()

    assert run(scenario) == ([], ["Stopped: long."])


def test_a_fault_is_said_and_the_next_job_runs() -> None:
    async def scenario(worker: Worker, done: list[str], _: list[str]) -> None:
        def compute(_: Callable[[int, int], None]) -> None:
            raise ZeroDivisionError("by zero")

        async def finish(_: object) -> None:
            done.append("finished")

        worker.ask(Job("bad", compute, finish))
        await worker.idle()
        worker.ask(job("good", done))

    done, problems = run(scenario)
    assert done == ["good"]
    assert problems == ["Internal error in calib-inspect (ZeroDivisionError: by zero). Please report it."]


def test_who_asks_while_a_job_is_put_off_is_served_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("inspector.live.worker.GRACE_S", 3600.0)

    async def scenario() -> list[str]:
        done: list[str] = []
        worker = Worker(_nothing, _nothing)
        worker.ask_later(job("later", done))
        await asyncio.sleep(0.01)
        worker.ask(job("now", done))
        async with asyncio.timeout(60):
            while not done:
                await asyncio.sleep(0.01)
        worker.close()
        for task in asyncio.all_tasks() - {asyncio.current_task()}:
            task.cancel()
        return done

    assert asyncio.run(scenario()) == ["now"]


async def _nothing(_: str = "") -> None:
    """Do nothing: nobody listens."""
