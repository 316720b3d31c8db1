"""``calib-inspect pictures``: a picture of every tab of a recording, as the viewer shows it."""

from __future__ import annotations

import re
from pathlib import Path

import click

from inspector.cli.options import FOLDER


class SizeType(click.ParamType[tuple[int, int]]):
    """``WIDTHxHEIGHT`` in pixels."""

    name = "WxH"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, int]:
        """Parse the text; a value that is a tuple already is kept."""
        if isinstance(value, tuple):
            return value
        match = re.fullmatch(r"(\d{3,4})x(\d{3,4})", str(value))
        if match is None:
            self.fail(f"{value!r} is not a size in pixels such as 1920x1080.", param, ctx)
        return int(match[1]), int(match[2])


@click.command()
@click.argument("recording", type=click.Path(path_type=Path), metavar="RUN.rrd")
@click.option("--out", type=FOLDER, required=True, metavar="DIR", help="Folder of the pictures; created if need be.")
@click.option("--size", type=SizeType(), default="1920x1080", show_default=True, help="Of the viewer's window.")
@click.option("--frame", type=click.IntRange(0), help="Frame to show.  [default: the first]")
@click.option("--tab", "wanted", multiple=True, metavar="TEXT", help="Only tabs whose name contains this. Repeatable.")
def pictures(recording: Path, out: Path, size: tuple[int, int], frame: int | None, wanted: tuple[str, ...]) -> None:
    """Take a picture of every tab of a recording in the real viewer, without a window.

    Needs a Vulkan driver; Mesa's software one will do (Debian: mesa-vulkan-drivers).
    """
    from inspector.read.run import read_run
    from inspector.read.screenshots import take_pictures

    numbers = [recorded.index for recorded in read_run(recording).frames]
    shown = numbers[0] if frame is None else frame
    if shown not in numbers:
        raise click.UsageError(f"{recording} has no frame {shown}, only {numbers[0]} to {numbers[-1]}.")
    for file in take_pictures(recording, out, size, shown, wanted):
        click.echo(str(file))
