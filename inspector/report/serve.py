"""Serves one report: its page, pictures and recording, and the embedded viewer."""

from __future__ import annotations

from pathlib import Path

from starlette.applications import Starlette

from inspector.report.files import METRICS, PAGE, PICTURES, RECORDING, VIEWER
from inspector.serving.files import file_route
from inspector.serving.viewer_files import VIEWER_FILES


def served_files(report: Path, viewer: Path) -> dict[str, Path]:
    """The served files, by the path of their URL."""
    files = {f"/{name}": report / name for name in (PAGE, METRICS, RECORDING)}
    files |= {f"/{PICTURES}/{picture.name}": picture for picture in (report / PICTURES).glob("*.jpg")}
    files |= {f"/{VIEWER}/{name}": viewer / name for name in VIEWER_FILES}
    return {"/": report / PAGE, f"/{VIEWER}/": viewer / PAGE, **files}


def report_app(report: Path, viewer: Path) -> Starlette:
    """The app for `inspector.serving.server.PageServer`."""
    return Starlette(routes=[file_route(served_files(report, viewer))])
