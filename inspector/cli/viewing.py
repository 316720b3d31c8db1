"""Where a recording is shown and kept: options that the commands which write one share."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from inspector.cli.output import overwrite_option

if TYPE_CHECKING:
    from inspector.record.outputs import Outputs

RECORDINGS = Path("recordings")

_OPTIONS: tuple[Callable[..., Any], ...] = (
    click.option(
        "--save", type=click.Path(path_type=Path), metavar="FILE.rrd", help="Write the recording to this file."
    ),
    click.option("--headless", is_flag=True, help="Open no window."),
    click.option("--serve", is_flag=True, help="Offer the viewer as a web page, on this machine only."),
    click.option("--bind", default="127.0.0.1", show_default=True, help="Address that --serve listens on."),
    click.option("--connect", metavar="URL", help="Send to a viewer that runs: rerun+http://HOST:PORT/proxy."),
)


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
    bind: str
    connect: str | None
    keep: str = ""

    def outputs(self, name: str) -> Outputs:
        """A viewer where one can open; the file that was asked for, or one in `RECORDINGS` if nothing else shows.

        Args:
            name: of what is recorded, for that file's name.
        """
        from inspector.record.outputs import Outputs, has_display

        save, viewer = self.save, has_display() and not (self.headless or self.serve or self.connect)
        if save is None and (self.keep or not (viewer or self.serve or self.connect)):
            save = RECORDINGS / f"{re.sub(r'[^A-Za-z0-9_.-]+', '-', self.keep or name).strip('-.')[:100] or 'run'}.rrd"
        return Outputs(save, viewer, self.serve, self.connect, self.bind, numbered=self.save is None)


def viewing_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the options of `Viewing`, which it gets as one, ``viewing``."""
    names = [field.name for field in fields(Viewing) if field.name != "keep"]

    @wraps(command)
    def packed(**given: Any) -> Any:
        return command(viewing=Viewing(**{name: given.pop(name) for name in names}), **given)

    decorated: Callable[..., Any] = packed
    for option in (overwrite_option, *reversed(_OPTIONS)):
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
        f"A page of it: calib-inspect report {quoted} --out report/ --open",
        f"{what}: calib-inspect export {quoted} --format ros{where}  (or {others})",
    ]


def saved_lines(outputs: Outputs, frames: int) -> list[str]:
    """What to say about a recording that was written, and about an earlier one of its name."""
    from inspector.programs import open_command

    assert outputs.file is not None
    file, size = outputs.file, outputs.file.stat().st_size
    replacing = " in place of an earlier recording" if outputs.replaced else ""
    lines = [
        f"Saved {file}{replacing} ({size / 1e6:.1f} MB, {size / frames / 1e6:.2f} MB a frame).",
        f"Open it with: {open_command(file)}",
    ]
    return lines if outputs.earlier is None else [*lines, earlier_line(outputs)]


def earlier_line(outputs: Outputs) -> str:
    """Where the recording is that had the name before."""
    return f"This run did not end, so the earlier {outputs.file} is kept as {outputs.earlier}."
