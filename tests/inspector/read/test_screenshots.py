"""Pictures of the demo in the real viewer, without a window: no view may report an error."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from inspector.read.screenshots import HeadlessViewer, file_stem

VULKAN_FOLDERS = ("/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d")


def test_the_first_picture_of_the_demo_is_complete(record: Callable[..., Any], tmp_path: Path) -> None:
    from calibnet.datasets.synthetic import SyntheticSequence

    if sys.platform.startswith("linux") and not any(list(Path(folder).glob("*.json")) for folder in VULKAN_FOLDERS):
        pytest.skip("no Vulkan driver: apt-get install -y mesa-vulkan-drivers")
    file = tmp_path / "demo.rrd"
    record(file, length=2, sequence=SyntheticSequence(seed=0, length=2))
    with HeadlessViewer() as viewer:
        viewer.open(file)
        viewer.show_time("frame", 1)
        picture = np.asarray(Image.open(io.BytesIO(viewer.picture())).convert("RGB"))
        complaints = {view.name: list(view.reports) for view in viewer.client.get_state().views if view.reports}
        pages = viewer.pages()
    assert not complaints
    assert picture.shape == (1080, 1920, 3)
    third = picture[80:280]
    for left in (0, 640, 1280):  # three overlays side by side: colourful, not an empty view
        panel = third[:, left : left + 640].astype(int)
        assert (np.ptp(panel, axis=2) > 60).mean() > 0.1
    stems = [file_stem(page) for page in pages]
    assert stems[0] == "overview"
    assert {"cascade-all-stages", "hourglass-stage-3", "3d-side-by-side"} <= set(stems)
    assert len(set(stems)) == len(stems)
