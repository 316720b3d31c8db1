"""The report's server: this machine only, its own files only."""

from __future__ import annotations

import http.client
import socket
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from inspector.report.serve import VIEWER_FILES, ReportServer, fetch_viewer, served_files


@pytest.fixture
def server(tmp_path: Path) -> Iterator[ReportServer]:
    report, viewer = tmp_path / "report", tmp_path / "viewer"
    (report / "pictures").mkdir(parents=True)
    viewer.mkdir()
    for name in ("index.html", "metrics.json", "recording.rrd", "pictures/worst_corrected.jpg", "private.txt"):
        (report / name).write_text(name)
    for name in VIEWER_FILES:
        (viewer / name).write_text(f"viewer {name}")
    (tmp_path / "secret.txt").write_text("secret")
    with ReportServer(served_files(report, viewer)) as running:
        yield running


def get(server: ReportServer, path: str, host: str | None = None, method: str = "GET") -> tuple[int, str, str]:
    address = urlsplit(server.address)
    connection = http.client.HTTPConnection(str(address.hostname), address.port, timeout=10)
    connection.request(method, path, headers={"Host": host} if host else {})
    answer = connection.getresponse()
    content = answer.read().decode()
    connection.close()
    return answer.status, content, str(answer.headers["Content-Type"])


@pytest.mark.parametrize(
    ("path", "content", "kind"),
    [
        ("/", "index.html", "text/html; charset=utf-8"),
        ("/index.html?x=1", "index.html", "text/html; charset=utf-8"),
        ("/metrics.json", "metrics.json", "application/json"),
        ("/recording.rrd", "recording.rrd", "application/octet-stream"),
        ("/pictures/worst_corrected.jpg", "pictures/worst_corrected.jpg", "image/jpeg"),
        ("/viewer/index.html", "viewer index.html", "text/html; charset=utf-8"),
        ("/viewer/re_viewer_bg.wasm", "viewer re_viewer_bg.wasm", "application/wasm"),
    ],
)
def test_report_and_viewer_are_served(server: ReportServer, path: str, content: str, kind: str) -> None:
    assert get(server, path) == (200, content, kind)


@pytest.mark.parametrize(
    "path",
    ["/private.txt", "/../secret.txt", "/%2e%2e/secret.txt", "/viewer/../../secret.txt", "/pictures/", "//etc/passwd"],
)
def test_nothing_else_is_served(server: ReportServer, path: str) -> None:
    status, content, _ = get(server, path)
    assert status == 404
    assert "secret" not in content


def test_head_answers_without_content(server: ReportServer) -> None:
    assert get(server, "/viewer/re_viewer.js", method="HEAD") == (200, "", "text/javascript")


def test_another_host_is_refused(server: ReportServer) -> None:
    """A web page could let its own name point to 127.0.0.1 and read the report through it."""
    assert get(server, "/", host="evil.example")[0] == 403


def test_only_this_machine_can_connect(server: ReportServer) -> None:
    address = urlsplit(server.address)
    assert address.hostname == "127.0.0.1"
    with pytest.raises(ConnectionRefusedError):  # another of this machine's addresses: all of 127/8 are its own
        socket.create_connection(("127.0.0.2", int(address.port or 0)), timeout=5)


def test_installed_rerun_hands_out_its_viewer(tmp_path: Path) -> None:
    fetch_viewer(tmp_path / "viewer")
    assert (tmp_path / "viewer" / "re_viewer_bg.wasm").read_bytes()[:4] == b"\0asm"
    assert {file.name for file in (tmp_path / "viewer").iterdir()} == set(VIEWER_FILES)
