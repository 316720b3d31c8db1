"""What a window sends that no page of ours does: it is told in a sentence, or ends that window alone."""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from unittest import mock

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from inspector.live import accept
from inspector.live.app import LiveApp
from inspector.live.session import LiveSession
from inspector.serving.server import PageServer

Make = Callable[..., LiveSession]
TEXTS = {
    "no JSON": "{",
    "nothing": "",
    "nested": "[" * 100_000,
    "a number of 9000 digits": '{"do": ' + "9" * 9000 + "}",
    "a list": "[]",
    "null": "null",
    "no word": "{}",
    "an unknown word": '{"do": "explode"}',
    "a word that is a list": '{"do": ["run"]}',
    "a word with escapes": '{"do": "\\u001b[2J"}',
    "half a character": '{"do": "\\ud800"}',
    "a pose of words": '{"do": "pose", "pose": ["a", "b", 0, 0, 0, 0]}',
    "a pose of five": '{"do": "pose", "pose": [0, 0, 0, 0, 0]}',
    "a pose of NaN": '{"do": "pose", "pose": [NaN, 0, 0, 0, 0, 0]}',
    "a pose of infinity": '{"do": "pose", "pose": [1e999, 0, 0, 0, 0, 0]}',
    "a pose of 400 digits": '{"do": "pose", "pose": [' + "9" * 400 + ", 0, 0, 0, 0, 0]}",
    "a pose that is a word": '{"do": "pose", "pose": "middle"}',
    "no pose": '{"do": "pose"}',
    "a stage that is infinite": '{"do": "run", "stage": 1e999}',
    "a stage that there is not": '{"do": "run", "stage": 9}',
    "a stage that is a list": '{"do": "run", "stage": [1]}',
    "a frame that is infinite": '{"do": "frame", "position": -1e999}',
    "a frame that is a word": '{"do": "frame", "position": "first"}',
    "a try that there is not": '{"do": "take", "try": 7, "step": 0}',
    "a try that is infinite": '{"do": "take", "try": 1e999, "step": 0}',
    "a range of NaN": '{"do": "random", "range": "nan/nan"}',
    "a range of 5000 digits": '{"do": "random", "range": "' + "9" * 5000 + '/1"}',
    "a look of words": '{"do": "look", "try": 0, "under": "a", "pixel": [1, 2]}',
    "a look at no try": '{"do": "look", "try": 0, "under": [' + "0, " * 15 + '0], "pixel": [1e999, 2]}',
    "a look under a number of 400 digits": '{"do": "look", "try": 0, "under": [' + "9" * 400 + '], "pixel": [1, 2]}',
    "an accepted try that there is not": '{"do": "accept", "try": 3, "step": 0, "sure": true}',
    "a message of a megabyte": '{"do": "' + "x" * 1_000_000 + '"}',
}


@pytest.fixture
def address(make: Make, tmp_path: Path) -> Iterator[str]:
    with PageServer(LiveApp(make(), tmp_path).asgi) as server:
        yield server.address.replace("http", "ws", 1)


@pytest.fixture(autouse=True)
def no_traceback(caplog: pytest.LogCaptureFixture) -> Iterator[None]:
    yield
    assert not [record for record in caplog.records if record.exc_info]


def heard_by(window: ClientConnection, kind: str) -> dict[str, Any]:
    """What a window hears next of a kind; whatever comes before is short and plain."""
    while True:
        heard: dict[str, Any] = json.loads(window.recv(timeout=60))
        assert heard["is"] == "hello" or len(json.dumps(heard)) < 10_000
        assert heard.get("text", "").isprintable()
        if heard["is"] == kind:
            return heard


@pytest.mark.parametrize("what", TEXTS)
def test_a_message_is_told_or_passed_over(what: str, address: str) -> None:
    with connect(f"{address}control") as other, connect(f"{address}control") as window:
        window.send(TEXTS[what])
        window.send(json.dumps({"do": "guess"}))
        assert heard_by(window, "state") and heard_by(other, "state")


@pytest.mark.parametrize("content", [b"\0" * 10, "x" * 20_000_000], ids=["bytes", "20 MB"])
def test_what_is_no_message_ends_no_other_window(content: bytes | str, address: str) -> None:
    with connect(f"{address}control") as other, connect(f"{address}control") as window:
        try:
            window.send(content)
            window.send(json.dumps({"do": "guess"}))
            heard_by(window, "state")
        except ConnectionClosed:
            other.send(json.dumps({"do": "guess"}))
        assert heard_by(other, "state")


@pytest.mark.parametrize("had", ["9" * 5000, "-1", "x", "1e9", "%D9%A3"])
def test_the_stream_begins_wherever_it_is_asked_to(had: str, address: str) -> None:
    with connect(f"{address}stream?from={had}") as viewer, pytest.raises(TimeoutError):
        viewer.recv(timeout=0.3)


def test_a_full_disk_is_told(address: str) -> None:
    full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "found.yaml")
    with mock.patch.object(accept, "write_whole", side_effect=full), connect(f"{address}control") as window:
        window.send(json.dumps({"do": "accept", "sure": True}))
        assert "found.yaml: No space left on device" in heard_by(window, "problem")["text"]
