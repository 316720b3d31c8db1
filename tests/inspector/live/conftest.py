"""A live session on frames without data sets or weights, and one way to talk to it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from calibnet.geometry import MiscalibrationRange
from inspector.live.accept import Target
from inspector.live.session import LiveSession
from inspector.live.workspace import Workspace
from inspector.run.start import Start
from tests.support.fakes import FakeCascade, FakeSequence

RANGE = MiscalibrationRange(5, 0.5)


Make = Callable[..., LiveSession]


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody moves on: what can wait does not."""
    monkeypatch.setattr("inspector.live.worker.GRACE_S", 0.0)


@pytest.fixture
def make(tmp_path: Path) -> Iterator[Make]:
    """A session: ``make(length=3, as_is=False, cascade=None, target=None, stream=None)``."""
    made: list[LiveSession] = []

    def session(
        length: int = 3, as_is: bool = False, cascade: Any = None, target: Target | None = None, **given: Any
    ) -> LiveSession:
        workspace = Workspace(FakeSequence(length, first=4), range(length), Start(RANGE, 1, as_is=as_is))
        target = target or Target(tmp_path / "out" / "calibration.corrected.yaml")
        made.append(LiveSession(workspace, cascade or FakeCascade(), target, RANGE, **given))
        return made[-1]

    yield session
    for one in made:
        one.close()


@pytest.fixture
def heard_after() -> Callable[..., list[dict[str, Any]]]:
    """What a session tells after messages, once it is idle."""

    def talk(session: LiveSession, *messages: dict[str, Any]) -> list[dict[str, Any]]:
        heard: list[dict[str, Any]] = []

        async def hear(message: dict[str, Any]) -> None:
            heard.append(message)

        async def say() -> None:
            session.tell = hear
            for message in messages:
                answer = await session.act(message)
                heard.extend([answer] if answer is not None else [])
                await session.idle()

        asyncio.run(say())
        return heard

    return talk
