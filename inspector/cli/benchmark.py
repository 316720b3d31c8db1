"""``calib-inspect benchmark``: milliseconds of the cascade by part, stage and frame."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from inspector.cli.options import FOLDER, STAGES, THREADS, USUAL_THREADS
from inspector.cli.output import (
    JSON_FILE,
    console_beside,
    make_console,
    overwrite_option,
    prepare_json,
    say,
    write_json,
)

if TYPE_CHECKING:
    from rich.console import Console

    from calibnet.evaluation.benchmark import Benchmark

SCENES = 4
"""Frames of the synthetic world that are timed in turn, each with a scan of KITTI's size."""


@click.command()
@click.option(
    "--repeats", type=click.IntRange(1), default=8, show_default=True, help=f"Timed runs on each of {SCENES} frames."
)
@click.option("--threads", type=THREADS, default=USUAL_THREADS, show_default=True, help="Threads of the CPU.")
@click.option("--stages", type=STAGES, default="1-5", show_default=True, help="Stages to run.")
@click.option("--preset", default="compact", show_default=True, help="Network to time.")
@click.option("--weights", type=FOLDER, help="Folder with the network's weights.  [default: those of the package]")
@click.option("--json", "json_file", type=JSON_FILE, metavar="FILE|-", help="Also as JSON; - for stdout.")
@overwrite_option
def benchmark(
    repeats: int,
    threads: int,
    stages: tuple[int, ...],
    preset: str,
    weights: Path | None,
    json_file: str | None,
) -> None:
    """Time the cascade on frames of the synthetic world with a scanner like KITTI's.

    Reports the median time per frame, from a frame in memory to its extrinsic, including the projection, and the time
    of each stage's network on batches of frames. A network of another paper is timed in alternation, so that the ratio
    is meaningful on a busy machine too.
    """
    prepare_json(json_file)
    import torch
    from rich.progress import Progress

    from calibnet.cascade.cascade import Cascade
    from calibnet.datasets.synthetic import KITTI_LIKE, SyntheticSequence
    from calibnet.evaluation import benchmark as timing

    torch.set_num_threads(threads)
    cascade = Cascade.load(preset, stages, weights)
    for skipped in cascade.skipped:
        say(skipped.reason, err=True)
    frames = list(SyntheticSequence(seed=0, length=SCENES, rig=KITTI_LIKE))
    with Progress(console=make_console(), transient=True) as progress:
        task = progress.add_task("timing", total=timing.WARM_UP + repeats * SCENES)
        result = timing.benchmark(cascade, frames, repeats, lambda: progress.advance(task))
    report(result, console_beside(json_file))
    write_json(json_file, result.as_dict())


def report(result: Benchmark, console: Console) -> None:
    """Print the machine, a table with a row per part and a column per stage, and the total."""
    from rich import box
    from rich.table import Table

    machine = result.machine
    console.print(
        f"{machine['device']}, {machine['threads']} threads on {machine['cores']} cores, {machine['instructions']}, "
        f"{machine['precision']}, torch {machine['torch']}; median of {result.frames} frames",
        highlight=False,
    )
    table = Table(title="Milliseconds per frame", title_justify="left", box=box.SIMPLE_HEAD)
    table.add_column("")
    for stage in result.stages:
        table.add_column(f"stage {stage.number}\n{stage.range}", justify="right")
    rows = {part.replace("_", " "): [stage.parts[part] for stage in result.stages] for part in result.stages[0].parts}
    rows["the whole stage"] = [stage.milliseconds for stage in result.stages]
    for size in result.stages[0].batches:
        rows[f"network alone, batch of {size}"] = [stage.batches[size] for stage in result.stages]
    for name, numbers in rows.items():
        table.add_row(name, *(f"{number:.1f}" for number in numbers))
    console.print(table)
    shared = ", ".join(f"{part.replace('_', ' ')} {value:.1f}" for part, value in result.shared.items())
    console.print(f"Once per frame: {shared}. The whole cascade: {result.cascade:.1f} ms per frame.", highlight=False)
    console.print(
        f"A network of LCCNet's shape, timed in turn: {result.reference:.1f} ms. The whole cascade takes "
        f"{result.ratio:.2f} times as long as five of them.",
        highlight=False,
    )
