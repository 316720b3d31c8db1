"""Where a recording is shown and kept: options that the commands which write one share."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from inspector.cli.output import overwrite_option

if TYPE_CHECKING:
    from inspector.record.outputs import Outputs

RECORDINGS = Path("recordings")

_OPTIONS: Mapping[str, Callable[..., Any]] = {
    "save": click.option(
        "--save", type=click.Path(path_type=Path), metavar="FILE.rrd", help="Write the recording to this file."
    ),
    "headless": click.option("--headless", is_flag=True, help="Open no window."),
    "serve": click.option("--serve", is_flag=True, help="Offer the viewer as a web page, on this machine only."),
    "bind": click.option("--bind", metavar="ADDRESS", help="Address that --serve listens on.  [default: 127.0.0.1]"),
    "connect": click.option(
        "--connect", metavar="URL", help="Send to a viewer that runs: rerun+http://HOST:PORT/proxy."
    ),
}


@dataclass(frozen=True)
class Viewing:
    """Where a recording is shown and kept, as it was asked for.

    Attributes:
        save: file to write.
        headless: open no window.
        serve: offer the viewer as a web page.
        bind: address that it listens on.
        connect: gRPC address of a viewer that runs already.
        keep: without ``save``, write a file of this name wherever else the recording goes.
    """

    save: Path | None
    headless: bool
    serve: bool
    bind: str | None
    connect: str | None
    keep: str = ""

    def outputs(self, name: str) -> Outputs:
        """A viewer where one can open; the file that was asked for, or one in `RECORDINGS` if nothing else shows.

        Args:
            name: of what is recorded, for that file's name.
        """
        from inspector.programs import LOCALHOST
        from inspector.record.outputs import Outputs, has_display

        if self.bind is not None and not self.serve:
            raise click.UsageError("--bind belongs to --serve; add --serve or leave --bind out.")
        save, viewer = self.save, has_display() and not (self.headless or self.serve or self.connect)
        if save is None and (self.keep or not (viewer or self.serve or self.connect)):
            save = RECORDINGS / f"{re.sub(r'[^A-Za-z0-9_.-]+', '-', self.keep or name).strip('-.')[:100] or 'run'}.rrd"
        return Outputs(save, viewer, self.serve, self.connect, self.bind or LOCALHOST, numbered=self.save is None)


def viewing_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the options of `Viewing`, which it gets as one, ``viewing``."""
    return _as_one(command, _OPTIONS)


def windowless_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """The same without ``--headless``, for a command that opens no window of its own accord."""
    return _as_one(command, {name: _OPTIONS[name] for name in _OPTIONS if name != "headless"}, headless=True)


def _as_one(command: Callable[..., Any], options: Mapping[str, Callable[..., Any]], **fixed: Any) -> Callable[..., Any]:
    @wraps(command)
    def packed(**given: Any) -> Any:
        return command(viewing=Viewing(**{name: given.pop(name) for name in options}, **fixed), **given)

    decorated: Callable[..., Any] = packed
    for option in (overwrite_option, *reversed([*options.values()])):
        decorated = option(decorated)
    return decorated


def next_lines(file: Path, rig: bool = False) -> list[str]:
    """What can be done with a recording, or with that of a rig."""
    from inspector.export.registry import FORMATS

    quoted = shlex.quote(str(file))
    others = ", ".join(name for name in FORMATS.names() if name != "ros")
    what, where = (
        ("The result for other tools, a file a camera", " --output found/")
        if rig
        else ("The result for other tools", "")
    )
    return [
        f"A page of it: calib-inspect report {quoted} --output report/ --open",
        f"{what}: calib-inspect export {quoted} --format ros{where}  (or {others})",
    ]


def saved_lines(outputs: Outputs, frames: int = 0) -> list[str]:
    """What to say about a recording that was written, if one was, and about an earlier one of its name.

    Args:
        outputs: where it went.
        frames: that it has, where each has a size of its own.
    """
    from inspector.programs import open_command

    if outputs.file is None:
        return []
    file, size = outputs.file, outputs.file.stat().st_size / 1e6
    replacing = " in place of an earlier recording" if outputs.replaced else ""
    each = f", {size / frames:.2f} MB a frame" if frames else ""
    lines = [f"Saved {file}{replacing} ({size:.1f} MB{each}).", f"Open it with: {open_command(file)}"]
    return lines if outputs.earlier is None else [*lines, earlier_line(outputs)]


def earlier_line(outputs: Outputs) -> str:
    """Where the recording is that had the name before."""
    return f"This run did not end, so the earlier {outputs.file} is kept as {outputs.earlier}."
