"""The web viewer of the installed Rerun."""

from __future__ import annotations

from pathlib import Path

from inspector.serving.viewer_files import VIEWER_FILES, fetch_viewer


def test_installed_rerun_hands_out_its_viewer(tmp_path: Path) -> None:
    fetch_viewer(tmp_path / "viewer")
    assert (tmp_path / "viewer" / "re_viewer_bg.wasm").read_bytes()[:4] == b"\0asm"
    assert {file.name for file in (tmp_path / "viewer").iterdir()} == set(VIEWER_FILES)
    assert (tmp_path / "viewer" / "re_viewer.js").read_text().startswith("console.debug = () => {};\n")
