"""``calib-inspect evaluate``: errors and success rates of every stage, on any dataset."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from calibnet.datasets import PickedFrames, Sequence, dataset_names, select_frames
from calibnet.methods.registry import METHODS, accepts, open_method
from inspector.cli.options import FOLDER, FRAMES, RANGE, SEED, STAGES
from inspector.cli.output import (
    JSON_FILE,
    console_beside,
    make_console,
    overwrite_option,
    prepare_json,
    say,
    write_json,
)
from inspector.cli.sources import open_parts

if TYPE_CHECKING:
    from rich.progress import TaskID

    from calibnet.calibrator import Calibrator
    from calibnet.cascade import Cascade
    from calibnet.evaluation.battery import BatteryRun
    from calibnet.evaluation.measure import Step
    from calibnet.geometry import MiscalibrationRange


@click.command()
@click.option("--dataset", type=click.Choice(dataset_names()), required=True, help="What --root holds.")
@click.option("--root", type=click.Path(path_type=Path), required=True, help="The dataset's folder.")
@click.option(
    "--sequences",
    multiple=True,
    metavar="NAME,NAME",
    help="Numbers (kitti-odometry, kitti-tracking, kitti-360), DATE/DRIVE (kitti-raw), splits (kitti-object), SCENE or "
    "SCENE/CAMERA (nuscenes), folders below --root (folder and the datasets of other packages; without it --root).",
)
@click.option(
    "--camera",
    metavar="CAMERA",
    help="Camera, for instance 2 or CAM_BACK.  [default: that of the dataset's own command]",
)
@click.option("--frames", type=FRAMES, default=":", help="Positions in every sequence, for instance 0:100:5.")
@click.option(
    "--range", "range_", type=RANGE, default="20/1.5", show_default=True, help="Range of the miscalibrations."
)
@click.option("--repeats", type=click.IntRange(1), default=1, show_default=True, help="Miscalibrations per frame.")
@click.option("--seed", type=SEED, default=0, show_default=True, help="Seed of the miscalibrations.")
@click.option("--stages", type=STAGES, help="Stages to run, for instance 3-5.  [default: those within --range]")
@click.option("--preset", default="compact", show_default=True, help="Network to measure.")
@click.option("--weights", type=FOLDER, help="Folder with the network's weights.  [default: those of the package]")
@click.option(
    "--audit", is_flag=True, help="Repeat the measurement with another drive's image, a grey one, and fewer rings."
)
@click.option(
    "--battery",
    is_flag=True,
    help="Instead, apply some 70 faults to every frame and count the verdicts.",
)
@click.option(
    "--virtual",
    type=click.IntRange(1),
    metavar="N",
    help="Replace every sequence by N virtual rigs: narrower lenses, rotated cameras, half of them with half the "
    "rings.",
)
@click.option("--drives/--no-drives", default=True, help="Also solve every drive from all its frames.  [default: yes]")
@click.option(
    "--classical/--no-classical",
    default=True,
    help="Also measure edge alignment, which needs no training.  [default: yes]",
)
@click.option(
    "--method",
    "methods",
    multiple=True,
    type=click.Choice(METHODS.names()),
    help="Method to measure as well, on the same frames, or on drives if it only solves drives. Repeatable.",
)
@click.option("--method-weights", type=FOLDER, help="Folder of the weights of --method.  [default: that of --weights]")
@click.option("--json", "json_file", type=JSON_FILE, metavar="FILE|-", help="Also as JSON; - for stdout.")
@overwrite_option
def evaluate(
    dataset: str,
    root: Path,
    sequences: tuple[str, ...],
    camera: str | None,
    frames: str,
    range_: MiscalibrationRange,
    repeats: int,
    seed: int,
    stages: tuple[int, ...] | None,
    preset: str,
    weights: Path | None,
    audit: bool,
    battery: bool,
    virtual: int | None,
    drives: bool,
    classical: bool,
    methods: tuple[str, ...],
    method_weights: Path | None,
    json_file: str | None,
) -> None:
    """Measure the cascade's errors: every frame starts from random miscalibrations (seeded) of the dataset's extrinsic.

    Prints mean, median, standard deviation, 95th percentile, per-axis mean absolute errors and success rates: of the
    initial error, of a classical refinement (edges and reflectance of the scan aligned with the image's edges and
    brightness), of every stage on single frames, and of every drive solved from all its frames, by the networks alone
    and with its edges aligned after stage 5.
    """
    names = [part.strip() for text in sequences for part in text.split(",") if part.strip()]
    opened: list[Sequence] = [
        PickedFrames(sequence, select_frames(sequence, frames)) for sequence in open_parts(dataset, root, names, camera)
    ]
    prepare_json(json_file)
    if virtual is not None:
        from calibnet.evaluation.virtual import virtual_rigs

        opened = virtual_rigs(opened, virtual, seed)

    from calibnet.cascade.cascade import Cascade
    from calibnet.datasets.discovery import find_sequences
    from calibnet.evaluation import measure as measuring
    from calibnet.geometry import stages_within
    from inspector.cli.evaluation_tables import print_evaluation

    cascade = Cascade.load(preset, stages or stages_within(range_), weights, wider=stages is None)
    for skipped in cascade.skipped:
        say(skipped.reason, err=True)
    if cascade.unjudged:
        say(f"No result will be accepted: {cascade.unjudged}", err=True)
    if battery:
        run_battery(cascade, opened, range_, repeats, seed, lambda: find_sequences(dataset, root), json_file)
        return
    references = measuring.classical(range_) if classical else {}
    references |= {name: open_reference(name, range_, method_weights or weights) for name in methods}
    console = console_beside(json_file)
    with Bars() as bars:
        evaluation = measuring.measure(
            cascade,
            opened,
            range_,
            repeats,
            seed,
            references=references,
            drives=drives,
            audit=audit,
            beside=lambda: find_sequences(dataset, root),
            observer=bars.show,
        )
    print_evaluation(evaluation, console)
    write_json(json_file, evaluation.as_dict())


def open_reference(name: str, range_: MiscalibrationRange, weights: Path | None) -> Calibrator:
    """Open another method, with the weights in a folder if it uses weights."""
    told = {"weights": weights} if accepts(METHODS.load(name), "weights") else {}
    return open_method(name, range_, **told)


def run_battery(
    cascade: Cascade,
    sequences: list[Sequence],
    range_: MiscalibrationRange,
    repeats: int,
    seed: int,
    beside: Callable[[], Iterable[Sequence]],
    json_file: str | None,
) -> None:
    """Run the battery of faults; print its table and write its JSON."""
    from calibnet.evaluation.battery import measure_battery
    from calibnet.evaluation.measure import Step
    from inspector.cli.evaluation_tables import print_battery

    done = itertools.count(1)

    def show(run: BatteryRun) -> None:
        bars.show(Step("battery", next(done), None, f"{run.corruption.name} {run.corruption.strength}"))

    with Bars() as bars:
        measured = measure_battery(cascade, sequences, range_, repeats, seed, beside, show)
    print_battery(measured, console_beside(json_file))
    write_json(json_file, measured.as_dict())


class Bars:
    """Progress on stderr, a bar for each row of the measurement; gone at the end."""

    def __enter__(self) -> Bars:
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        columns = (
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
        )
        self.progress = Progress(*columns, console=make_console(), transient=True)
        self.tasks: dict[str, TaskID] = {}
        self.progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.progress.stop()

    def show(self, step: Step) -> None:
        """Move the bar of the step's row; a row's first step adds it."""
        if step.row not in self.tasks:
            self.tasks[step.row] = self.progress.add_task(step.row, total=step.total)
        title = f"{step.row}: {step.sequence}" if step.sequence else step.row
        self.progress.update(self.tasks[step.row], completed=step.done, description=title)
