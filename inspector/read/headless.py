"""Rerun's viewer without a window, which shows a recording and takes pictures of itself."""

from __future__ import annotations

import contextlib
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Final

from rerun.experimental import ViewerClient

from calibnet.errors import ConfigError
from inspector.programs import free_port, own_address, rerun_binary, start_program
from inspector.read.viewer_hand import press

PATIENCE_S: Final = 120.0
PAUSE_S: Final = 0.3
STILL_S: Final = 1.2
"""Seconds, over `STILL_PICTURES` pictures, after which an unchanged window has all its data."""
STILL_PICTURES: Final = 3
VULKAN_HINT: Final = "without a graphics card it needs a Vulkan driver; Debian: apt-get install -y mesa-vulkan-drivers"
DARK, LIGHT = "dark", "light"

Page = tuple[str, ...]
"""Path of tabs to a page, outermost first, for instance ``("Cost volumes", "Stage 3 (±5°/0.5 m)")``."""


class HeadlessViewer:
    """A viewer without a window that shows one recording; as a context manager, it ends its process.

    Attributes:
        client: Rerun's interface to the viewer.
    """

    client: ViewerClient

    def __init__(self, width: int = 1920, height: int = 1080, theme: str = DARK) -> None:
        """Set the size of the window in pixels and its theme, `DARK` or `LIGHT`."""
        self._size, self._theme = f"{width}x{height}", theme
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> HeadlessViewer:
        host, port = own_address(), free_port()
        command = [rerun_binary(), "--headless", "--port", str(port), "--bind", host, "--window-size", self._size]
        try:
            self._process = start_program([*command, "--hide-welcome-screen"], port, host)
        except ConfigError as error:
            raise ConfigError(f"{error} ({VULKAN_HINT})") from None
        self.client = ViewerClient.connect(f"rerun+http://{host}:{port}/proxy")
        if self._theme != DARK:  # the viewer starts in the dark theme
            self.client.run_command("ui.open_settings")
            press(f"http://{host}:{port}", self._theme.capitalize())
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

    def times(self, timeline: str) -> tuple[int, int] | None:
        """The first and the last number on a timeline of the recording; None where it has no such timeline."""
        for known in self.client.get_state().recordings[0].timelines:
            if known.name == timeline and known.start is not None and known.end is not None:
                return known.start, known.end
        return None

    def show_time(self, timeline: str, value: int) -> None:
        """Move to a place on a timeline, paused."""
        self.client.set_time(timeline, sequence=value, play_state="paused")

    def pages(self) -> list[Page]:
        """Every page of every tab, in the blueprint's order; one without a name if there are no tabs."""
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
        """The window as PNG, once it has stayed the same for a while: data arrives in the viewer bit by bit.

        Raises:
            ConfigError: the viewer does not answer.
        """
        last, equal, since = b"", 0, 0.0
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            with contextlib.suppress(TimeoutError):
                current, now = self.client.take_screenshot(), time.monotonic()
                if current != last or self.client.get_state().loading:
                    last, equal, since = current, 1, now
                elif (equal := equal + 1) >= STILL_PICTURES and now >= since + STILL_S:
                    break
            time.sleep(PAUSE_S)
        if not last:
            raise ConfigError("The viewer did not answer; try again when the machine is less busy.")
        return last

    def _blueprint(self) -> dict[str, Any]:
        blueprint: dict[str, Any] = self.client.get_blueprint().blueprint
        return blueprint


def _root(blueprint: dict[str, Any]) -> str:
    """The container that holds all others."""
    return f"container/{blueprint['/viewport']['ViewportBlueprint']['root_container']}"


def _container(blueprint: dict[str, Any], part: str) -> dict[str, Any]:
    """The fields of a container; empty for a view, all of whose properties may be the viewer's defaults."""
    fields: dict[str, Any] = blueprint.get(f"/{part}", {}).get("ContainerBlueprint", {})
    return fields


def _parts(blueprint: dict[str, Any], here: str) -> list[str]:
    parts: list[str] = _container(blueprint, here).get("contents", [])
    return parts


def _outer_tabs(blueprint: dict[str, Any], here: str) -> Iterator[str]:
    """The outermost containers with tabs; a user may have put ours among views of their own."""
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
