"""One picture of the demo in the real viewer, without a window: no view may report an error."""

from __future__ import annotations

import contextlib
import io
import os
import socket
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from PIL import Image

VULKAN_FOLDERS = ("/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d")
PATIENCE_S = 60.0


@pytest.fixture
def viewer(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    if sys.platform.startswith("linux") and not any(list(Path(folder).glob("*.json")) for folder in VULKAN_FOLDERS):
        pytest.skip("no Vulkan driver: apt-get install -y mesa-vulkan-drivers")
    from rerun.experimental import ViewerClient

    # The viewer is found through PATH, which need not hold the environment's programs.
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with ViewerClient.spawn(headless=True, port=port, hide_welcome_screen=True) as client:
        yield client


def open_recording(viewer: Any, file: Path) -> None:
    viewer.open(str(file.resolve()))
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        with contextlib.suppress(TimeoutError):  # a busy machine answers late
            state = viewer.get_state()
            if not state.loading and state.recordings and state.recordings[0].timelines:
                viewer.set_time("frame", sequence=1, play_state="paused")
                return
        time.sleep(0.2)
    pytest.fail("the viewer did not load the recording")


def settled_screenshot(viewer: Any) -> np.ndarray:
    """The picture once it stays the same: data arrives in the viewer bit by bit."""
    deadline = time.monotonic() + PATIENCE_S
    previous = b""
    while time.monotonic() < deadline:
        with contextlib.suppress(TimeoutError):
            picture: bytes = viewer.take_screenshot()
            if picture == previous:
                break
            previous = picture
        time.sleep(0.3)
    return np.asarray(Image.open(io.BytesIO(previous)).convert("RGB"))


def test_the_first_picture_of_the_demo_is_complete(
    viewer: Any, record: Callable[..., Any], tmp_path: Path, fakes: ModuleType
) -> None:
    from calibnet.datasets.synthetic import SyntheticSequence

    file = tmp_path / "demo.rrd"
    record(file, length=2, sequence=SyntheticSequence(seed=0, length=2))
    open_recording(viewer, file)
    picture = settled_screenshot(viewer)
    reports = {view.name: view.reports for view in viewer.get_state().views if view.reports}
    assert not reports
    assert picture.shape == (1080, 1920, 3)
    third = picture[80:340]
    for left in (0, 640, 1280):  # three overlays side by side: colourful, not an empty view
        panel = third[:, left : left + 640].astype(int)
        assert (np.ptp(panel, axis=2) > 60).mean() > 0.1
