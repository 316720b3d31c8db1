"""``calib-inspect evaluate``: errors and success rates of every stage, on any dataset."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from calibnet.datasets import DATASETS, PickedFrames, Sequence, open_sequence, select_frames
from inspector.cli.options import FOLDER, FRAMES, RANGE, STAGES
from inspector.cli.output import JSON_FILE, console_beside, prepare_json, write_json

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from calibnet.cascade.cascade import Cascade
    from calibnet.evaluation.drives import DriveMetrics
    from calibnet.evaluation.metrics import Metrics
    from calibnet.evaluation.runner import Calibrator, Evaluation
    from calibnet.geometry import MiscalibrationRange


@click.command()
@click.option("--dataset", type=click.Choice(list(DATASETS)), required=True, help="What --root holds.")
@click.option("--root", type=click.Path(path_type=Path), required=True, help="The dataset's folder.")
@click.option(
    "--sequences",
    multiple=True,
    metavar="NAME [NAME]...",
    help="Numbers (kitti-odometry), DATE/DRIVE (kitti-raw), splits (kitti-object), folders below --root (folder; "
    "without it --root itself).",
)
@click.argument("more", nargs=-1, metavar="")
@click.option("--camera", type=click.IntRange(0, 3), help="Camera of the KITTI datasets.  [default: 2]")
@click.option("--frames", type=FRAMES, default=":", help="Positions in every sequence, for instance 0:100:5.")
@click.option("--range", "range_", type=RANGE, default="20/1.5", show_default=True, help="Of the miscalibrations.")
@click.option("--repeats", type=click.IntRange(1), default=1, show_default=True, help="Miscalibrations a frame.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the miscalibrations.")
@click.option("--stages", type=STAGES, help="Stages to run, for instance 3-5.  [default: those within --range]")
@click.option("--preset", default="compact", show_default=True, help="Network to measure.")
@click.option("--weights", type=FOLDER, help="Folder of its weights.  [default: those of the package]")
@click.option("--audit", is_flag=True, help="Again with the image swapped, with a grey one, and with fewer rings.")
@click.option("--drives/--no-drives", default=True, help="Also every sequence solved as one.  [default: yes]")
@click.option("--classical/--no-classical", default=True, help="Also a refinement without training.  [default: yes]")
@click.option("--json", "json_file", type=JSON_FILE, metavar="FILE|-", help="Also as JSON; - for stdout.")
def evaluate(
    dataset: str,
    root: Path,
    sequences: tuple[str, ...],
    more: tuple[str, ...],
    camera: int | None,
    frames: str,
    range_: MiscalibrationRange,
    repeats: int,
    seed: int,
    stages: tuple[int, ...] | None,
    preset: str,
    weights: Path | None,
    audit: bool,
    drives: bool,
    classical: bool,
    json_file: str | None,
) -> None:
    """Measure the cascade: every frame, from seeded random miscalibrations, against the dataset's extrinsic.

    Prints mean, median, standard deviation, 95th percentile, per-axis mean absolute errors and success
    rates: for the initial error, a classical refinement (edges and reflectance of the scan onto the image's
    edges and brightness), after each stage on single frames, and for every sequence solved as one: by the
    networks alone and, after stage 5, with its edges aligned.
    """
    names = [part.strip() for text in (*sequences, *more) for part in text.split(",") if part.strip()]
    opened: list[Sequence] = [
        PickedFrames(sequence, select_frames(sequence, frames))
        for sequence in open_sequences(dataset, root, names, camera)
    ]
    prepare_json(json_file)

    from calibnet.cascade.cascade import Cascade
    from calibnet.geometry import stages_within

    cascade = Cascade.load(preset, stages or stages_within(range_), weights)
    for skipped in cascade.skipped:
        click.echo(skipped.reason, err=True)
    console = console_beside(json_file)
    with Bars() as bars:
        measurement = Measurement(opened, range_, repeats, seed, bars)
        evaluation = measurement.single_frames(cascade, "single frames")
        references = {"no correction": evaluation.initial}
        if classical:
            references["edge alignment"] = measurement.classical()
        evaluation = replace(evaluation, references=references)
        if drives:
            solved = measurement.drives(cascade)
            if solved is not None:
                evaluation = replace(evaluation, sequence=solved.estimate, sequence_networks=solved.networks)
        if audit:
            donors = {id(one): find_donors(one, opened, dataset, root) for one in opened}
            altered = measurement.audit(cascade, donors)
            evaluation = replace(
                evaluation,
                audit={name: row.final for name, row in altered.items()},
                audit_unconfirmed={name: row.unconfirmed for name, row in altered.items()},
                audit_images=", ".join(dict.fromkeys(donor.name for donor in donors.values())),
            )
    report(evaluation, console)
    write_json(json_file, evaluation.as_dict())


@dataclass(frozen=True)
class Measurement:
    """What is measured on, and the bars that show how far it is; one method a kind of row."""

    sequences: list[Sequence]
    range: MiscalibrationRange
    repeats: int
    seed: int
    bars: Bars

    def single_frames(self, calibrator: Calibrator, title: str, sequences: list[Sequence] | None = None) -> Evaluation:
        """Every frame by itself."""
        from calibnet.evaluation import runner

        chosen = self.sequences if sequences is None else sequences
        advance = self.bars.add(title, self.repeats * sum(map(len, chosen)))
        return runner.evaluate(
            calibrator, chosen, self.range, self.repeats, self.seed, observer=lambda run: advance(run.sequence)
        )

    def classical(self) -> Metrics:
        """The same by aligning edges."""
        from calibnet.evaluation.edge_alignment import EdgeAlignment

        return self.single_frames(EdgeAlignment(self.range), "edge alignment").final

    def drives(self, cascade: Cascade) -> DriveMetrics | None:
        """Every sequence solved as one."""
        from calibnet.evaluation.drives import evaluate_drives

        show = self.bars.add("whole sequences", None)
        return evaluate_drives(
            cascade, self.sequences, self.range, self.repeats, self.seed, lambda name, *_: show(name)
        )

    def audit(self, cascade: Cascade, donors: dict[int, Sequence]) -> dict[str, Evaluation]:
        """Every frame by itself, altered."""
        from calibnet.evaluation.audit import Altered, alterations

        rows = {}
        for name in alterations(self.sequences[0]):
            altered: list[Sequence] = [
                Altered(sequence, alterations(donors[id(sequence)])[name]) for sequence in self.sequences
            ]
            rows[name] = self.single_frames(cascade, f"audit, {name}", altered)
        return rows


def find_donors(sequence: Sequence, opened: list[Sequence], dataset: str, root: Path) -> Sequence:
    """Where the audit takes other images from for one sequence."""
    from calibnet.datasets.discovery import find_sequences
    from calibnet.evaluation.audit import other_drive

    return other_drive(sequence, opened, lambda: list(find_sequences(dataset, root)))


def open_sequences(dataset: str, root: Path, parts: list[str], camera: int | None) -> list[Sequence]:
    """Open what ``--sequences`` names; each dataset calls its parts differently."""
    options = {} if camera is None else {"camera": camera}
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


class Bars:
    """Progress on stderr, a bar for each kind of row; gone at the end."""

    def __enter__(self) -> Bars:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        self.progress = Progress(*columns, console=Console(stderr=True), transient=True)
        self.progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.progress.stop()

    def add(self, title: str, total: int | None) -> Callable[[str], None]:
        """A new bar; returns what to call, with where it is, after every step."""
        task = self.progress.add_task(title, total=total)

        def advance(where: str) -> None:
            self.progress.update(task, advance=1, description=f"{title}: {where}")

        return advance


def report(evaluation: Evaluation, console: Console) -> None:
    """Print what was measured on, then tables of rotation, translation and success."""
    runs = len(evaluation.runs)
    console.print(
        f"{', '.join(evaluation.sequences)} ({evaluation.rig}): {evaluation.frames} frames x {evaluation.repeats} = "
        f"{runs} runs from {evaluation.range.label}, "
        f"seed {evaluation.seed}"
    )
    rows = [("initial", evaluation.initial)]
    rows += [(name, metrics) for name, metrics in evaluation.references.items() if metrics is not evaluation.initial]
    rows += [(f"stage {stage.number} ({stage.range})", stage.metrics) for stage in evaluation.stages]
    if evaluation.sequence_networks is not None:
        rows.append(("as one, networks", evaluation.sequence_networks))
    if evaluation.sequence is not None:
        rows.append(("sequence as one", evaluation.sequence))
    rows += [(f"audit: {name}", metrics) for name, metrics in evaluation.audit.items()]
    for title, key, decimals in (
        ("Rotation error, degrees", "rotation_deg", 3),
        ("Translation error, cm", "translation_cm", 2),
    ):
        console.print(error_table(title, [(name, metrics.as_dict()[key]) for name, metrics in rows], decimals))
    console.print(success_table(rows))
    if evaluation.audit:
        console.print(audit_sentence(evaluation))
    if evaluation.audit or evaluation.unconfirmed:
        console.print(unconfirmed_sentence(evaluation))
    if evaluation.failed:
        console.print(
            f"{evaluation.failed} of {runs} runs could not be calibrated and count with their initial error.",
            style="yellow",
        )


def audit_sentence(evaluation: Evaluation) -> str:
    """What is left of the initial rotation error with the true image and without it."""
    initial = evaluation.initial.rotation_deg.median
    left = {"the true image": evaluation.final, f"images of {evaluation.audit_images}": evaluation.audit["swapped"]}
    left |= {"a grey image": evaluation.audit["grey"], "half the rings": evaluation.audit["thinned"]}
    shares = ", ".join(f"{metrics.rotation_deg.median / initial:.0%} with {name}" for name, metrics in left.items())
    return f"Of the initial rotation error (median) is left: {shares}."


def unconfirmed_sentence(evaluation: Evaluation) -> str:
    """In how many runs the picture did not confirm the result."""
    with_audit = "".join(f", {count} with the audit's {name}" for name, count in evaluation.audit_unconfirmed.items())
    return (
        f"Picture and scan did not fit after the last stage, so the extrinsic was left as it was, in "
        f"{evaluation.unconfirmed} of {len(evaluation.runs)} runs{with_audit}."
    )


def error_table(title: str, rows: list[tuple[str, dict[str, float]]], decimals: int) -> Table:
    """One row for the initial error and one a stage; per axis the mean absolute error."""
    table = plain_table(title)
    largest = max(max(figures.values()) for _, figures in rows)
    decimals = min(decimals, max(0, 4 - len(f"{largest:.0f}")))  # numbers wider than that would not fit
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
