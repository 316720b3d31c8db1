"""``calib-inspect evaluate``: errors and success rates of every stage, on any dataset."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from calibnet.datasets import DATASETS, Sequence, open_sequence, select_frames
from inspector.cli.options import FOLDER, FRAMES, RANGE, STAGES
from inspector.cli.output import JSON_FILE, console_beside, prepare_json, write_json

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from calibnet.evaluation.metrics import Metrics
    from calibnet.evaluation.runner import Evaluation, Run
    from calibnet.geometry import MiscalibrationRange


@click.command()
@click.option("--dataset", type=click.Choice(list(DATASETS)), required=True, help="What --root holds.")
@click.option("--root", type=click.Path(path_type=Path), required=True, help="The dataset's folder.")
@click.option(
    "--sequences",
    metavar="NAMES",
    help="Comma-separated: numbers (kitti-odometry), DATE/DRIVE (kitti-raw), splits (kitti-object), folders below "
    "--root (folder; without it --root itself).",
)
@click.option("--camera", type=click.IntRange(0, 3), help="Camera of the KITTI datasets.  [default: 2]")
@click.option("--frames", type=FRAMES, default=":", help="Positions in every sequence, for instance 0:100:5.")
@click.option("--range", "bounds", type=RANGE, default="5/0.5", show_default=True, help="Of the miscalibrations.")
@click.option("--repeats", type=click.IntRange(1), default=1, show_default=True, help="Miscalibrations a frame.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the miscalibrations.")
@click.option("--stages", type=STAGES, help="Stages to run, for instance 3-5.  [default: those within --range]")
@click.option("--preset", default="compact", show_default=True, help="Network to measure.")
@click.option("--weights", type=FOLDER, help="Folder of its weights.  [default: those of the package]")
@click.option("--json", "json_file", type=JSON_FILE, metavar="FILE|-", help="Also as JSON; - for stdout.")
def evaluate(
    dataset: str,
    root: Path,
    sequences: str | None,
    camera: int | None,
    frames: str,
    bounds: MiscalibrationRange,
    repeats: int,
    seed: int,
    stages: tuple[int, ...] | None,
    preset: str,
    weights: Path | None,
    json_file: str | None,
) -> None:
    """Measure the cascade: every frame, from seeded random miscalibrations, against the dataset's extrinsic.

    Prints mean, median, standard deviation, 95th percentile, per-axis mean absolute errors and success
    rates, for the initial error and after each stage.
    """
    opened = open_sequences(dataset, root, sequences, camera)
    total = repeats * sum(len(select_frames(sequence, frames)) for sequence in opened)
    prepare_json(json_file)

    from calibnet.cascade import Cascade
    from calibnet.evaluation import runner
    from calibnet.geometry import stages_within

    cascade = Cascade.load(preset, stages or stages_within(bounds), weights)
    for skipped in cascade.skipped:
        click.echo(skipped.reason, err=True)
    console = console_beside(json_file)
    with progress_bar(total) as advance:
        evaluation = runner.evaluate(cascade, opened, bounds, repeats, seed, observer=advance, frames=frames)
    report(evaluation, console)
    write_json(json_file, evaluation.as_dict())


def open_sequences(dataset: str, root: Path, names: str | None, camera: int | None) -> list[Sequence]:
    """Open what ``--sequences`` names; each dataset calls its parts differently."""
    options = {} if camera is None else {"camera": camera}
    parts = [part.strip() for part in names.split(",") if part.strip()] if names else []
    if dataset == "folder":
        return [open_sequence(dataset, root / part, **options) for part in parts or ["."]]
    if dataset == "kitti-object":
        return [open_sequence(dataset, root, split=part, **options) for part in parts or ["training"]]
    if not parts:
        example = "2011_09_26/0005" if dataset == "kitti-raw" else "04"
        raise click.UsageError(f"--sequences is needed with --dataset {dataset}, for instance --sequences {example}.")
    if dataset == "kitti-raw":
        return [open_sequence(dataset, root, **drive(part), **options) for part in parts]
    return [open_sequence(dataset, root, sequence=part, **options) for part in parts]


def drive(text: str) -> dict[str, str]:
    """Split ``DATE/DRIVE``."""
    date, slash, number = text.partition("/")
    if not (date and slash and number):
        raise click.UsageError(f"{text!r} is not DATE/DRIVE, for instance 2011_09_26/0005.")
    return {"date": date, "drive": number}


@contextlib.contextmanager
def progress_bar(total: int) -> Iterator[Callable[[Run], None]]:
    """Show a bar on stderr; yields what to call after every run."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("evaluating", total=total)

        def advance(run: Run) -> None:
            progress.update(task, advance=1, description=f"{run.sequence} frame {run.frame}")

        yield advance


def report(evaluation: Evaluation, console: Console) -> None:
    """Print what was measured on, then tables of rotation, translation and success."""
    runs = len(evaluation.runs)
    console.print(
        f"{', '.join(evaluation.sequences)} ({evaluation.rig}): {evaluation.frames} frames x {evaluation.repeats} = "
        f"{runs} runs from ±{evaluation.bounds.rotation_deg:g}° / ±{evaluation.bounds.translation_m:g} m, "
        f"seed {evaluation.seed}"
    )
    rows = [("initial", evaluation.initial)]
    rows += [(f"stage {stage.number} ({stage.range})", stage.metrics) for stage in evaluation.stages]
    for title, key, decimals in (
        ("Rotation error, degrees", "rotation_deg", 3),
        ("Translation error, cm", "translation_cm", 2),
    ):
        console.print(error_table(title, [(name, metrics.as_dict()[key]) for name, metrics in rows], decimals))
    console.print(success_table(rows))
    if evaluation.failed:
        console.print(
            f"{evaluation.failed} of {runs} runs could not be calibrated and count with their initial error.",
            style="yellow",
        )


def error_table(title: str, rows: list[tuple[str, dict[str, float]]], decimals: int) -> Table:
    """One row for the initial error and one a stage; per axis the mean absolute error."""
    table = plain_table(title)
    for heading in rows[0][1]:
        table.add_column(heading, justify="right")
    for name, figures in rows:
        table.add_row(name, *(f"{value:.{decimals}f}" for value in figures.values()))
    return table


def success_table(rows: list[tuple[str, Metrics]]) -> Table:
    """The share of runs below both bounds."""
    table = plain_table("Success rate")
    table.add_column("< 2° and < 5 cm", justify="right")
    table.add_column("< 1° and < 2.5 cm", justify="right")
    for name, metrics in rows:
        table.add_row(name, f"{metrics.success_2deg_5cm:.1%}", f"{metrics.success_1deg_2_5cm:.1%}")
    return table


def plain_table(title: str) -> Table:
    """An empty table that fits into 80 columns, its first column being the row's name."""
    from rich import box
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD)
    table.add_column("after", no_wrap=True)
    return table
