"""`--serve`: a recording is given out while it grows, by one guarded port and nothing of Rerun's."""

from __future__ import annotations

import http.client
import threading
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import psutil
import pytest
from starlette.applications import Starlette

from calibnet.errors import ConfigError
from inspector.record.outputs import Outputs
from inspector.serving import viewer_files
from inspector.serving.recording import RECORDING, recording_app
from inspector.serving.server import PageServer


def get(address: str, path: str = "", **headers: str) -> http.client.HTTPResponse:
    parts = urlsplit(address)
    connection = http.client.HTTPConnection(str(parts.hostname), parts.port, timeout=20)
    connection.request("GET", parts.path + path, headers=headers)
    return connection.getresponse()


def happened() -> threading.Event:
    event = threading.Event()
    event.set()
    return event


@pytest.fixture
def grown(tmp_path: Path) -> Iterator[tuple[Path, threading.Event, str]]:
    file, ended = tmp_path / "run.rrd", threading.Event()
    file.write_bytes(b"RRF2 first")
    with PageServer(recording_app(file, tmp_path, happened(), ended)) as server:
        yield file, ended, server.address


def test_who_watches_from_before_the_first_frame_is_not_shown_an_earlier_run(tmp_path: Path) -> None:
    file, begun, ended = tmp_path / "run.rrd", threading.Event(), threading.Event()
    file.write_bytes(b"RRF2 earlier")
    with PageServer(recording_app(file, tmp_path, begun, ended)) as server:
        answer = get(server.address, RECORDING)
        file.write_bytes(b"RRF2 now")
        begun.set()
        assert answer.read(8) == b"RRF2 now"
        ended.set()
        assert answer.read() == b""


def test_a_recording_that_has_begun_may_not_be_there_yet(tmp_path: Path) -> None:
    file, ended = tmp_path / "run.rrd", threading.Event()
    with PageServer(recording_app(file, tmp_path, happened(), ended)) as server:
        answer = get(server.address, RECORDING)
        file.write_bytes(b"RRF2 now")
        assert answer.read(8) == b"RRF2 now"
        ended.set()
        assert answer.read() == b""


def test_who_watches_a_run_that_never_begins_is_let_go(tmp_path: Path) -> None:
    with PageServer(recording_app(tmp_path / "run.rrd", tmp_path, threading.Event(), happened())) as server:
        assert get(server.address, RECORDING).read() == b""


def test_who_watches_gets_what_is_recorded_and_then_the_end(grown: tuple[Path, threading.Event, str]) -> None:
    file, ended, address = grown
    answer = get(address, RECORDING)
    assert answer.read(10) == b"RRF2 first"
    with file.open("ab") as more:
        more.write(b" second")
    assert answer.read(7) == b" second"
    ended.set()
    assert answer.read() == b""


def test_who_watches_a_recording_that_gets_its_index_keeps_what_was_begun(
    grown: tuple[Path, threading.Event, str], tmp_path: Path
) -> None:
    file, ended, address = grown
    answer = get(address, RECORDING)
    assert answer.read(10) == b"RRF2 first"
    (tmp_path / "indexed").write_bytes(b"RRF2 with an index")
    (tmp_path / "indexed").replace(file)
    ended.set()
    assert answer.read() == b""
    assert get(address, RECORDING).read() == b"RRF2 with an index"


def test_one_port_behind_the_guard_and_no_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(viewer_files, "fetch_viewer", lambda folder: (folder / "index.html").write_text("viewer"))
    me = psutil.Process()
    others = set(me.children())  # of tests before this one
    before = {connection.laddr for connection in me.net_connections("inet") if connection.status == "LISTEN"}
    outputs = Outputs(serve=True)
    (file,) = outputs.open()
    try:
        file.write_bytes(b"RRF2")
        assert outputs.page is not None and not set(me.children()) - others
        after = {connection.laddr for connection in me.net_connections("inet") if connection.status == "LISTEN"}
        (port,) = after - before
        assert (port.ip, port.port) == ("127.0.0.1", urlsplit(outputs.page).port)
        assert get(outputs.page).read() == b"viewer"
        page = outputs.page.partition("?")[0]
        assert get(page, RECORDING, Host=f"evil.example:{port.port}").status == 403
        assert get(page, RECORDING, Origin="http://evil.example").status == 403
        assert get(f"http://127.0.0.1:{port.port}/{RECORDING}").status == 404
        assert get(page, RECORDING).read(4) == b"RRF2"
    finally:
        outputs.close()
    assert not file.exists(), "what was only served is not kept"


@pytest.mark.parametrize("bind", ["999.1.1.1", "nonsense", "", " ", "198.51.100.7", "a\nb", "x" * 300, "1:2:3"])
def test_an_address_that_is_none_is_one_sentence(bind: str) -> None:
    with pytest.raises(ConfigError, match=r"^--bind [^\n]+ is not an address of this machine; [^\n]+\.$"):
        PageServer(Starlette(), bind)


def test_beyond_this_machine_the_token_alone_is_asked_for(tmp_path: Path) -> None:
    (tmp_path / "index.html").write_text("viewer")
    with PageServer(recording_app(tmp_path / "run.rrd", tmp_path, happened(), threading.Event()), "0.0.0.0") as server:
        port = urlsplit(server.address).port
        assert get(server.address, Host=f"car.example:{port}").read() == b"viewer"
        assert get(server.address, Host=f"car.example:{port}", Origin="http://evil.example").status == 403
        assert get(f"http://127.0.0.1:{port}/").status == 404
