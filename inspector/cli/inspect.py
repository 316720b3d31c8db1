"""``calib-inspect seq|raw|object|folder|demo``: calibrate frames and record every stage."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from calibnet.errors import ConfigError
from calibnet.geometry.types import Transform
from inspector.cli.errors import ExitCode, fail
from inspector.cli.options import FOLDER, FRAMES, MISCALIBRATION, PARTS, RANGE, STAGES
from inspector.cli.viewing import RECORDINGS, choose_outputs, saved_lines, viewing_options

if TYPE_CHECKING:
    from rich.console import Console

    from calibnet.datasets import Sequence
    from calibnet.geometry import MiscalibrationRange
    from inspector.record.contents import Contents
    from inspector.record.outputs import Outputs
    from inspector.run.start import Start
    from inspector.run.summary import Summary

DEFAULT_RANGE = "5/0.5"
DEMO_LENGTH = 12

_SHARED_OPTIONS: tuple[Callable[..., Any], ...] = (
    click.option("--frames", type=FRAMES, default=":", help="Positions to run, for instance 0:100:5.  [default: all]"),
    click.option(
        "--range",
        "range_",
        type=RANGE,
        help=f"Draw the miscalibration from ± these degrees and metres.  [default: {DEFAULT_RANGE}]",
    ),
    click.option("--miscalibrate", "given", type=MISCALIBRATION, help="This miscalibration, instead of drawing one."),
    click.option("--per-frame", is_flag=True, help="Draw one for every frame, not one for the run."),
    click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Of everything random."),
    click.option(
        "--sequence-estimate",
        is_flag=True,
        help="After the frames, solve them all as one drive on one mount, and record how the estimate converges.",
    ),
    click.option("--stages", type=STAGES, help="Stages to run, for instance 3-5.  [default: those within the range]"),
    click.option("--preset", default="compact", show_default=True, help="Network to use."),
    click.option("--weights", type=FOLDER, help="Folder of its weights.  [default: those of the package]"),
    click.option(
        "--detail",
        type=click.Choice(["overview", "full", "custom"]),
        help="full: some 6 MB a frame; overview: fewer points, the finest scale and no raw volumes, 1 MB at most; "
        "custom: what --log names.  [default: full]",
    ),
    click.option(
        "--log",
        "parts",
        type=PARTS,
        help="With --detail custom, parts of a frame to record: curves (errors), overlays (after every stage), volumes "
        "(maps of the cost volumes), hourglass (activations), scene (3D), tensors (raw volumes, all slices). Image, "
        "first and last overlay, extrinsics and table are always there.",
    ),
    click.option(
        "--color",
        type=click.Choice(["depth", "intensity", "edge", "error"]),
        default="depth",
        show_default=True,
        help="Of the points over the image; edge: those at depth edges stand out; error: pixels off the reference.",
    ),
    click.option(
        "--report", type=FOLDER, metavar="DIR", help="Make a report of the run there, as `calib-inspect report` does."
    ),
)


def shared_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command all options of a calibration run; it passes them on to `calibrate`."""
    command = viewing_options(command)
    for option in reversed(_SHARED_OPTIONS):
        command = option(command)
    return command


root_option = click.option("--root", type=FOLDER, envvar="KITTI_ROOT", help="The dataset's folder.  [env: KITTI_ROOT]")
camera_option = click.option(
    "--camera", type=click.IntRange(min=0), default=2, show_default=True, help="Camera to calibrate."
)


@click.command()
@click.argument("sequence")
@root_option
@camera_option
@shared_options
def seq(sequence: str, root: Path | None, camera: int, **options: Any) -> int:
    """Calibrate a KITTI odometry sequence, for instance 04.

    --root is the folder that holds `sequences`.
    """
    from calibnet.datasets import open_sequence

    folder = require_root(root, "odometry")
    return calibrate(
        open_sequence("kitti-odometry", folder, sequence=sequence, camera=camera), camera=camera, **options
    )


@click.command()
@click.argument("date")
@click.argument("drive")
@root_option
@camera_option
@shared_options
def raw(date: str, drive: str, root: Path | None, camera: int, **options: Any) -> int:
    """Calibrate a KITTI raw drive, for instance 2011_09_26 0005.

    --root is the folder that holds the dates.
    """
    from calibnet.datasets import open_sequence

    folder = require_root(root, "raw")
    return calibrate(
        open_sequence("kitti-raw", folder, date=date, drive=drive, camera=camera), camera=camera, **options
    )


@click.command("object")
@click.option("--split", default="training", show_default=True, help="training, testing, or a list in ImageSets.")
@root_option
@camera_option
@shared_options
def object_(split: str, root: Path | None, camera: int, **options: Any) -> int:
    """Calibrate the frames of the KITTI object detection benchmark.

    --root is the folder that holds `training`.
    """
    from calibnet.datasets import open_sequence

    folder = require_root(root, "object detection")
    return calibrate(open_sequence("kitti-object", folder, split=split, camera=camera), camera=camera, **options)


@click.command()
@click.argument("directory", type=FOLDER)
@shared_options
def folder(directory: Path, **options: Any) -> int:
    """Calibrate your own images/, clouds/ and calibration.yaml.

    Without --range and --miscalibrate the calibration.yaml is what is to be corrected; with them it
    is the reference.
    """
    from calibnet.datasets import open_sequence

    as_is = options["range_"] is None and options["given"] is None
    return calibrate(open_sequence("folder", directory), as_is=as_is, **options)


@click.command()
@click.option("--length", type=click.IntRange(min=1), default=DEMO_LENGTH, show_default=True, help="Frames to drive.")
@shared_options
def demo(length: int, **options: Any) -> int:
    """Calibrate a drive through the synthetic world: needs no data.

    The recording is kept in recordings/demo.rrd.
    """
    from calibnet.datasets.synthetic import KITTI_LIKE, SyntheticSequence

    if options["report"] is None:
        options["save"] = options["save"] or RECORDINGS / "demo.rrd"
    return calibrate(SyntheticSequence(seed=options["seed"], length=length, rig=KITTI_LIKE), **options)


def require_root(root: Path | None, part: str) -> Path:
    """The dataset's folder, or one sentence that says how to get one."""
    if root is None:
        raise ConfigError(
            f"No KITTI folder: give --root DIR or set KITTI_ROOT to where KITTI {part} is unpacked "
            "(from cvlibs.net/datasets/kitti); `calib-inspect demo` needs none."
        )
    return root


def calibrate(
    sequence: Sequence,
    *,
    frames: str,
    range_: MiscalibrationRange | None,
    given: Transform | None,
    per_frame: bool,
    seed: int,
    sequence_estimate: bool,
    stages: tuple[int, ...] | None,
    preset: str,
    weights: Path | None,
    detail: str | None,
    parts: tuple[str, ...] | None,
    color: str,
    report: Path | None,
    save: Path | None,
    headless: bool,
    serve: bool,
    bind: str,
    connect: str | None,
    camera: int | None = None,
    as_is: bool = False,
) -> int:
    """Run the cascade on a sequence as the options say; returns the exit code."""
    from rich.console import Console

    from calibnet.cascade.cascade import Cascade
    from calibnet.datasets import select_frames
    from calibnet.geometry import MiscalibrationRange
    from inspector.record.recording import RunDescription
    from inspector.record.stream import RecordingLostError
    from inspector.run.session import Session
    from inspector.run.start import Start

    if range_ is not None and given is not None:
        raise click.UsageError("Give --range or --miscalibrate, not both.")
    if given is not None and per_frame:
        raise click.UsageError("--per-frame draws from --range; --miscalibrate is the same for all frames.")
    if sequence_estimate and per_frame:
        raise click.UsageError("--sequence-estimate needs one mount for all frames; --per-frame moves it in each.")
    if as_is and color == "error":
        raise click.UsageError(
            f"--color error shows the distance to the reference, and {sequence.name} has none: give --range or "
            "--miscalibrate to take its calibration for the reference, or choose another --color."
        )
    contents = choose_contents(detail, parts, color)
    positions = select_frames(sequence, frames)
    if report is not None:
        from inspector.report.write import RECORDING, check_folder

        check_folder(report)
        save = save or report / RECORDING
    outputs = choose_outputs(sequence.name, save, headless, serve, bind, connect)
    outputs.check()
    start = Start(range_ or MiscalibrationRange.parse(DEFAULT_RANGE), seed, per_frame, given, as_is)
    cascade = Cascade.load(preset, stages or start.stages, weights)
    console = Console(stderr=True, highlight=False)
    announce(console, sequence, start, cascade)
    identity = {
        "sequence": sequence.name,
        "rig": sequence.rig,
        "frames": frames,
        "camera": "" if camera is None else str(camera),
        "start": describe(start),
        "seed": seed,
        "stages": ",".join(str(stage.number) for stage in cascade.stages),
        "preset": preset,
        "detail": detail or "full",
        "parts": ",".join(sorted(contents.parts)),
        "color": color,
        "sequence_estimate": sequence_estimate,
    }
    provenance = describe_provenance(preset, [stage.number for stage in cascade.stages], weights)
    description = RunDescription(f"{sequence.name}, {describe(start)}", identity, provenance)
    session = Session(sequence, positions, cascade, start, outputs, description, contents, console, sequence_estimate)
    try:
        summary = session.run()
        return finish(summary, outputs, report)
    except RecordingLostError as error:
        os._exit(fail(str(error)))  # Rerun would wait for its dead writer for ever at the interpreter's end
    finally:
        outputs.close()


def choose_contents(detail: str | None, parts: tuple[str, ...] | None, color: str) -> Contents:
    """What is recorded of each frame; --log alone means --detail custom."""
    from inspector.record.contents import Coloring, Contents, Detail, Part

    level = Detail(detail or ("full" if parts is None else "custom"))
    if (level is Detail.CUSTOM) != (parts is not None):
        raise click.UsageError("--detail custom and --log belong together: --log says which parts to record.")
    return Contents.of(level, frozenset(map(Part, parts or ())), Coloring(color))


def announce(console: Console, sequence: Sequence, start: Start, cascade: Any) -> None:
    """Say what is about to run, and which stages cannot."""
    numbers = ", ".join(str(stage.number) for stage in cascade.stages)
    console.print(
        f"{sequence.name} ({sequence.rig}), {describe(start)}, stages {numbers}", markup=False, soft_wrap=True
    )
    for stage in cascade.skipped:
        console.print(f"Skipped: {stage.reason}", style="yellow", markup=False, soft_wrap=True)


def describe(start: Start) -> str:
    """Where the calibration starts, in words."""
    if start.as_is:
        return "from the calibration as it is"
    if start.given is not None:
        return "miscalibrated as given"
    return f"miscalibrated within {start.range}{', anew every frame' if start.per_frame else ''}, seed {start.seed}"


def describe_provenance(preset: str, stages: list[int], folder: Path | None) -> dict[str, str]:
    """Versions, and as JSON the training record of every stage's weights by its number."""
    import json
    from importlib.metadata import version

    from calibnet import __version__
    from calibnet.geometry import RANGES
    from calibnet.weights import read_record, weights_path

    files = {number: weights_path(preset, RANGES[number - 1], folder) for number in stages}
    records = {number: read_record(file) for number, file in files.items() if file.is_file()}
    versions = {"torch": version("torch"), "rerun": version("rerun-sdk")}
    return {"calib_inspect": __version__, **versions, "weights": json.dumps(records)}


def finish(summary: Summary, outputs: Outputs, report: Path | None) -> int:
    """Print the result and where it is, make the report, and serve until Ctrl-C where that was asked for."""
    for line in summary.lines():
        click.echo(line)
    if outputs.file is not None and summary.frames:
        click.echo(size_line(outputs.file, summary.frames))
        for line in saved_lines(outputs.file, summary.frames):
            click.echo(line)
        if report is not None:
            from inspector.cli.report import write_report_of

            write_report_of(outputs.file, report)
    if summary.interrupted:
        click.echo("Interrupted: the frames above are all that was recorded.", err=True)
        return ExitCode.INTERRUPTED
    if outputs.page is not None:
        click.echo(f"Serving at {outputs.page} until Ctrl-C.")
        outputs.wait_while_serving()
    return ExitCode.OK


def size_line(file: Path, frames: int) -> str:
    """What a frame's bytes go to."""
    from inspector.read.sizes import sizes_by_group

    parts = [f"{group} {size / frames / 1e3:.0f}" for group, size in sizes_by_group(file).items()]
    return f"Kilobytes a frame: {', '.join(parts)}."
