"""``calib-inspect ablate``: the paper's ablation, measured: what each module costs and what it is worth."""

from __future__ import annotations

import platform
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from inspector.cli.options import FOLDER, FRAMES, RANGE, SEED
from inspector.cli.output import JSON_FILE, console_beside, make_console, overwrite_option, prepare_json, write_json

if TYPE_CHECKING:
    from rich.table import Table

    from calibnet.geometry import MiscalibrationRange


@click.command()
@click.option("--preset", "presets", multiple=True, help="Network. Repeatable.  [default: compact and paper]")
@click.option("--range", "range_", type=RANGE, default="5/0.5", show_default=True, help="Of weights and errors.")
@click.option(
    "--weights", type=FOLDER, help="Folder that `train --ablation NAME --output DIR` filled, a folder a row within it."
)
@click.option("--data", multiple=True, metavar="DATASET:DIR[:SEQ]", help="Frames, as in train. Repeatable.")
@click.option("--frames", type=FRAMES, default=":", help="Positions in every sequence, for instance 0:100:5.")
@click.option("--repeats", type=click.IntRange(1), default=1, show_default=True, help="Miscalibrations a frame.")
@click.option("--seed", type=SEED, default=0, show_default=True, help="Of the miscalibrations.")
@click.option(
    "--timed", type=click.IntRange(0), default=3, show_default=True, help="Looks whose median is the latency; 0: none."
)
@click.option("--threads", type=click.IntRange(1), default=2, show_default=True, help="Of the CPU.")
@click.option("--json", "json_file", type=JSON_FILE, metavar="FILE|-", help="Also as JSON; - for stdout, no table.")
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
    json_file: str | None,
) -> None:
    """Take the network apart: what each of the paper's five ablations and the whole network costs and is worth.

    Parameters, multiply-adds, latency and errors stand beside the paper's. Errors are those after one look of the
    network of --range, by rig, for the rows that --weights has; latency is of one look. The preset paper has no
    weights, and takes a minute or two of CPU for its latencies.

    \b
    calib-inspect train --ablation aggregation --range 5/0.5 --samples 10000 --uniform --packed PARTS --output ROWS
    calib-inspect ablate --weights ROWS \\
      --data kitti-raw:KITTI/raw:2011_09_26/0048 --data kitti-odometry:KITTI/odometry:04
    """  # noqa: D301 - click knows a paragraph that must not be wrapped by this character
    import torch

    from calibnet.datasets import PickedFrames, select_frames
    from calibnet.evaluation.ablation import HEIGHT, WIDTH, measure_ablation
    from calibnet.geometry import RANGES
    from calibnet.training.data import open_data

    if range_ not in RANGES:
        ranges = ", ".join(str(one) for one in RANGES)
        raise click.UsageError(f"--range {range_} is none of those that networks are trained for: {ranges}.")
    prepare_json(json_file)
    torch.set_num_threads(threads)
    opened = [sequence for spec in data for sequence in open_data(spec)]
    sequences = [PickedFrames(sequence, select_frames(sequence, frames)) for sequence in opened]
    console = console_beside(json_file)
    rows: list[dict[str, Any]] = []
    with make_console().status("") as status:

        def show(row: str, done: int, total: int) -> None:
            status.update(f"{row}: {done} of {total}")

        chosen = presets or ("compact", "paper")
        for row in measure_ablation(chosen, range_, weights, sequences, repeats, seed, timed, show):
            rows.append(row)
            status.update(f"{row['preset']}, {row['name']}: done")
    content = {
        "range": str(range_),
        "input": [HEIGHT, WIDTH],
        "sequences": [sequence.name for sequence in sequences],
        "repeats": repeats,
        "seed": seed,
        "machine": {"processor": platform.machine(), "threads": threads, "torch": torch.__version__},
        "rows": rows,
    }
    if json_file != "-":
        console.print(ablation_table(content))
        for why in dict.fromkeys(row["why"] for row in rows if "why" in row):
            console.print(why, markup=False, soft_wrap=True)
    write_json(json_file, content)


def ablation_table(content: dict[str, Any]) -> Table:
    """A line a row; in brackets what the paper says of its own."""
    from rich.table import Table

    from calibnet.evaluation.ablation import CLAIMS

    table = Table(title=f"Ablation, ±{content['range']}, one look; in brackets the paper's figures")
    for name in ("preset", "without", "rig"):
        table.add_column(name)
    for name in ("parameters", "multiply-adds", "latency", "rotation", "translation"):
        table.add_column(name, justify="right")
    before = ""
    for row in content["rows"]:
        if before and row["preset"] != before:
            table.add_section()
        before, claim = row["preset"], CLAIMS[row["name"]]
        took = "" if row["latency_ms"] is None else f"{row['latency_ms']:.0f} ms ({claim.latency_ms:g})"
        rotation, translation = row.get("rotation_deg"), row.get("translation_cm")
        table.add_row(
            row["preset"],
            "(nothing: full)" if row["name"] == "full" else row["name"],
            row.get("rig", ""),
            f"{row['parameters'] / 1e6:.2f} M ({claim.parameters_m:g})",
            f"{row['multiply_adds'] / 1e9:.1f} G ({claim.flops_g:g})",
            took,
            "" if rotation is None else f"{rotation['mean']:.2f}° ({claim.rotation_deg:g})",
            "" if translation is None else f"{translation['mean']:.1f} cm ({claim.translation_cm:g})",
        )
    return table
