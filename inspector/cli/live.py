"""``calib-inspect live``: a page on which the extrinsic is moved by hand, and the cascade answers."""

from __future__ import annotations

import asyncio
import tempfile
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, fields
from functools import partial, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from calibnet.errors import ConfigError
from calibnet.methods.registry import CASCADE
from inspector.cli.errors import ExitCode
from inspector.cli.inspect import length_option
from inspector.cli.options import FOLDER, FRAMES, KNOWN_OPTIONS, METHOD_OPTIONS, MISCALIBRATION, RANGE, SEED, STAGES
from inspector.cli.output import OUTPUT_FILE, make_console, overwrite_option, say
from inspector.cli.preparing import UNJUDGED, announce, open_other
from inspector.cli.run import checked_options
from inspector.cli.subcommands import Opening, over_sequences
from inspector.export.registry import FORMATS, suffix_of
from inspector.run.options import DEFAULT_RANGE

if TYPE_CHECKING:
    from calibnet.calibrator import Calibrator
    from calibnet.datasets import Sequence
    from inspector.live.session import LiveSession

_OPTIONS: tuple[Callable[..., Any], ...] = (
    click.option(
        "--frames", type=FRAMES, default=":", help="Positions to choose from, for instance 0:100:5.  [default: all]"
    ),
    click.option(
        "--range",
        type=RANGE,
        help="Start from a miscalibration drawn within ± these degrees and metres, which is also how far the sliders "
        f"reach.  [default: {DEFAULT_RANGE}]",
    ),
    click.option(
        "--miscalibrate",
        "miscalibration",
        type=MISCALIBRATION,
        help="Start from this miscalibration instead of a random one.",
    ),
    click.option("--seed", type=SEED, default=0, show_default=True, help="Seed of all random numbers."),
    click.option("--stages", type=STAGES, help="Stages to run, for instance 3-5.  [default: those within the range]"),
    click.option("--preset", default="compact", show_default=True, help="Network to use."),
    *KNOWN_OPTIONS,
    *METHOD_OPTIONS,
    click.option("--weights", type=FOLDER, help="Folder with the network's weights.  [default: those of the package]"),
    click.option(
        "--output",
        type=OUTPUT_FILE,
        metavar="FILE",
        help="File for an accepted calibration; must not be the file that was read.  [default: "
        "calibration.corrected.yaml, or with the ending of --format]",
    ),
    click.option(
        "--format",
        "form",
        type=click.Choice(FORMATS.names()),
        default="yaml",
        show_default=True,
        help="Format of an accepted calibration, as for `calib-inspect export`.",
    ),
    overwrite_option,
    click.option(
        "--native", is_flag=True, help="Use Rerun's own window and the keys of this terminal instead of a page."
    ),
    click.option(
        "--connect",
        metavar="URL",
        help="With --native, use this running viewer: rerun+http://HOST:PORT/proxy.  [default: a new one]",
    ),
    click.option("--open/--no-open", "open_page", default=True, help="Open a browser if there is a display."),
)


@dataclass(frozen=True)
class Keeping:
    """Where an accepted calibration is written, and where the session is shown."""

    output: Path | None
    form: str
    native: bool
    connect: str | None
    open_page: bool


def live_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the options of a live session; those of `Keeping` are passed as one argument, ``keeping``."""
    names = [field.name for field in fields(Keeping)]

    @wraps(command)
    def packed(**given: Any) -> Any:
        return command(keeping=Keeping(**{name: given.pop(name) for name in names}), **given)

    decorated: Callable[..., Any] = packed
    for option in reversed(_OPTIONS):
        decorated = option(decorated)
    return decorated


@click.group()
def live() -> None:
    """Move the extrinsic by hand and watch the cascade correct it, stage by stage.

    Opens a page that is served on this machine only, to whoever has its address. Every try is kept and can be returned
    to. Keys: q a roll, w s pitch, e d yaw, r f x, t g y, y h z; Enter runs, Ctrl+Z undoes, the arrows change the frame.
    With --native, type them into this terminal, where z undoes and ? lists all of them.
    """


@live.command()
@length_option
@live_options
def demo(length: int, keeping: Keeping, **asked: Any) -> int:
    """Explore a drive through the synthetic world, without any data."""
    from calibnet.datasets.synthetic import KITTI_LIKE, SyntheticSequence

    return serve_live(SyntheticSequence(seed=asked["seed"], length=length, rig=KITTI_LIKE), keeping, **asked)


def live_opened(opening: Opening, keeping: Keeping, **asked: Any) -> int:
    """Open a sequence and serve it; returns the exit code."""
    return serve_live(opening(), keeping, **asked)


over_sequences(live, live_opened, lambda _: live_options, "Explore")


def serve_live(sequence: Sequence, keeping: Keeping, **asked: Any) -> int:
    """Show the page or the window until Ctrl-C or SIGTERM.

    Args:
        sequence: the frames to explore.
        keeping: where an accepted calibration is written, and where the session is shown.
        **asked: fields of `RunOptions`.
    """
    from calibnet.cascade.cascade import Cascade
    from inspector.live.accept import Target
    from inspector.live.session import LiveSession
    from inspector.live.workspace import Workspace

    if keeping.connect is not None and not keeping.native:
        raise click.UsageError("--connect needs --native; add it, or leave --connect out: the page has its own viewer.")
    if keeping.native:
        check_window(keeping.connect)
    options = checked_options(sequence, asked)
    output = keeping.output or Path(f"calibration.corrected.{suffix_of(keeping.form)}")
    target = Target(output, keeping.form)
    target.check()
    method: Calibrator
    if options.method == CASCADE:
        numbers = options.stages or options.start.stages
        method = cascade = Cascade.load(options.preset, numbers, options.weights, options.stages is None, options.prior)
        announce(make_console(), options, cascade)
    else:
        method = open_other(options)
        say(UNJUDGED, err=True)
    workspace = Workspace(sequence, options.positions, options.start, options.seed)
    session = partial(LiveSession, workspace, method, target, options.range or DEFAULT_RANGE, known=options.prior.words)
    if keeping.native:
        in_a_window(session, keeping.connect)
    else:
        on_a_page(session(), keeping.open_page)
    return ExitCode.OK


def on_a_page(session: LiveSession, open_page: bool) -> None:
    """Serve the page until Ctrl-C or SIGTERM."""
    from calibnet.runtime.interruption import StopRequest
    from inspector.live.app import LiveApp
    from inspector.record.outputs import has_display
    from inspector.serving.browser import opened_page
    from inspector.serving.server import PageServer
    from inspector.serving.viewer_files import fetch_viewer

    with tempfile.TemporaryDirectory(prefix="calib-inspect-") as viewer:
        fetch_viewer(Path(viewer))
        try:
            with StopRequest() as stop, PageServer(LiveApp(session, Path(viewer)).asgi) as server:
                say(f"Live at {server.address} until Ctrl-C.")
                with opened_page(server.address) if open_page and has_display() else nullcontext():
                    stop.wait()
        finally:
            session.close()


def check_window(connect: str | None) -> None:
    """Check before the work that there is a viewer, or a display to open one on.

    Raises:
        ConfigError: there is neither.
    """
    from inspector.record.outputs import check_viewer, has_display

    if connect is not None:
        check_viewer(connect)
    elif not has_display():
        raise ConfigError(
            "There is no display for --native; leave it out for the page, or name a running viewer with --connect."
        )


def in_a_window(make: Callable[..., LiveSession], connect: str | None) -> None:
    """Act on the terminal's keys until Esc, Ctrl-C, SIGTERM or the end of input; the window stays open.

    Args:
        make: makes the session from a ``stream``.
        connect: address of a running viewer; None to open one.
    """
    import rerun as rr

    from calibnet.runtime.interruption import StopRequest
    from inspector.live.keys import keyboard
    from inspector.live.terminal import Terminal, help_text
    from inspector.live.window import WindowRecording
    from inspector.programs import open_window

    window = WindowRecording(rr.GrpcSink(connect or open_window()), help_text())
    session = make(stream=window)
    say("Keys: q a roll, w s pitch, e d yaw, r f x, t g y, y h z; Enter runs, ? lists all keys, Esc ends.")
    try:
        with StopRequest() as stop, keyboard() as read:
            asyncio.run(Terminal(session, window, say).run(read, lambda: stop.requested))
    finally:
        session.close()
