"""Options for where a recording is shown and saved, shared by the commands that write one."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from inspector.cli.output import OUTPUT_FILE, overwrite_option

if TYPE_CHECKING:
    from inspector.record.outputs import Outputs

RECORDINGS = Path("recordings")

_OPTIONS: Mapping[str, Callable[..., Any]] = {
    "save": click.option("--save", type=OUTPUT_FILE, metavar="FILE.rrd", help="Write the recording to this file."),
    "headless": click.option("--headless", is_flag=True, help="Open no window."),
    "serve": click.option("--serve", is_flag=True, help="Show the viewer as a web page, on this machine only."),
    "bind": click.option("--bind", metavar="ADDRESS", help="Address on which --serve listens.  [default: 127.0.0.1]"),
    "connect": click.option(
        "--connect", metavar="URL", help="Send to this running viewer: rerun+http://HOST:PORT/proxy."
    ),
}


@dataclass(frozen=True)
class Viewing:
    """Where a recording is to be shown and saved.

    Attributes:
        save: file to write.
        headless: whether to open no window.
        serve: whether to show the viewer as a web page.
        bind: address on which that page is served.
        connect: gRPC address of a running viewer.
        keep: name of the file to write if ``save`` names none, wherever else the recording goes.
    """

    save: Path | None
    headless: bool
    serve: bool
    bind: str | None
    connect: str | None
    keep: str = ""

    def outputs(self, name: str) -> Outputs:
        """Outputs as asked for: a viewer where one can open, and a file, in `RECORDINGS` if nothing else is asked for.

        Args:
            name: name of what is recorded, for the file's name.
        """
        from inspector.programs import LOCALHOST
        from inspector.record.outputs import Outputs, has_display

        if self.bind is not None and not self.serve:
            raise click.UsageError("--bind needs --serve; add --serve or leave --bind out.")
        save, viewer = self.save, has_display() and not (self.headless or self.serve or self.connect)
        if save is None and (self.keep or not (viewer or self.serve or self.connect)):
            save = RECORDINGS / f"{re.sub(r'[^A-Za-z0-9_.-]+', '-', self.keep or name).strip('-.')[:100] or 'run'}.rrd"
        return Outputs(save, viewer, self.serve, self.connect, self.bind or LOCALHOST, numbered=self.save is None)


def viewing_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the options of `Viewing`, passed as one argument, ``viewing``."""
    return _as_one(command, _OPTIONS)


def windowless_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Do the same without ``--headless``, for a command that opens no window by itself."""
    return _as_one(command, {name: _OPTIONS[name] for name in _OPTIONS if name != "headless"}, headless=True)


def _as_one(command: Callable[..., Any], options: Mapping[str, Callable[..., Any]], **fixed: Any) -> Callable[..., Any]:
    @wraps(command)
    def packed(**given: Any) -> Any:
        return command(viewing=Viewing(**{name: given.pop(name) for name in options}, **fixed), **given)

    decorated: Callable[..., Any] = packed
    for option in (overwrite_option, *reversed([*options.values()])):
        decorated = option(decorated)
    return decorated


def next_lines(file: Path, exportable: bool = True, rig: bool = False) -> list[str]:
    """Commands that can follow on a recording, or on that of a rig; a rejected result is not exported."""
    from inspector.export.registry import FORMATS

    quoted = shlex.quote(str(file))
    others = ", ".join(name for name in FORMATS.names() if name != "ros")
    what, where = (
        ("Export the result for other tools, one file per camera", " --output found/")
        if rig
        else ("Export the result for other tools", "")
    )
    lines = [f"Make a page of it: calib-inspect report {quoted} --output report/ --open"]
    if exportable:
        lines.append(f"{what}: calib-inspect export {quoted} --format ros{where}  (or {others})")
    return lines


def saved_lines(outputs: Outputs, frames: int = 0) -> list[str]:
    """Lines on the recording that was written, if any, and on an earlier one of the same name.

    Args:
        outputs: outputs that it was written to.
        frames: number of frames, if their mean size is to be given.
    """
    from inspector.programs import open_command

    if outputs.file is None:
        return []
    file, size = outputs.file, outputs.file.stat().st_size / 1e6
    replacing = " in place of an earlier recording" if outputs.replaced else ""
    each = f", {size / frames:.2f} MB per frame" if frames else ""
    lines = [f"Saved {file}{replacing} ({size:.1f} MB{each}).", f"Open it with: {open_command(file)}"]
    return lines if outputs.earlier is None else [*lines, earlier_line(outputs)]


def earlier_line(outputs: Outputs) -> str:
    """A line on where the earlier recording of the same name is."""
    return f"This run did not finish; the earlier {outputs.file} is kept as {outputs.earlier}."
