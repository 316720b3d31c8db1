"""The report's server: this machine only, its own files only."""

from __future__ import annotations

import http.client
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from inspector.report.serve import report_app
from inspector.serving.server import PageServer
from inspector.serving.viewer_files import VIEWER_FILES


@pytest.fixture
def server(tmp_path: Path) -> Iterator[PageServer]:
    report, viewer = tmp_path / "report", tmp_path / "viewer"
    (report / "pictures").mkdir(parents=True)
    viewer.mkdir()
    for name in ("index.html", "metrics.json", "recording.rrd", "pictures/worst_corrected.jpg", "private.txt"):
        (report / name).write_text(name)
    for name in VIEWER_FILES:
        (viewer / name).write_text(f"viewer {name}")
    (tmp_path / "secret.txt").write_text("secret")
    with PageServer(report_app(report, viewer)) as running:
        yield running


def get(
    server: PageServer, path: str, method: str = "GET", headers: dict[str, str] | None = None
) -> tuple[int, str, str]:
    address = urlsplit(server.address)
    connection = http.client.HTTPConnection(str(address.hostname), address.port, timeout=10)
    connection.request(method, address.path.rstrip("/") + path, headers=headers or {})
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
def test_report_and_viewer_are_served(server: PageServer, path: str, content: str, kind: str) -> None:
    assert get(server, path) == (200, content, kind)


@pytest.mark.parametrize(
    "path",
    ["/private.txt", "/../secret.txt", "/%2e%2e/secret.txt", "/viewer/../../secret.txt", "/pictures/", "//etc/passwd"],
)
def test_nothing_else_is_served(server: PageServer, path: str) -> None:
    status, content, _ = get(server, path)
    assert status == 404
    assert "secret" not in content


def test_head_answers_without_content(server: PageServer) -> None:
    assert get(server, "/viewer/re_viewer.js", method="HEAD") == (200, "", "text/javascript; charset=utf-8")


def test_a_part_of_the_recording_can_be_asked_for(server: PageServer) -> None:
    assert get(server, "/recording.rrd", headers={"Range": "bytes=2-4"})[:2] == (206, "cor")
