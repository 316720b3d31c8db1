"""Pictures of the demo in the real viewer, without a window: no view may report an error."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image

from inspector.read.headless import LIGHT, HeadlessViewer
from inspector.read.screenshots import file_stem, smaller, take_pictures

PNG = smaller(cv2.imencode(".png", np.zeros((3, 4, 3), np.uint8))[1].tobytes())
VULKAN_FOLDERS = ("/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d")


def test_the_first_picture_of_the_demo_is_complete(record: Callable[..., Any], tmp_path: Path) -> None:
    from calibnet.datasets.synthetic import SyntheticSequence

    if sys.platform.startswith("linux") and not any(list(Path(folder).glob("*.json")) for folder in VULKAN_FOLDERS):
        pytest.skip("no Vulkan driver: apt-get install -y mesa-vulkan-drivers")
    file = tmp_path / "demo.rrd"
    record(file, length=2, sequence=SyntheticSequence(seed=0, length=2))
    with HeadlessViewer(theme=LIGHT) as viewer:
        viewer.open(file)
        assert (viewer.times("frame"), viewer.times("nothing")) == ((0, 1), None)
        viewer.show_time("frame", 1)
        picture = np.asarray(Image.open(io.BytesIO(viewer.picture())).convert("RGB"))
        complaints = {view.name: list(view.reports) for view in viewer.client.get_state().views if view.reports}
        pages = viewer.pages()
    assert not complaints
    assert picture.shape == (1080, 1920, 3)
    large, small = picture[240:520, :1180], picture[900:1030, 1200:]  # colourful, not empty views
    for panel in (large, small):
        assert (np.ptp(panel.astype(int), axis=2) > 60).mean() > 0.1
    assert picture[300:500, 1300:1850].mean() > 200, "the ground of the words is light"
    stems = [file_stem(page) for page in pages]
    assert stems[0] == "overview"
    assert {"cascade-all-stages", "hourglass-stage-3-channels", "3d-side-by-side"} <= set(stems)
    assert len(set(stems)) == len(stems)


def nested(root: str) -> dict[str, Any]:
    """A user's layout: our tabs beside a view of theirs that differs in nothing from the viewer's defaults."""
    tabs = {"container_kind": "Tabs", "contents": ["view/1", "container/inner"], "display_name": "left"}
    user = {"container_kind": "Horizontal", "contents": ["container/tabs", "view/9"]}
    inner = {"container_kind": "Tabs", "contents": ["view/2", "view/3"], "display_name": "Cascade"}
    return {
        "/viewport": {"ViewportBlueprint": {"root_container": root}},
        "/container/user": {"ContainerBlueprint": user},
        "/container/tabs": {"ContainerBlueprint": tabs},
        "/container/inner": {"ContainerBlueprint": inner},
        "/view/1": {"ViewBlueprint": {"display_name": "Overview"}},
        "/view/2": {"ViewBlueprint": {"display_name": "All stages"}},
        "/view/3": {"ViewBlueprint": {"display_name": "Stage 3"}},
    }


class Blueprints:
    def __init__(self, blueprint: dict[str, Any]) -> None:
        self.blueprint = blueprint

    def get_blueprint(self) -> Blueprints:
        return self

    def set_blueprint(self, blueprint: dict[str, Any], of: str) -> None:
        self.blueprint = blueprint


@pytest.mark.parametrize("root", ["tabs", "user"])
def test_pages_are_found_wherever_the_tabs_lie(root: str) -> None:
    viewer = HeadlessViewer()
    viewer.client = Blueprints(nested(root))  # type: ignore[assignment]
    assert viewer.pages() == [("Overview",), ("Cascade", "All stages"), ("Cascade", "Stage 3")]
    viewer.show(("Cascade", "Stage 3"))
    shown = viewer.client.get_blueprint().blueprint
    active = [shown[f"/container/{name}"]["ContainerBlueprint"]["active_tab"] for name in ("tabs", "inner")]
    assert active == ["container/inner", "view/3"]


def test_a_layout_without_tabs_is_one_page() -> None:
    viewer = HeadlessViewer()
    viewer.client = Blueprints({"/viewport": {"ViewportBlueprint": {"root_container": "gone"}}})  # type: ignore[assignment]
    assert viewer.pages() == [()]
    viewer.show(())


class Window:
    """A viewer of a recording without tabs and frames."""

    def __init__(self, *_: object) -> None:
        self.open = self.times = self.show = lambda *_: None
        self.pages, self.picture = lambda: [()], lambda: PNG

    def __enter__(self) -> Window:
        return self

    def __exit__(self, *_: object) -> None:
        pass


def test_the_only_page_of_a_recording_is_named_like_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("inspector.read.screenshots.HeadlessViewer", Window)
    (file,) = take_pictures(Path("training.rrd"), tmp_path, (4, 3))
    assert file == tmp_path / "training.png" and file.read_bytes() == PNG


def test_a_picture_is_written_with_the_same_pixels_in_fewer_bytes() -> None:
    rows, columns = np.mgrid[:240, :320]
    window = np.stack([rows % 256, columns % 256, (rows * columns) % 256, np.full_like(rows, 255)], -1).astype(np.uint8)
    buffer = io.BytesIO()
    Image.fromarray(window).save(buffer, "PNG", compress_level=1)
    small = smaller(buffer.getvalue())
    assert len(small) < 0.9 * len(buffer.getvalue())
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(small)).convert("RGB")), window[..., :3])
    assert smaller(small) == small
