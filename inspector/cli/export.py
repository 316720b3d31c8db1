"""``calib-inspect export``: the corrected extrinsic for other tools."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from calibnet.runtime.text import file_name
from inspector.cli.errors import ExitCode
from inspector.cli.options import FOLDER
from inspector.cli.output import OUTPUT_FILE, hold, overwrite_option, say, write
from inspector.cli.recordings import RECORDING, open_run
from inspector.export.registry import FORMATS, export_as, kind_of_export, suffix_of

if TYPE_CHECKING:
    from inspector.export.exported import Exported, FrameNames

ROS_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_/]*")


@click.command()
@click.argument("recording", type=RECORDING, required=False, metavar="[RUN.rrd]")
@click.option("--folder", type=FOLDER, help="Export the calibration.yaml of this folder instead of a recording.")
@click.option("--format", "form", type=click.Choice(FORMATS.names()), required=True, help="Format to write.")
@click.option("--frame", type=click.IntRange(min=0), metavar="N", help="The extrinsic of this frame.")
@click.option("--median", is_flag=True, help="The median of all frames' extrinsics.  [default without a drive]")
@click.option("--drive", is_flag=True, help="The extrinsic of the drive.  [default where it was solved]")
@click.option("--force", is_flag=True, help="Write the extrinsic even if it is rejected.")
@click.option("--camera", metavar="NAME", help="The camera of a rig.  [default: all, into the folder --output]")
@click.option(
    "--output",
    type=click.Path(),
    metavar="FILE",
    help="File to write; for all cameras of a rig, a folder.  [default: stdout]",
)
@overwrite_option
@click.option("--camera-frame", default="camera_optical_frame", show_default=True, help="ROS name of the camera.")
@click.option("--lidar-frame", default="lidar", show_default=True, help="ROS name of the LiDAR.")
@click.option(
    "--parent",
    type=click.Choice(["lidar", "camera"]),
    default="lidar",
    show_default=True,
    help="Which of the two is the ROS parent frame.",
)
def export(
    recording: Path | None,
    folder: Path | None,
    form: str,
    frame: int | None,
    median: bool,
    drive: bool,
    force: bool,
    camera: str | None,
    output: str | None,
    camera_frame: str,
    lidar_frame: str,
    parent: str,
) -> int:
    """Write the corrected extrinsic in the format of another tool, or as a calibration.yaml.

    By default, writes that of the whole drive or, without one, the geometric median of all frames, which is robust
    against outliers. Every file states its convention.

    A rejected extrinsic is not written, and the exit code is 1, unless --force is given. A warning on stderr and in the
    file marks one that is rejected or cannot tell.

    For the recording of a rig, --output is a folder with one file per camera, named like it; --camera chooses one.
    """
    if (recording is None) == (folder is None):
        raise click.UsageError("Give a recording or --folder DIR.")
    choices = (frame is not None) + median + drive
    if choices > 1:
        raise click.UsageError("Give one of --frame, --median and --drive.")
    if folder is not None and choices:
        raise click.UsageError("--frame, --median and --drive choose from a recording; leave them out with --folder.")
    for name in (camera_frame, lidar_frame):
        if ROS_NAME.fullmatch(name) is None:
            raise click.UsageError(f"{name!r} is not a valid ROS frame name; use letters, digits, _ and /.")

    from inspector.export.exported import FrameNames
    from inspector.read.rig import is_rig

    frames = FrameNames(camera_frame, lidar_frame, parent == "lidar")
    if recording is not None and is_rig(recording):
        if choices:
            raise click.UsageError(
                "--frame, --median and --drive do not apply to rigs, which have one result per camera."
            )
        return export_rig(recording, camera, form, force, output, frames)
    if camera is not None:
        raise click.UsageError("--camera chooses from the recording of a rig; this has one camera.")
    exported = replace(selected_calibration(recording, folder, frame, drive, median), frames=frames)
    return put_out(exported, form, force, output)


def put_out(exported: Exported, form: str, force: bool, output: str | Path | None) -> int:
    """Write a calibration to a file or to stdout, unless it is rejected; returns the exit code."""
    file: Path | None = None if output is None else OUTPUT_FILE.convert(output, None, None)
    may_be_written = force or exported.verdict is None or exported.verdict.word != "rejected"
    if may_be_written:
        text = export_as(form, exported)
        if file is None:
            click.echo(text, nl=False)
        else:
            write(file, text.encode(), kind_of_export(text))
    warn(exported, "It was written." if may_be_written else "Nothing was written; --force writes it.")
    if not may_be_written:
        return ExitCode.CHECK_FAILED
    if file is not None:
        say(f"Saved {file}: {exported.origin.removesuffix('.')}.", err=True)
    return ExitCode.OK


def export_rig(
    recording: Path, camera: str | None, form: str, force: bool, output: str | None, frames: FrameNames
) -> int:
    """Write one camera of a rig, or all into a folder, with frames named after the cameras; returns the exit code."""
    from inspector.export.exported import exported_camera
    from inspector.read.rig import read_rig

    rig = read_rig(recording)
    if camera is not None:
        one = exported_camera(rig.camera(camera))
        return put_out(replace(one, frames=frames), form, force, output)
    if output is None:
        names = ", ".join(one.name for one in rig.solved.cameras)
        raise click.UsageError(f"Give a folder with --output for all cameras, or one with --camera: {names}.")
    folder = Path(output)
    if folder.exists() and not folder.is_dir():
        raise click.UsageError(
            f"--output {output} is not a folder; give a folder for all cameras, or choose one with --camera."
        )
    files = [folder / f"{file_name(solved.name)}.{suffix_of(form)}" for solved in rig.solved.cameras]
    for file in files:
        hold(file)
    codes = []
    said_names = ros_names([one.name for one in rig.solved.cameras])
    for solved, said, file in zip(rig.solved.cameras, said_names, files, strict=True):
        named = replace(exported_camera(solved), frames=frames._replace(camera=f"{said}_{frames.camera}"))
        codes.append(put_out(named, form, force, file))
    return max(codes)


def ros_names(names: list[str]) -> list[str]:
    """Distinct names made of the characters that ROS allows."""
    said = [re.sub(r"[^A-Za-z0-9_]", "_", name) for name in names]
    return [one if said.count(one) == 1 else f"{one}_{number}" for number, one in enumerate(said)]


def warn(exported: Exported, what: str) -> None:
    """Warn on stderr of a calibration that is not accepted, and say what was done."""
    from inspector.verdicts import explained

    verdict = exported.verdict
    if verdict is not None and verdict.word != "accepted":
        say(f"calib-inspect: {verdict.word.capitalize()}. {explained(verdict)} {what}", err=True)


def selected_calibration(
    recording: Path | None, folder: Path | None, frame: int | None, drive: bool, median: bool
) -> Exported:
    """The extrinsic that the options select."""
    from inspector.export.exported import exported_drive, exported_folder, exported_frame, exported_median

    if folder is not None:
        return exported_folder(folder)
    assert recording is not None
    run = open_run(recording)
    if frame is not None:
        return exported_frame(run, frame)
    if drive or (run.drive is not None and not median):
        return exported_drive(run)
    return exported_median(run)
