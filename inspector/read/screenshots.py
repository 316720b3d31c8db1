"""Pictures of a recording's tabs, taken in the real viewer without a window.

The README's pictures come from here (``calib-inspect pictures``), so they never age.
"""

from __future__ import annotations

import contextlib
import io
import re
import subprocess
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Final

from PIL import Image
from rerun.experimental import ViewerClient

from calibnet.errors import ConfigError
from calibnet.runtime.writing import Kind, write_whole
from inspector import entities
from inspector.programs import free_port, own_address, rerun_binary, start_program

PATIENCE_S: Final = 120.0
PAUSE_S: Final = 0.3
VULKAN_HINT: Final = "without a graphics card it needs a Vulkan driver; Debian: apt-get install -y mesa-vulkan-drivers"

Page = tuple[str, ...]
"""Names of the tabs that lead to a page, outer first, for instance ``("Cost volumes", "Stage 3 (±5°/0.5 m)")``."""


class HeadlessViewer:
    """A viewer without a window that shows one recording; a context manager that ends its process.

    Attributes:
        client: Rerun's own interface to it.
    """

    client: ViewerClient

    def __init__(self, width: int = 1920, height: int = 1080) -> None:
        """Say how large the window would be, in pixels."""
        self._size = f"{width}x{height}"
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> HeadlessViewer:
        host, port = own_address(), free_port()
        command = [rerun_binary(), "--headless", "--port", str(port), "--bind", host, "--window-size", self._size]
        try:
            self._process = start_program([*command, "--hide-welcome-screen"], port, host)
        except ConfigError as error:
            raise ConfigError(f"{error} ({VULKAN_HINT})") from None
        self.client = ViewerClient.connect(f"rerun+http://{host}:{port}/proxy")
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        if self._process is not None:
            self._process.terminate()
            self._process.wait()

    def open(self, recording: Path) -> None:
        """Load a recording.

        Raises:
            ConfigError: the viewer does not load it.
        """
        self.client.open(str(recording.resolve()))
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            with contextlib.suppress(TimeoutError):  # a busy machine answers late
                state = self.client.get_state()
                if not state.loading and state.recordings and state.recordings[0].timelines:
                    return
            time.sleep(PAUSE_S)
        raise ConfigError(f"The viewer did not load {recording}; does `rerun {recording}` open it?")

    def show_time(self, timeline: str, value: int) -> None:
        """Stand at a place of a timeline, paused."""
        self.client.set_time(timeline, sequence=value, play_state="paused")

    def pages(self) -> list[Page]:
        """Every page of every tab, as the blueprint orders them; one without a name where nothing has tabs."""
        blueprint = self._blueprint()
        outer = list(_outer_tabs(blueprint, _root(blueprint)))
        return [page for tabs in outer for page in _pages(blueprint, tabs)] or [()]

    def show(self, page: Page) -> None:
        """Bring a page to the front."""
        if not page:
            return
        blueprint = self._blueprint()
        outer = _outer_tabs(blueprint, _root(blueprint))
        here = next(tabs for tabs in outer if page[0] in (_name(blueprint, part) for part in _parts(blueprint, tabs)))
        for name in page:
            shown = next(part for part in _parts(blueprint, here) if _name(blueprint, part) == name)
            _container(blueprint, here)["active_tab"] = shown
            here = shown
        self.client.set_blueprint(blueprint, "recording")

    def picture(self) -> bytes:
        """The window as PNG, once it stays the same: data arrives in the viewer bit by bit.

        Raises:
            ConfigError: the viewer does not answer.
        """
        previous, deadline = b"", time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            with contextlib.suppress(TimeoutError):
                current = self.client.take_screenshot()
                if current == previous:
                    break
                previous = current
            time.sleep(PAUSE_S)
        if not previous:
            raise ConfigError("The viewer did not answer; the machine may be too busy: try again.")
        return previous

    def _blueprint(self) -> dict[str, Any]:
        blueprint: dict[str, Any] = self.client.get_blueprint().blueprint
        return blueprint


def take_pictures(
    recording: Path, folder: Path, size: tuple[int, int], frame: int, wanted: Sequence[str] = ()
) -> Iterator[Path]:
    """Take a picture of every page, or of those that are wanted; yield each file when it is written.

    Args:
        recording: an ``.rrd`` of ours.
        folder: where the pictures go; created if need be.
        size: width and height in pixels.
        frame: which frame to show.
        wanted: parts of pages' names, for instance ``"Overview"`` or ``"cost volumes stage 3"``.

    Raises:
        ConfigError: the viewer does not start or does not load the recording.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with HeadlessViewer(*size) as viewer:
        viewer.open(recording)
        viewer.show_time(entities.FRAME, frame)
        for page in viewer.pages():
            stem = file_stem(page)
            if not wanted or any(file_stem((part,)) in stem for part in wanted):
                viewer.show(page)
                file = folder / f"{stem}.png"
                write_whole(file, smaller(viewer.picture()), Kind.PNG)
                yield file


def smaller(png: bytes) -> bytes:
    """The same pixels in fewer bytes: the viewer writes fast and leaves a seventh to a third lying there."""
    picture = Image.open(io.BytesIO(png)).convert("RGB")  # a window is opaque
    buffer = io.BytesIO()
    picture.save(buffer, "PNG", optimize=True)
    return min(png, buffer.getvalue(), key=len)


def file_stem(page: Page) -> str:
    """A file's name for a page, for instance ``cost-volumes-stage-3``."""
    words = re.sub(r"\(.*?\)", "", " ".join(page)).lower()
    return re.sub(r"[^a-z0-9]+", "-", words).strip("-")


def _root(blueprint: dict[str, Any]) -> str:
    """The container with all others in it."""
    return f"container/{blueprint['/viewport']['ViewportBlueprint']['root_container']}"


def _container(blueprint: dict[str, Any], part: str) -> dict[str, Any]:
    """The fields of a container; none of a view, which may have nothing that differs from the viewer's defaults."""
    fields: dict[str, Any] = blueprint.get(f"/{part}", {}).get("ContainerBlueprint", {})
    return fields


def _parts(blueprint: dict[str, Any], here: str) -> list[str]:
    parts: list[str] = _container(blueprint, here).get("contents", [])
    return parts


def _outer_tabs(blueprint: dict[str, Any], here: str) -> Iterator[str]:
    """The containers with tabs that lie in no other such, for a user may put ours among views of theirs."""
    if _container(blueprint, here).get("container_kind") == "Tabs":
        yield here
        return
    for part in _parts(blueprint, here):
        yield from _outer_tabs(blueprint, part)


def _pages(blueprint: dict[str, Any], here: str) -> Iterator[Page]:
    if _container(blueprint, here).get("container_kind") != "Tabs":
        yield ()
        return
    for part in _parts(blueprint, here):
        yield from ((_name(blueprint, part), *rest) for rest in _pages(blueprint, part))


def _name(blueprint: dict[str, Any], part: str) -> str:
    fields = blueprint.get(f"/{part}", {})
    return str(fields.get("ContainerBlueprint", fields.get("ViewBlueprint", {})).get("display_name", ""))
