"""The server of pages: this machine only, this host only, and nothing without the token."""

from __future__ import annotations

import http.client
import socket
import stat
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from inspector.serving.browser import opened_page
from inspector.serving.guard import inline_scripts
from inspector.serving.server import MOST_CONNECTIONS, PageServer


async def page(request: Request) -> PlainTextResponse:
    return PlainTextResponse(request.url.path)


async def echo(socket: WebSocket) -> None:
    await socket.accept()
    await socket.send_text(await socket.receive_text())
    await socket.close()


@pytest.fixture(scope="module")
def server() -> Iterator[PageServer]:
    with PageServer(Starlette(routes=[WebSocketRoute("/live", echo), Route("/{path:path}", page)])) as running:
        yield running


def status(server: PageServer, path: str | None = None, **headers: str) -> int:
    address = urlsplit(server.address)
    connection = http.client.HTTPConnection(str(address.hostname), address.port, timeout=10)
    connection.request("GET", address.path if path is None else path, headers=headers)
    answer = connection.getresponse()
    answer.read()
    connection.close()
    return answer.status


def test_the_app_knows_nothing_of_the_token(server: PageServer) -> None:
    address = urlsplit(server.address)
    connection = http.client.HTTPConnection(str(address.hostname), address.port, timeout=10)
    connection.request("GET", f"{address.path}a/b?c=d")
    answer = connection.getresponse()
    assert (answer.status, answer.read()) == (200, b"/a/b")
    assert "default-src 'self'" in str(answer.headers["content-security-policy"])
    assert answer.headers["referrer-policy"] == "no-referrer"
    connection.close()


@pytest.mark.parametrize("path", ["/", "/live", "/wrong/", "//", "/%00/"])
def test_without_the_token_nothing_is_found(server: PageServer, path: str) -> None:
    assert status(server, path) == 404


def test_tokens_differ_and_are_long(server: PageServer) -> None:
    other = PageServer(Starlette())
    tokens = {urlsplit(one.address).path.strip("/") for one in (server, other)}
    assert len(tokens) == 2 and min(map(len, tokens)) >= 24


@pytest.mark.parametrize(
    "host",
    ["evil.example", "localhost:{port}.evil.example", "127.0.0.1", "127.0.0.1:1", "localhost:x.evil.com", ""],
)
def test_another_host_is_refused(server: PageServer, host: str) -> None:
    """A web page could let its own name point to 127.0.0.1 and read the page through it."""
    port = urlsplit(server.address).port
    assert status(server, Host=host.format(port=port)) == 403
    assert status(server, Host=f"localhost:{port}") == 200


def test_another_origin_is_refused(server: PageServer) -> None:
    assert status(server, Origin="http://evil.example") == 403
    assert status(server, Origin=server.address.rstrip("/").rpartition("/")[0]) == 200


def test_websockets_are_guarded_alike(server: PageServer) -> None:
    live = server.address.replace("http:", "ws:") + "live"
    with connect(live) as socket_:
        socket_.send("hello")
        assert socket_.recv() == "hello"
    address = urlsplit(server.address)
    for uri, origin in ((f"ws://{address.netloc}/live", None), (live, "http://evil.example")):
        with pytest.raises(InvalidStatus) as refused, connect(uri, origin=origin):  # type: ignore[arg-type]
            pass
        assert refused.value.response.status_code == 403


def test_only_this_machine_can_connect(server: PageServer) -> None:
    address = urlsplit(server.address)
    assert address.hostname == "127.0.0.1"
    with pytest.raises(ConnectionRefusedError):  # another of this machine's addresses: all of 127/8 are its own
        socket.create_connection(("127.0.0.2", int(address.port or 0)), timeout=5)


def test_it_ends_with_its_context() -> None:
    with PageServer(Starlette(routes=[Route("/", page)])) as running:
        assert status(running) == 200
        address = urlsplit(running.address)
        waiting = socket.create_connection((str(address.hostname), int(address.port or 0)), timeout=5)
    waiting.close()  # a client that says nothing does not hold it
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection((str(address.hostname), int(address.port or 0)), timeout=5)


@pytest.mark.parametrize("bind", ["localhost", "127.0.0.2", "::1"])
def test_other_addresses_of_this_machine_alone_are_guarded_alike(bind: str) -> None:
    with PageServer(Starlette(routes=[Route("/", page)]), bind) as running:
        assert status(running) == 200
        assert status(running, Host=f"evil.example:{urlsplit(running.address).port}") == 403


@pytest.mark.parametrize(("bind", "shown"), [("0.0.0.0", ""), ("::", ""), ("::1", "::1"), ("localhost", "127.0.0.1")])
def test_the_printed_address_is_one_to_come_to(bind: str, shown: str) -> None:
    with PageServer(Starlette(routes=[Route("/", page)]), bind) as running:
        assert urlsplit(running.address).hostname == (shown or socket.gethostname().lower())
        assert status(running) == 200


def test_pages_may_compile_the_viewer_and_evaluate_nothing_else(server: PageServer) -> None:
    address = urlsplit(server.address)
    connection = http.client.HTTPConnection(str(address.hostname), address.port, timeout=10)
    connection.request("GET", address.path)
    policy = str(connection.getresponse().headers["content-security-policy"])
    connection.close()
    scripts = next(part.split() for part in policy.split(";") if part.split()[0] == "script-src")
    assert scripts[1:] == ["'self'", "'wasm-unsafe-eval'"]


def test_scripts_within_a_page_are_named_by_their_hash(tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text("<!doctype html><script src='x.js'></script><script>alert(1)</script>")
    digest = "'sha256-bhHHL3z2vDgxUt0W3dWQOrprscmda2Y5pLsLg4GF+pI='"  # base64 of what sha256sum says of alert(1)
    assert inline_scripts(page) == digest
    with PageServer(Starlette(), pages=[page]) as running:
        address = urlsplit(running.address)
        connection = http.client.HTTPConnection(str(address.hostname), address.port, timeout=10)
        connection.request("GET", address.path)
        assert f"'wasm-unsafe-eval' {digest};" in str(connection.getresponse().headers["content-security-policy"])
        connection.close()


def test_the_token_is_on_no_command_line(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    with opened_page("http://127.0.0.1:1/secret/") as file:
        (given,) = opened
        assert "secret" not in given and given == file.as_uri()
        assert "http://127.0.0.1:1/secret/" in file.read_text()
        assert stat.S_IMODE(file.stat().st_mode) == 0o600 and stat.S_IMODE(file.parent.stat().st_mode) == 0o700
    assert not file.exists()


@pytest.mark.parametrize("sent", [b"", b"GET / HTTP/1.1\r\nHost: "])
def test_clients_that_send_no_request_do_not_keep_others_out(sent: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("inspector.serving.server.KEEP_ALIVE_S", 1)
    with PageServer(Starlette(routes=[WebSocketRoute("/live", echo), Route("/{path:path}", page)])) as server:
        address = urlsplit(server.address)
        place = (str(address.hostname), address.port or 0)
        with connect(f"{server.address.replace('http', 'ws')}live") as live:
            idle = [socket.create_connection(place, timeout=10) for _ in range(MOST_CONNECTIONS)]
            for one in idle:
                one.sendall(sent)
            assert [one.recv(1) for one in idle] == [b""] * MOST_CONNECTIONS  # the server has hung up
            assert status(server) == 200
            live.send("still here")
            assert live.recv(10) == "still here"
