"""``calib-inspect pictures``: a picture of every tab of a recording, or an animation from stage to stage."""

from __future__ import annotations

import re
from pathlib import Path

import click

from inspector import entities
from inspector.cli.options import FOLDER
from inspector.cli.output import OUTPUT_FILE, overwrite_option, say
from inspector.cli.recordings import RECORDING, open_run


class SizeType(click.ParamType[tuple[int, int]]):
    """``WIDTHxHEIGHT`` in pixels, parsed to both numbers."""

    name = "WxH"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, int]:
        """Parse the text; a value that is a tuple already is kept."""
        if isinstance(value, tuple):
            return value
        match = re.fullmatch(r"(\d{3,4})x(\d{3,4})", str(value))
        if match is None:
            self.fail(f"{value!r} is not a size in pixels; write for instance 1920x1080.", param, ctx)
        return int(match[1]), int(match[2])


@click.command()
@click.argument("recording", type=RECORDING, metavar="FILE.rrd")
@click.option("--output", "out", type=FOLDER, metavar="DIR", help="Folder for the pictures of the tabs.")
@click.option("--size", type=SizeType(), default="1920x1080", show_default=True, help="Size of the viewer's window.")
@click.option(
    "--theme", type=click.Choice(["dark", "light"]), default="dark", show_default=True, help="Theme of the viewer."
)
@click.option(
    "--frame", type=click.IntRange(0), help="Frame to show.  [default: the first; with --animate, three frames]"
)
@click.option("--tab", "wanted", multiple=True, metavar="TEXT", help="Only tabs whose name contains this. Repeatable.")
@overwrite_option
@click.option(
    "--animate",
    type=OUTPUT_FILE,
    metavar="FILE",
    help="Write an animation (.webp or .gif) of frames before the calibration and after every stage.",
)
def pictures(
    recording: Path,
    out: Path | None,
    size: tuple[int, int],
    theme: str,
    frame: int | None,
    wanted: tuple[str, ...],
    animate: Path | None,
) -> None:
    """Take a picture of every tab of a recording in the real viewer, without a window.

    FILE.rrd is the recording of a run, a rig, a comparison, a training or of `watch`; --animate needs that of a run.
    Pictures of tabs need a Vulkan driver; Mesa's software driver suffices (Debian: mesa-vulkan-drivers). --animate
    alone needs none.
    """
    if out is None and animate is None:
        raise click.UsageError("Give --output DIR for pictures of the tabs, --animate FILE for an animation, or both.")
    if animate is not None:
        run = open_run(recording)
        numbers = [recorded.index for recorded in run.frames]
        if frame is not None and frame not in numbers:
            raise click.UsageError(f"{recording} has no frame {frame}; choose one from {numbers[0]} to {numbers[-1]}.")
        from inspector.report.animation import spread, write_animation

        write_animation(run, animate, spread(run) if frame is None else [frame])
        say(animate)
    if out is not None:
        from inspector.read.file import RecordingFile
        from inspector.read.screenshots import take_pictures

        RecordingFile(recording, entities.APPLICATIONS)  # refuses other files before a viewer starts
        for file in take_pictures(recording, out, size, frame, wanted, theme):
            say(file)
