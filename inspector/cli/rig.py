"""``calib-inspect rig``: several cameras and a LiDAR, calibrated one by one or as one rigid rig."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click
import numpy as np

from calibnet.geometry.types import Transform
from calibnet.runtime.text import file_name
from calibnet.runtime.writing import Kind
from inspector.cli.errors import ExitCode
from inspector.cli.options import ANGLE, AXES, FOLDER, LENGTH, MISCALIBRATION, STAGES, TOLERANCE
from inspector.cli.output import JSON_FILE, make_console, prepare, prepare_json, say, write, write_json
from inspector.cli.preparing import describe_provenance
from inspector.cli.run import recording_to
from inspector.cli.viewing import next_lines, saved_lines, viewing_options

if TYPE_CHECKING:
    from calibnet.geometry.prior import Tolerance
    from inspector.cli.viewing import Viewing


@click.command()
@click.argument("folders", type=FOLDER, nargs=-1, required=True, metavar="FOLDER | DIR DIR...")
@click.option(
    "--rigid",
    is_flag=True,
    help="Solve one pose for all cameras, whose places on the rig are known from rig_from_camera in their calibrations "
    "or else from the given extrinsics.",
)
@click.option(
    "--tolerance",
    type=TOLERANCE,
    help="Like --rigid, but each camera may deviate from its place on the rig by this standard deviation per axis, for "
    "instance 0.5deg/2cm.",
)
@click.option(
    "--miscalibrate",
    "miscalibration",
    type=MISCALIBRATION,
    help="Apply this miscalibration to the rig, in the axes of the first camera, and use the given extrinsics as the "
    "reference.",
)
@click.option(
    "--fix",
    type=AXES,
    help="Axes of the initial extrinsic that are exact, of each camera or, with --rigid, of the first camera.",
)
@click.option("--prior-translation", type=LENGTH, help="Standard deviation per axis to which the position is known.")
@click.option("--prior-rotation", type=ANGLE, help="Standard deviation per axis to which the rotation is known.")
@click.option("--stages", type=STAGES, default="3-5", show_default=True, help="Stages to run.")
@click.option("--preset", default="compact", show_default=True, help="Network to use.")
@click.option("--weights", type=FOLDER, help="Folder with the network's weights.  [default: those of the package]")
@click.option("--json", "json_file", type=JSON_FILE, metavar="FILE|-", help="The extrinsics as JSON; - for stdout.")
@click.option(
    "--output",
    type=FOLDER,
    metavar="DIR",
    help="Write a calibration file NAME.yaml to this folder for each camera that is not rejected.",
)
@viewing_options
def rig(
    folders: tuple[Path, ...],
    rigid: bool,
    tolerance: Tolerance | None,
    miscalibration: Transform | None,
    fix: tuple[str, ...] | None,
    prior_translation: float | None,
    prior_rotation: float | None,
    stages: tuple[int, ...],
    preset: str,
    weights: Path | None,
    json_file: str | None,
    output: Path | None,
    viewing: Viewing,
) -> int:
    """Calibrate several cameras against one LiDAR.

    FOLDER holds cameras/NAME/ for each camera, with images/ and calibration.yaml, and a clouds/ for those cameras that
    have none of their own. Alternatively, give a plain folder for each camera. Without --rigid, each camera is solved
    on its own from all its frames; with it, one pose of the rig is solved from all frames of all cameras, and with
    --tolerance also the pose of each camera on the rig.

    The recording shows all cameras side by side; `report` makes a page of it, and `export` files for other tools.

    The last line is the verdict of the worst camera. Exits with 0, whatever the verdict, as `folder` does.
    """
    from calibnet.cascade.cascade import Cascade
    from calibnet.geometry.prior import Prior
    from calibnet.runtime.interruption import StopRequest
    from inspector.export.exported import exported_camera
    from inspector.export.registry import export_as
    from inspector.record.recording import RunDescription
    from inspector.record.rig import record_rig
    from inspector.run.progress import drive_observer, frame_progress
    from inspector.run.rig import notes_of, open_rig, solve
    from inspector.run.session import STOPPING

    if rigid and tolerance is not None:
        raise click.UsageError("Give either --rigid or --tolerance, not both.")
    cameras = open_rig(folders)
    prepare_json(json_file)
    files = {camera: output / f"{file_name(camera)}.yaml" for camera in cameras} if output is not None else {}
    for file in files.values():
        prepare(file, Kind.EXPORT)
    name = f"rig/{folders[0].resolve().name}" if len(folders) == 1 else f"rig/{'+'.join(cameras)}"
    outputs = viewing.outputs(name)
    outputs.check()
    beside = json_file == "-"
    with recording_to(outputs):
        prior = Prior.of(fix or (), prior_translation, prior_rotation)
        cascade = Cascade.load(preset, stages, weights, False, prior)
        for note in notes_of(cameras, rigid or tolerance is not None):
            say(note, err=True)
        with StopRequest(STOPPING) as stop, frame_progress(make_console()) as progress:
            observer = partial(drive_observer, progress, stop)
            solved = solve(cascade, cameras, rigid, miscalibration, observer, tolerance)
            options = {
                "sequence": name,
                "cameras": ", ".join(cameras),
                "solved": solved.how,
                "start": "as given" if miscalibration is None else np.array2string(miscalibration, precision=9),
                "known": prior.words,
                "stages": ", ".join(map(str, stages)),
                "preset": preset,
            }
            description = RunDescription(name, options, describe_provenance(preset, list(stages), weights))
            shown = record_rig(outputs.open(), description, solved, cameras, observer("recording"))
        outputs.complete()
        *said, verdict = solved.lines()
        for line in said:
            say(line, err=beside)
        write_json(json_file, solved.as_dict())
        for one in solved.not_rejected if files else ():
            write(files[one.name], export_as("yaml", exported_camera(one)).encode(), Kind.EXPORT)
            say(f"Saved {files[one.name]}.", err=beside)
        if outputs.file is not None:
            for line in [*saved_lines(outputs, shown), *next_lines(outputs.file, rig=True)]:
                say(line, err=beside)
        say(verdict, err=beside)
        if outputs.page is not None:
            say(f"Serving at {outputs.page} until Ctrl-C.", err=beside)
            outputs.wait_while_serving()
    return ExitCode.OK
