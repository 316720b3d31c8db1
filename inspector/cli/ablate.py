"""``calib-inspect ablate``: the paper's ablation study: cost and benefit of each module of the network."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from inspector.cli.options import FRAMES, RANGE, SEED, THREADS, USUAL_THREADS
from inspector.cli.output import (
    JSON_FILE,
    OUTPUT_FILE,
    console_beside,
    make_console,
    overwrite_option,
    prepare,
    prepare_json,
    say,
    write,
    write_json,
)

if TYPE_CHECKING:
    from rich.console import Console

    from calibnet.geometry import MiscalibrationRange

FILE = click.Path(dir_okay=False, path_type=Path)


@click.command()
@click.option(
    "--preset", "presets", multiple=True, help="Network to measure. Repeatable.  [default: compact and paper]"
)
@click.option(
    "--range",
    "range_",
    type=RANGE,
    default="5/0.5",
    show_default=True,
    help="Range of the miscalibrations, and of the weights measured.",
)
@click.option(
    "--weights",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="Folder written by `train --ablation NAME --output DIR`, with one subfolder per row.",
)
@click.option("--data", multiple=True, metavar="DATASET:DIR[:SEQ]", help="Frames, as in train. Repeatable.")
@click.option("--frames", type=FRAMES, default=":", help="Positions in every sequence, for instance 0:100:5.")
@click.option("--repeats", type=click.IntRange(1), default=1, show_default=True, help="Miscalibrations per frame.")
@click.option("--seed", type=SEED, default=0, show_default=True, help="Seed of the miscalibrations.")
@click.option(
    "--timed",
    type=click.IntRange(0),
    default=3,
    show_default=True,
    help="Number of timed passes, of which the median is reported; 0 to measure no latency.",
)
@click.option("--threads", type=THREADS, default=USUAL_THREADS, show_default=True, help="Threads of the CPU.")
@click.option(
    "--from", "source", type=FILE, metavar="FILE", help="Measure nothing; print the tables of this earlier JSON file."
)
@click.option("--json", "json_file", type=JSON_FILE, metavar="FILE|-", help="Also as JSON; - for stdout.")
@click.option("--markdown", "markdown_file", type=OUTPUT_FILE, metavar="FILE", help="Also as Markdown.")
@overwrite_option
def ablate(
    presets: tuple[str, ...],
    range_: MiscalibrationRange,
    weights: Path | None,
    data: tuple[str, ...],
    frames: str,
    repeats: int,
    seed: int,
    timed: int,
    threads: int,
    source: Path | None,
    json_file: str | None,
    markdown_file: Path | None,
) -> None:
    """Measure the paper's five ablations and the whole network: cost and errors of each.

    Lists parameters, multiply-adds, latency and errors beside the paper's. Errors are measured after one pass of the
    network for --range, for the rows whose weights are in --weights. Latency is that of one pass over the first frame
    of --data. The preset paper has no weights; its latencies take a minute or two of CPU time.

    \b
    calib-inspect train --ablation aggregation --range 5/0.5 --samples 10000 --uniform --packed PARTS --output ROWS
    calib-inspect ablate --weights ROWS \\
      --data kitti-raw:KITTI/raw:2011_09_26/0048 --data kitti-odometry:KITTI/odometry:04
    """  # noqa: D301 - click knows a paragraph that must not be wrapped by this character
    from calibnet.runtime.writing import Kind
    from inspector.report.ablation_tables import as_markdown

    prepare_json(json_file)
    prepare(markdown_file, Kind.EXPORT)
    if source is not None:
        from inspector.report.table_files import read_table

        content = read_table(source, "ablate")
    else:
        content = measure_rows(
            presets or ("compact", "paper"), range_, weights, data, frames, repeats, seed, timed, threads
        )
    print_ablation(content, console_beside(json_file))
    write_json(json_file, content)
    if markdown_file is not None:
        write(markdown_file, as_markdown(content).encode(), Kind.EXPORT)


def measure_rows(
    presets: Sequence[str],
    range_: MiscalibrationRange,
    weights: Path | None,
    data: tuple[str, ...],
    frames: str,
    repeats: int,
    seed: int,
    timed: int,
    threads: int,
) -> dict[str, Any]:
    """Measure what the options ask for, showing progress; returns the content of the JSON file."""
    import torch

    from calibnet.datasets import PickedFrames, select_frames
    from calibnet.evaluation.ablation import measure_ablation
    from calibnet.evaluation.bench import Bench, initial_rows
    from calibnet.evaluation.counting import HEIGHT, WIDTH
    from calibnet.geometry import RANGES
    from calibnet.training.data import open_data

    if range_ not in RANGES:
        ranges = ", ".join(str(one) for one in RANGES)
        raise click.UsageError(f"--range {range_} has no network; choose from {ranges}.")
    torch.set_num_threads(threads)
    opened = [sequence for spec in data for sequence in open_data(spec)]
    sequences = [PickedFrames(sequence, select_frames(sequence, frames)) for sequence in opened]
    every = Bench(list(sequences), (range_,), repeats, seed, most=max(map(len, sequences), default=0))
    rows: list[dict[str, Any]] = []
    with make_console().status("") as status:

        def show(row: str, done: int, total: int) -> None:
            status.update(f"{row}: {done} of {total}")

        for row in measure_ablation(presets, range_, weights, sequences, repeats, seed, timed, show):
            rows.append(row)
            status.update(f"{row['preset']}, {row['name']}: done")
    return {
        "table": "ablate",
        "range": str(range_),
        "input": [HEIGHT, WIDTH],
        "sequences": [{"name": one.name, "rig": one.rig, "frames": len(one)} for one in sequences],
        "repeats": repeats,
        "seed": seed,
        "threads": threads,
        "processor": platform.processor() or platform.machine(),
        "initial": list(initial_rows(every)),
        "rows": rows,
    }


def print_ablation(content: dict[str, Any], console: Console) -> None:
    """Print costs and errors as two tables, narrow enough for a terminal, and name the rows without errors."""
    from rich import box
    from rich.table import Table

    from inspector.report.ablation_tables import COSTS, ERRORS, tables, title, untrained

    console.print(title(content))
    for preset, heads, lines in tables(content):
        for chosen in (COSTS, ERRORS):
            kept = [k for k in range(1, len(heads)) if heads[k] in chosen]
            if len(kept) < 2:
                continue  # only the paper's figures
            table = Table(title=preset, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
            table.add_column(heads[0], no_wrap=True)
            for k in kept:
                table.add_column(heads[k], justify="right")
            for line in lines:
                if any(line[k] for k in kept):
                    table.add_row(line[0], *(line[k] for k in kept))
            console.print(table)
    if missing := untrained(content):
        train = f"`calib-inspect train --preset PRESET --ablation ROW --range {content['range']} --output DIR`"
        say(
            f"{missing} {train} trains a row, and `ablate --weights DIR --data FRAMES` measures it.", err=console.stderr
        )
