"""How long the page of `calib-inspect live` lets one wait, in a real browser. No test: the machine must be quiet.

    python -m tests.live_latency --moves 20 -- raw 2011_09_26 0048 --root KITTI/raw --range 5/0.5 --seed 1

Says, in milliseconds, when the picture is there after the page was opened, how long the points take to follow a slider,
when the answer is there after letting go, and when Rerun's viewer shows it.
"""

from __future__ import annotations

import argparse
import io
import re
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from tests.support.browser import DRAWING, chromium

if TYPE_CHECKING:
    from playwright.sync_api import Frame, Page

PATIENCE_MS = 600_000.0
BLANK = 0.02
"""Share of coloured pixels up to which the viewer counts as blank: its own panels are grey."""
FOLLOWING = """([axis, value]) => new Promise((told) => {
  const slider = document.getElementById(`range-${axis}`), began = performance.now(), before = live.timing.draws;
  slider.value = value;
  slider.dispatchEvent(new Event("input", { bubbles: true }));
  const look = () => live.timing.draws === before ? requestAnimationFrame(look)
    : requestAnimationFrame(() => setTimeout(() => told([performance.now() - began, live.timing.draw])));
  look();
})"""
"""Moves a slider; tells after how long the picture with it was handed to the screen, and how long drawing took."""


@contextmanager
def serving(arguments: list[str]) -> Iterator[str]:
    """The address of a live session that runs."""
    program = "import sys; from inspector.cli.main import main; sys.exit(main())"
    command = [sys.executable, "-c", program, "live", *arguments, "--no-open"]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert server.stdout is not None
        address = re.search(r"http://\S+", server.stdout.readline())
        yield address[0] if address else sys.exit("it does not start")
    finally:
        server.terminate()
        server.wait()


def said(what: str, milliseconds: list[float]) -> None:
    """Print a median and the largest."""
    sys.stdout.write(
        f"{what:<58}{statistics.median(milliseconds):8.0f}  max {max(milliseconds):6.0f}  of {len(milliseconds)}\n"
    )
    sys.stdout.flush()


def let_go(page: Page, value: float) -> float:
    """Move a slider and let go; milliseconds until the answer is there."""
    count = page.evaluate("live.tries.length")
    page.evaluate(
        """(value) => { const slider = document.getElementById("range-yaw"); slider.value = value;
        for (const name of ["input", "change"]) slider.dispatchEvent(new Event(name, { bubbles: true })); }""",
        value,
    )
    page.wait_for_function(f"live.tries.length > {count}", timeout=PATIENCE_MS)
    return float(page.evaluate("live.timing.answer"))


def is_blank(page: Page) -> bool:
    """Whether the viewer shows hardly more than its own panels."""
    box: Any = page.locator("#viewer").bounding_box()
    picture = np.asarray(Image.open(io.BytesIO(page.screenshot(clip=box, timeout=PATIENCE_MS))).convert("RGB"))
    return float((np.ptp(picture, axis=2) > 40).mean()) <= BLANK


def until_shown(page: Page, viewer: Frame, began: float, folder: Path | None) -> None:
    """Print when the viewer has what was recorded, when it says so, and when there is a picture."""
    now = lambda: 1000 * (time.perf_counter() - began)  # noqa: E731
    viewer.wait_for_function("window.pieces", timeout=PATIENCE_MS)
    said("viewer has its first piece", [now()])
    while is_blank(page):
        time.sleep(0.5)
    said("viewer shows a picture", [now()])
    last, pictures = b"", 0
    while (picture := page.screenshot(timeout=PATIENCE_MS)) != last:
        last, pictures = picture, pictures + 1
        if folder is not None:
            (folder / f"viewer-{pictures:02}.png").write_bytes(picture)
        time.sleep(1)
    said("viewer stands still", [now()])


def main() -> None:
    """Measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--moves", type=int, default=20)
    parser.add_argument("--answers", type=int, default=5)
    parser.add_argument("--wait", type=float, default=5.0, help="Seconds to read the page before the first move.")
    parser.add_argument("--pictures", type=Path, help="Folder for pictures of what came when.")
    parser.add_argument("live", nargs="+", help="What follows `calib-inspect live`, after --.")
    asked = parser.parse_args()
    with serving(asked.live) as address, chromium(DRAWING) as browser:
        page = browser.new_page(viewport={"width": 1366, "height": 768}, color_scheme="dark", bypass_csp=True)
        began = time.perf_counter()
        page.goto(address)
        page.wait_for_function("window.live && live.timing.draws > 0", timeout=PATIENCE_MS)
        said("picture with points after opening the page", [1000 * (time.perf_counter() - began)])
        page.wait_for_timeout(1000 * asked.wait)

        def follow(when: str) -> None:
            moves = [page.evaluate(FOLLOWING, ["roll", 0.1 * (i % 10)]) for i in range(asked.moves)]
            said(f"points follow a slider, {when}", [shown for shown, _ in moves])
            said("  of it drawing", [drawn for _, drawn in moves])

        follow("before the first try")
        began = time.perf_counter()
        said("five stages after letting go, the first time", [let_go(page, 0.5)])
        viewer = next(frame for frame in page.frames if "viewer" in frame.url)
        until_shown(page, viewer, began, asked.pictures)
        page.wait_for_timeout(3000)
        follow("beside a viewer")
        answers = []
        for i in range(asked.answers):
            answers.append(let_go(page, 0.1 * i))
            page.wait_for_timeout(8000)
        said("five stages after letting go, 8 s apart", answers)


if __name__ == "__main__":
    main()
