"""``calib-inspect fit-verdict``: coefficients of the verdict for a set of weights."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from calibnet.runtime.threads import cores
from calibnet.verdict import DRIVE_TOLERANCES, FRAME_TOLERANCES
from inspector.cli.options import FOLDER, SEED, STAGES, NumberRange
from inspector.cli.output import make_console, say

if TYPE_CHECKING:
    from calibnet.evaluation.lens_fit import LensFigures
    from calibnet.evaluation.verdict_fit import FitFigures
    from calibnet.evaluation.verdict_runs import VerdictRun
    from calibnet.judging.lens_causes import LensOdds


MOST_WORKERS = 8
"""Largest default number of worker processes, each of which takes about a gigabyte of memory."""


@click.command("fit-verdict")
@click.option("--weights", type=FOLDER, required=True, help="Folder of the weights; the coefficients go there.")
@click.option("--preset", default="compact", show_default=True, help="Network of the weights.")
@click.option(
    "--data",
    multiple=True,
    metavar="DATASET:DIR[:SEQ]",
    help="Frames with a correct extrinsic that were not trained on. Repeatable; many rigs are better.",
)
@click.option(
    "--drive-data",
    multiple=True,
    metavar="DATASET:DIR[:SEQ]",
    help="Drives to use in addition to those of --data, preferably of eight frames or more. Repeatable.",
)
@click.option(
    "--synthetic-drives",
    "synthetic",
    type=click.IntRange(0),
    default=3,
    show_default=True,
    help="Synthetic drives to add, each with different sensors.",
)
@click.option("--runs", type=click.IntRange(1), default=800, show_default=True, help="Number of runs on single frames.")
@click.option(
    "--lenses", type=click.IntRange(0), default=400, show_default=True, help="Number of runs with faults of the lens."
)
@click.option("--drives", type=click.IntRange(0), default=80, show_default=True, help="Number of runs on drives.")
@click.option(
    "--drive-lenses",
    type=click.IntRange(0),
    default=120,
    show_default=True,
    help="Number of runs on drives with faults of the lens.",
)
@click.option(
    "--minutes",
    type=NumberRange(0, min_open=True),
    help="Stop after this time even if --runs and --drives are not finished; the runs made so far are kept for the "
    "next call.",
)
@click.option("--seed", type=SEED, default=0, show_default=True, help="Seed of all random numbers.")
@click.option(
    "--stages",
    type=STAGES,
    default="3-5",
    show_default=True,
    help="Stages to run; guesses are drawn from the range of the first.",
)
@click.option(
    "--workers", type=click.IntRange(0), help="Processes, of one thread each.  [default: as many as cores, 8 at most]"
)
def fit_verdict(
    weights: Path,
    preset: str,
    data: tuple[str, ...],
    drive_data: tuple[str, ...],
    synthetic: int,
    runs: int,
    lenses: int,
    drives: int,
    drive_lenses: int,
    minutes: float | None,
    seed: int,
    stages: tuple[int, ...],
    workers: int | None,
) -> None:
    """Fit the verdict to your own weights; without that, none of their results is accepted.

    Calibrates frames with known extrinsics from random guesses, half of them with one of the battery's faults, and fits
    a classifier of right and wrong results. Writes PRESET-verdict.toml beside the weights. It is valid for these
    weights only: fit it again after further training. Runs are appended to PRESET-verdict.jsonl as they are made, and
    the same command continues from there.

    \b
    calib-inspect fit-verdict --weights runs --data kitti-raw:KITTI/raw:2011_09_26/0048 --data folder:RIGS
    """  # noqa: D301 - click knows a paragraph that must not be wrapped by this character
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from calibnet.errors import CalibrationError
    from calibnet.evaluation.lens_fit import fit_lens
    from calibnet.evaluation.verdict_fit import fit_drives, fit_frames
    from calibnet.evaluation.verdict_log import RunLog, Source, collect, runner
    from calibnet.geometry import RANGES
    from calibnet.judging.coefficients import Coefficients, coefficients_path
    from calibnet.weights.fingerprint import fingerprints

    ranges = [RANGES[number - 1] for number in stages]
    source = Source(preset, weights, stages, data, synthetic, seed)
    of_drive = replace(source, data=data + drive_data, kind="drives")
    of_drive.sequences()  # errors in them are reported before anything is started
    marks = fingerprints(preset, weights, ranges)
    path = coefficients_path(preset, weights)
    until = time.monotonic() + 60 * (float("inf") if minutes is None else minutes)
    processes = min(cores(), MOST_WORKERS) if workers is None else workers
    console = make_console()

    def made(source: Source, count: int, title: str) -> list[VerdictRun]:
        key = {"weights": {str(range_): mark for range_, mark in marks.items()}}
        key |= {name: value for name, value in asdict(source).items() if name not in ("preset", "weights", "stages")}
        log = RunLog(path.with_suffix(".jsonl"), key)
        columns = (
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
        )
        with Progress(*columns, console=console, transient=True) as progress, runner(source, processes) as run:
            task = progress.add_task(title, total=count)
            return collect(
                log,
                count,
                run,
                processes,
                lambda: time.monotonic() < until,
                lambda done: progress.update(task, completed=done),
            )

    of_frames = made(source, runs, "frames")
    classifier, covariance, figures = fit_frames(of_frames, (min(ranges), max(ranges)))
    fitted: dict[str, object] = {
        "data": [short(spec) for spec in of_drive.data],
        "synthetic": synthetic,
        "seed": seed,
        "frames": figures.as_dict(),
    }
    coefficients = Coefficients(classifier, covariance, weights=marks, missing="")
    for line in figure_lines(figures):
        console.print(line)

    def named(source: Source, count: int, of: str) -> LensOdds | None:
        """The regression that names faults of the lens, fitted to this many runs; None if they are too few."""
        try:
            odds, figures = fit_lens(made(source, count, f"lenses of {of}") if count else [])
        except CalibrationError as error:
            console.print(f"Faults of the lens of {of} will not be named. {error}", style="yellow")
            return None
        fitted[source.kind] = asdict(figures)
        for line in lens_figure_lines(figures):
            console.print(line)
        return odds

    lens = named(replace(source, kind="lenses"), lenses, "frames")
    of_drives = made(of_drive, drives, "drives") if drives else []
    try:
        drive, inflation, figures = fit_drives(of_drives)
    except CalibrationError as error:
        console.print(f"Drives will not be accepted. {error}", style="yellow")
    else:
        fitted["drives"] = figures.as_dict()
        coefficients = replace(coefficients, drive=drive, inflation=inflation)
        for line in figure_lines(figures, "drives"):
            console.print(line)
    drive_lens = named(replace(of_drive, kind="drive-lenses"), drive_lenses, "drives")
    replace(coefficients, lens=lens, drive_lens=drive_lens, fitted=fitted).write(path)
    say(path)


def short(spec: str) -> str:
    """``DATASET:DIR[:SEQ]`` with the folder's name only, since the path before it differs between machines."""
    dataset, folder, *sequence = spec.split(":")
    return ":".join([dataset, Path(folder).name, *sequence])


def figure_lines(figures: FitFigures, of: str = "frames") -> Iterator[str]:
    """The figures of the fit, as lines of text."""
    tolerance = (DRIVE_TOLERANCES if of == "drives" else FRAME_TOLERANCES)[1]
    yield f"{figures.runs} runs of {of} on {figures.sequences} sequences."
    yield f"{figures.plain} of them have no fault; {figures.good} of those end with a right result."
    yield "Cross-validated, leaving out one sequence at a time:"
    yield f"  accepted though wrong: {figures.false_accept_rate:.1%} of all runs"
    yield f"  accepted: {figures.acceptance_of_good:.0%} of the right results without a fault"
    yield f"  rejected: {figures.wrong_rejected:.0%} of the wrong results"
    for name, kept in (("acceptance_of_good", ""), ("acceptance_of_clear", ", without runs close to a limit")):
        points = (f"{point[name]:.0%} at {point['false_accepts']:.2%}" for point in figures.curve)
        yield f"  accepted of the right results at other rates of false accepts{kept}: {', '.join(points)}"
    yield f"  normalised squared error (NEES) per degree of freedom: {figures.nees:.2f}"
    if figures.coarser is not None:
        yield f"  certain to be within {tolerance}: {figures.coarser.acceptance_of_good:.0%} of the results that are"
        yield f"  certain to be within {tolerance} though wrong: {figures.coarser.false_accept_rate:.1%} of all runs"


def lens_figure_lines(figures: LensFigures) -> Iterator[str]:
    """The figures of the lens classifier, as lines of text."""
    yield f"{figures.runs} runs on {figures.sequences} sequences, {figures.faulty} of them with a fault of the lens."
    yield "Cross-validated, leaving out one sequence at a time:"
    yield f"  named correctly: {figures.right:.0%} of them, wrongly: {figures.wrong:.1%}"
    yield f"  a fault named where there is none: {figures.named_without:.1%} of the others"
