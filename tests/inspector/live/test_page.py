"""The page in a real browser: drag, let go, see the answer; two windows; the viewer gets every try.

Rerun's own viewer takes half a minute to start without a graphics card, so a stand-in notes what it is given.
The page draws when the browser has time for it, after what a test has done: what is drawn is waited for (`expect`,
`redrawn`), never read at once.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from re import Pattern
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from inspector.live.app import LiveApp
from inspector.live.session import LiveSession
from inspector.serving.server import PageServer
from inspector.serving.viewer_files import VIEWER_FILES
from tests.support.browser import chromium
from tests.support.fakes import FakeCascade

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

STAND_IN = """
window.given = [];
function wasm_bindgen() { return Promise.resolve(); }
wasm_bindgen.WebHandle = class {
  constructor(options) { this.options = window.options = options; }
  start() { return Promise.resolve(); }
  open_channel() {}
  send_rrd_to_channel(channel, bytes) { window.given.push(String.fromCharCode(...bytes.slice(0, 4))); }
};
"""
Open = Callable[[LiveSession], str]
PATIENCE = 120_000
"""Milliseconds that a busy machine may take for what a quiet one does at once."""


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as running:
        yield running


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Open]:
    viewer = tmp_path / "viewer"
    viewer.mkdir()
    for name in VIEWER_FILES:
        (viewer / name).write_text(STAND_IN if name == "re_viewer.js" else "")
    servers: list[PageServer] = []

    def address(session: LiveSession) -> str:
        servers.append(PageServer(LiveApp(session, viewer).asgi).__enter__())
        return servers[-1].address

    yield address
    for server in servers:
        server.__exit__(None, None, None)


def fresh(browser: Browser) -> Page:
    """A window in which Playwright may wait by evaluating, which the page's policy forbids."""
    return patient(browser.new_page(viewport={"width": 1366, "height": 768}, bypass_csp=True))


def patient(page: Page) -> Page:
    """A page whose every wait, that for its loading among them, has `PATIENCE`."""
    page.set_default_timeout(PATIENCE)
    return page


def opened(browser: Browser, address: str) -> Page:
    page = fresh(browser)
    page.requested = []  # type: ignore[attr-defined]
    page.on("request", lambda request: page.requested.append(request.url))  # type: ignore[attr-defined]
    page.on("pageerror", lambda error: page.requested.append(f"fault: {error}"))  # type: ignore[attr-defined]
    page.goto(address)
    page.wait_for_function("document.getElementById('caption').textContent !== ''")
    return page


def drag(page: Page, axis: str, by: float, let_go: bool = True) -> None:
    """Take a slider by its middle and move it by a share of its width."""
    box = page.locator(f"#range-{axis}").bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + by * box["width"] / 2, y)
    page.mouse.move(x + by * box["width"], y)
    if let_go:
        page.mouse.up()


def answered(page: Page, count: int = 1) -> None:
    page.wait_for_function(f"live.tries.length >= {count} && live.shown[1] === live.tries.at(-1).steps.length - 1")


def says(page: Page, place: str, text: str | Pattern[str]) -> None:
    """Wait until just this stands in a place of the page."""
    from playwright.sync_api import expect

    expect(page.locator(place)).to_have_text(text, timeout=PATIENCE)


def counts(page: Page, place: str, count: int) -> None:
    """Wait until so many elements are there."""
    from playwright.sync_api import expect

    expect(page.locator(place)).to_have_count(count, timeout=PATIENCE)


def picture_of(page: Page) -> bytes:
    """What the large picture looks like now."""
    return page.screenshot(clip=page.locator("#canvas").bounding_box())  # type: ignore[arg-type]


def redrawn(page: Page, before: bytes, why: str) -> None:
    """Wait until the large picture is another than before."""
    until = time.monotonic() + PATIENCE / 1000
    while picture_of(page) == before:
        assert time.monotonic() < until, why
        page.wait_for_timeout(50)


def test_drag_let_go_and_see_the_answer(browser: Browser, make: Callable[..., LiveSession], serve: Open) -> None:
    session = make()
    page = opened(browser, serve(session))
    before, picture = page.locator("#caption").inner_text(), picture_of(page)
    drag(page, "yaw", 0.3, let_go=False)
    page.wait_for_function(f"document.getElementById('caption').textContent !== {before!r}")
    redrawn(page, picture, "the points follow before anybody lets go")
    assert session.workspace.tries == []
    page.mouse.up()
    answered(page)
    says(page, "#word", "Accepted")
    assert session.workspace.pose.yaw == pytest.approx(float(page.locator("#number-yaw").input_value()), abs=1e-3)
    # what the page draws is what was asked: its own arithmetic and ours say the same error
    shown = [re.findall(r"[\d.]+", text)[-2:] for text in page.locator("#steps tr td:nth-child(2)").all_inner_texts()]
    assert len(shown) == 4
    made = session.workspace.tries[0].as_dict(session.workspace.reference)
    expected = [[f"{step['error'][0]:.2f}", f"{step['error'][1]:.1f}"] for step in made["steps"]]
    assert shown == expected
    counts(page, "#answer.past", 0)
    page.get_by_role("radio", name="Mine").click()
    counts(page, "#answer.past", 1)  # nothing has judged the pose of the sliders
    says(page, "#caption", f"mine: {expected[0][0]}°, {expected[0][1]} cm off")
    page.get_by_role("radio", name="Reference").click()
    says(page, "#caption", "reference")
    assert not [url for url in page.requested if not url.startswith(("http://127.0.0.1", "http://localhost", "data:"))]  # type: ignore[attr-defined]


def test_the_page_and_its_viewer_keep_to_the_policy(
    browser: Browser, make: Callable[..., LiveSession], serve: Open
) -> None:
    from playwright.sync_api import expect

    page = patient(browser.new_page(viewport={"width": 1366, "height": 768}))
    complaints: list[str] = []
    page.on("console", lambda said: complaints.append(said.text))
    page.goto(serve(make()))
    expect(page.locator("#caption")).not_to_be_empty(timeout=PATIENCE)
    page.keyboard.press("Enter")
    says(page, "#word", "Accepted")
    hint = page.frame_locator("#viewer").locator("#hint")
    expect(hint).to_have_text("Loading your first try …", timeout=PATIENCE)
    assert not [text for text in complaints if "Content Security Policy" in text]
    page.evaluate("document.body.append(Object.assign(document.createElement('script'), {text: 'slipped = 1'}))")
    assert page.evaluate("typeof slipped") == "undefined"


def test_arrows_go_through_what_is_drawn_and_not_to_another_frame(
    browser: Browser, make: Callable[..., LiveSession], serve: Open
) -> None:
    session = make()
    page = opened(browser, serve(session))
    page.get_by_role("radio", name="Mine").focus()
    page.keyboard.press("ArrowRight")
    says(page, "#shown :focus", "Reference")
    says(page, "#caption", "reference")
    page.keyboard.press("ArrowRight")
    says(page, "#shown :focus", "Mine")
    page.keyboard.press("ArrowUp")
    says(page, "#caption", "reference")
    assert page.locator("#shown [tabindex='0']").all_inner_texts() == ["Reference"]
    assert session.workspace.position == 0


def test_keys_fields_and_undo(browser: Browser, make: Callable[..., LiveSession], serve: Open) -> None:
    session = make()
    page = opened(browser, serve(session))
    page.locator("#auto").uncheck()
    page.locator("#caption").click()
    # all at once: keys that come a third of a second apart are two changes, and this machine may be as slow as that
    press = "new KeyboardEvent('keydown', {key, bubbles: true})"
    page.evaluate(f"[...'qqafyh'].forEach((key) => document.body.dispatchEvent({press}))")
    page.wait_for_function("!document.getElementById('undo').disabled")
    assert tuple(session.workspace.pose) == pytest.approx((0.25, 0, 0, -0.02, 0, 0))
    page.locator("#number-z").fill("0.123")
    page.keyboard.press("Tab")
    page.wait_for_function("live.pose[5] === 0.123")
    page.locator("#caption").click()
    page.keyboard.press("Control+z")
    page.wait_for_function("live.pose[5] === 0 && live.pose[0] === 0.25")
    page.keyboard.press("Control+z")
    page.wait_for_function("live.pose.every((value) => value === 0)")
    page.keyboard.press("Control+Shift+z")
    page.wait_for_function("live.pose[0] === 0.25")
    page.get_by_role("button", name="To the reference").click()
    says(page, "#caption", "mine: 0.00°, 0.0 cm off")
    assert session.workspace.tries == []
    page.locator("#caption").click()
    page.keyboard.press("Enter")
    answered(page)


PRESS = "(key, more) => document.body.dispatchEvent(new KeyboardEvent('keydown', {key, bubbles: true, ...more}))"


def test_what_is_asked_right_after_a_key_is_asked_of_the_pose_that_it_made(
    browser: Browser, make: Callable[..., LiveSession], serve: Open
) -> None:
    session = make()
    page = opened(browser, serve(session))
    page.locator("#auto").uncheck()
    page.evaluate(f"() => {{ const press = {PRESS}; press('q'); press('Enter'); }}")
    answered(page)
    (made,) = session.workspace.tries
    np.testing.assert_allclose(made.steps[0].camera_from_lidar, session.workspace.extrinsic)
    assert session.workspace.pose.roll == pytest.approx(0.25)
    page.evaluate(f"() => {{ const press = {PRESS}; press('q'); press('z', {{ctrlKey: true}}); }}")
    page.wait_for_function("live.pose[0] === 0.25 && live.held === null && !document.getElementById('redo').disabled")
    page.wait_for_timeout(500)  # longer than keys are waited for
    assert page.evaluate("live.pose[0]") == session.workspace.pose.roll == pytest.approx(0.25)


def test_a_pose_that_was_set_without_a_connection_is_sent_when_there_is_one(
    browser: Browser, make: Callable[..., LiveSession], serve: Open
) -> None:
    session = make()
    sockets: list[Any] = []
    page = fresh(browser)
    page.route_web_socket(re.compile("/control$"), lambda socket: (sockets.append(socket), socket.connect_to_server()))
    page.goto(serve(session))
    page.wait_for_function("document.getElementById('caption').textContent !== ''")
    page.locator("#auto").uncheck()
    sockets[0].close()
    says(page, "#said", re.compile("connection to calib-inspect was lost"))
    page.locator("#number-z").fill("0.123")
    page.keyboard.press("Tab")
    says(page, "#said", re.compile("Not connected"))
    page.wait_for_function("live.held === null && live.pose[5] === 0.123")
    assert session.workspace.pose.z == pytest.approx(0.123) and len(sockets) == 2


def test_a_picture_that_did_not_come_is_asked_for_again(
    browser: Browser, make: Callable[..., LiveSession], serve: Open
) -> None:
    page = fresh(browser)
    asked: list[str] = []

    def fail_first(route: Any) -> None:
        asked.append(route.request.url)
        route.fulfill(status=503) if len(asked) == 1 else route.continue_()

    page.route("**/picture.jpg*", fail_first)
    page.goto(serve(make()))
    page.wait_for_function("document.getElementById('caption').textContent !== ''", timeout=PATIENCE)
    assert len(asked) == 2


def test_two_windows_show_the_same_and_one_may_close(
    browser: Browser, make: Callable[..., LiveSession], serve: Open
) -> None:
    session = make()
    address = serve(session)
    one, two = opened(browser, address), opened(browser, address)
    drag(one, "roll", 0.2)
    for page in (one, two):
        answered(page)
    two.wait_for_function(f"live.pose[0] === {session.workspace.pose.roll!r}")
    assert two.locator("#number-roll").input_value() == one.locator("#number-roll").input_value()
    one.close()
    drag(two, "pitch", -0.2)
    answered(two, 2)
    three = opened(browser, address)  # a window that opens later has what went before
    answered(three, 2)
    for page in (two, three):
        frame = next(frame for frame in page.frames if "viewer" in frame.url)
        frame.wait_for_function("window.given.length === 2")
        assert set(frame.evaluate("window.given")) == {"RRF2"}
        assert frame.evaluate("window.options.url") == []


class SingleFrames:
    """A method without stages that solves no drives."""

    def calibrate(self, frame: Any, initial: Any, detail: bool = False) -> Any:
        return FakeCascade().calibrate(frame, initial, detail)


def test_what_a_method_cannot_do_is_not_offered(
    browser: Browser, make: Callable[..., LiveSession], serve: Open
) -> None:
    page = opened(browser, serve(make(cascade=SingleFrames())))
    assert page.locator("#drive").is_hidden()
    assert page.locator("#run").inner_text() == "Run"
    counts(page, "#single button", 0)
    page.locator("#run").click()
    answered(page)
    page = opened(browser, serve(make()))
    assert page.locator("#drive").is_visible()
    assert page.locator("#run").inner_text() == "Run all stages"
    counts(page, "#single button", 3)


RINGED = """([u, v]) => {
  const canvas = document.getElementById("canvas"), away = canvas.width / 90;
  const colour = (dx) => canvas.getContext("2d").getImageData(u * canvas.width + dx, v * canvas.height, 1, 1).data;
  return [-away, away].some((dx) => colour(dx).join() === "255,0,200,255");
}"""
"""Whether there is a ring about a place of the large picture, given in shares of its sides."""


def test_a_click_in_the_picture_asks_why(browser: Browser, make: Callable[..., LiveSession], serve: Open) -> None:
    session = make()
    page = opened(browser, serve(session))
    page.keyboard.press("Enter")
    answered(page)
    frame = next(frame for frame in page.frames if "viewer" in frame.url)
    frame.wait_for_function("window.given.length === 1")
    seen = session._answers._newest[1].projected(session.workspace.tries[0].found)
    u, v = seen.pixels[int(np.argmin(seen.depth))].tolist()
    box, (width, height) = page.locator("#canvas").bounding_box(), (400, 120)
    assert box is not None
    page.mouse.click(box["x"] + (u + 0.5) / width * box["width"], box["y"] + (v + 0.5) / height * box["height"])
    says(page, "#said", re.compile("^Search windows moved to the ringed point"))
    page.wait_for_function(RINGED, arg=[(u + 0.5) / width, (v + 0.5) / height])
    frame.wait_for_function("window.given.length === 2")
    # the same from the viewer, whose selection names the overlay and the pixel
    event = {
        "type": "selection_change",
        "items": [{"entity_path": "/overlay/stage_5", "position": [u + 0.5, v + 0.5, 0]}],
    }
    assert frame.locator("#hint").is_visible(), "until the viewer says a time, it is blank"
    frame.evaluate("event => window.options.on_viewer_event(event)", event)
    frame.wait_for_function("window.given.length === 3")
    frame.evaluate("window.options.on_viewer_event({type: 'time_update', time: 0})")
    assert frame.locator("#canvas").bounding_box()["width"] == 64, "it still takes in what it shows"  # type: ignore[index]
    frame.evaluate(
        "() => { const draw = () => requestAnimationFrame(draw); draw(); }"
    )  # pictures without anything to do
    frame.wait_for_function("document.getElementById('canvas').clientWidth > 64")
    assert frame.locator("#hint").is_hidden()


def test_what_is_rejected_is_asked_about_before_it_is_written(
    browser: Browser, make: Callable[..., LiveSession], serve: Open, tmp_path: Path
) -> None:
    page = opened(browser, serve(make(cascade=FakeCascade(doubted=(4,)))))
    page.keyboard.press("Enter")
    answered(page)
    says(page, "#word", "Rejected")
    file = tmp_path / "out" / "calibration.corrected.yaml"
    for choice in ("Cancel", "Write it anyway"):
        page.get_by_role("button", name="Accept as calibration").click()
        says(page, "#sure-text", re.compile("^Rejected"))
        assert not file.exists()
        page.get_by_role("button", name=choice).click()
    says(page, "#said", re.compile("^Wrote"))
    assert "rejected" in file.read_text()


def test_points_are_smaller_at_first_where_they_would_hide_the_image(
    browser: Browser, make: Callable[..., LiveSession], serve: Open
) -> None:
    address = serve(make())
    size = "document.getElementById('size').value"
    assert opened(browser, address).evaluate(size) == "2"
    small = patient(browser.new_page(viewport={"width": 300, "height": 600}, bypass_csp=True))
    small.goto(address)
    small.wait_for_function(f"{size} === '1'")
    small.wait_for_function("live.timing.draws > 1")


@pytest.mark.parametrize("color", ["intensity", "edge", "error"])
def test_every_colouring_is_drawn_with_its_legend(
    browser: Browser, make: Callable[..., LiveSession], serve: Open, color: str
) -> None:
    page = opened(browser, serve(make(length=1)))
    before, legend = picture_of(page), page.locator("#legend").inner_text()
    page.locator("#color").select_option(color)
    page.wait_for_function(f"document.getElementById('legend').innerText !== {legend!r}")
    redrawn(page, before, "other colours")
