"""``calib-inspect bench``: the paper's comparison of systems: all methods on the same frames."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from inspector.cli.options import FOLDER, FRAMES, RANGE, SEED, THREADS, USUAL_THREADS, NumberRange
from inspector.cli.output import (
    JSON_FILE,
    OUTPUT_FILE,
    console_beside,
    keep_json,
    overwrite_option,
    prepare,
    prepare_json,
    say,
    write,
    write_json,
)

if TYPE_CHECKING:
    from calibnet.evaluation.bench import Bench, BenchMethod
    from calibnet.evaluation.bench import Step as BenchStep
    from calibnet.geometry import MiscalibrationRange

FILE = click.Path(dir_okay=False, path_type=Path)


class NamedFolder(click.ParamType[tuple[str, Path]]):
    """``NAME=DIR``, parsed to the name and the folder."""

    name = "NAME=DIR"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, Path]:
        """Split the text; a pair is returned as it is."""
        if isinstance(value, tuple):
            return value
        name, equals, folder = str(value).partition("=")
        if not (name and equals and folder):
            self.fail(f"{value!r} is not of the form NAME=DIR; write for instance cascade-10k=weights/10k.", param, ctx)
        return name, Path(folder)


@click.command()
@click.option(
    "--method", "methods", multiple=True, metavar="NAME", help="Method to measure. Repeatable.  [default: all]"
)
@click.option("--data", multiple=True, metavar="DATASET:DIR[:SEQ]", help="Frames, as in train. Repeatable.")
@click.option(
    "--range",
    "ranges",
    multiple=True,
    type=RANGE,
    help="Range of the miscalibrations. Repeatable.  [default: 20/1.5 and 5/0.5]",
)
@click.option("--frames", type=FRAMES, default=":", help="Positions in every sequence, for instance 0:100:5.")
@click.option(
    "--most",
    type=click.IntRange(2),
    default=12,
    show_default=True,
    help="Largest number of frames measured per sequence or drive.",
)
@click.option(
    "--repeats", type=click.IntRange(1), default=1, show_default=True, help="Miscalibrations per frame or drive."
)
@click.option("--seed", type=SEED, default=0, show_default=True, help="Seed of the miscalibrations.")
@click.option("--limit", type=NumberRange(1), default=300.0, show_default=True, help="Time limit per row, in seconds.")
@click.option(
    "--audit/--no-audit",
    default=True,
    help="Also measure with a grey image and with an image of another drive.  [default: yes]",
)
@click.option("--preset", default="compact", show_default=True, help="Network of the cascade.")
@click.option("--method-weights", type=FOLDER, help="Folder of the weights of other methods.")
@click.option(
    "--ours", multiple=True, type=NamedFolder(), help="Add a row of the cascade with the weights in DIR. Repeatable."
)
@click.option("--masks", type=FOLDER, metavar="DIR", help="Masks for calib-anything, as in seq.")
@click.option("--threads", type=THREADS, default=USUAL_THREADS, show_default=True, help="Threads of the CPU.")
@click.option(
    "--from", "source", type=FILE, metavar="FILE", help="Measure nothing; print the tables of this earlier JSON file."
)
@click.option("--json", "json_file", type=JSON_FILE, metavar="FILE|-", help="Also as JSON; - for stdout.")
@click.option("--csv", "csv_file", type=OUTPUT_FILE, metavar="FILE", help="Also as CSV, one line per row.")
@click.option("--html", "html_file", type=OUTPUT_FILE, metavar="FILE", help="Also as an HTML page.")
@click.option("--markdown", "markdown_file", type=OUTPUT_FILE, metavar="FILE", help="Also as Markdown.")
@overwrite_option
def bench(
    methods: tuple[str, ...],
    data: tuple[str, ...],
    ranges: tuple[MiscalibrationRange, ...],
    frames: str,
    most: int,
    repeats: int,
    seed: int,
    limit: float,
    audit: bool,
    preset: str,
    method_weights: Path | None,
    ours: tuple[tuple[str, Path], ...],
    masks: Path | None,
    threads: int,
    source: Path | None,
    json_file: str | None,
    csv_file: Path | None,
    html_file: Path | None,
    markdown_file: Path | None,
) -> None:
    """Measure all methods on the same frames from the same miscalibrations, on rigs they were trained on and on others.

    One row per method, range and rig: errors, refused runs, success rates, cost, training data, results with a grey
    image and with an image of another drive, and the figures of its paper. A method that cannot run, because it lacks
    weights or because the car stands still, gets a row that says so.
    """
    from calibnet.runtime.writing import Kind
    from inspector.report import bench_page
    from inspector.report.bench_rows import as_csv
    from inspector.report.bench_tables import as_markdown

    outputs = (
        (csv_file, as_csv, Kind.TABLE),
        (html_file, bench_page.page, Kind.PAGE),
        (markdown_file, as_markdown, Kind.EXPORT),
    )
    for file, _, kind in outputs:
        prepare(file, kind)
    prepare_json(json_file)
    if source is not None:
        from inspector.report.table_files import read_table

        content = read_table(source, "bench")
    else:
        if not data:
            raise click.UsageError("--data is needed, for instance --data kitti-raw:DIR:2011_09_26/0048.")
        measured, bench_methods = set_up(data, ranges, frames, methods, dict(ours), preset, method_weights, masks)
        measured = replace(measured, repeats=repeats, seed=seed, most=most, limit_s=limit, audit=audit)
        content = run(measured, bench_methods, threads, json_file)
    from inspector.cli.bench_tables import print_bench

    print_bench(content, console_beside(json_file))
    if source is not None or json_file == "-":  # otherwise the file has been written after every method
        write_json(json_file, content)
    for file, made, kind in outputs:
        if file is not None:
            write(file, made(content).encode(), kind)


def set_up(
    data: tuple[str, ...],
    ranges: tuple[MiscalibrationRange, ...],
    frames: str,
    methods: tuple[str, ...],
    ours: dict[str, Path],
    preset: str,
    method_weights: Path | None,
    masks: Path | None,
) -> tuple[Bench, list[BenchMethod]]:
    """The measurement, and the methods that take part."""
    from calibnet.datasets import PickedFrames, select_frames
    from calibnet.datasets.discovery import find_sequences
    from calibnet.evaluation.bench import Bench
    from calibnet.evaluation.bench_methods import bench_methods
    from calibnet.geometry import RANGES
    from calibnet.methods.registry import CASCADE, METHODS
    from calibnet.training.data import open_data

    for name in methods:
        if name != CASCADE and name not in METHODS:
            raise click.UsageError(f"{name!r} is not a method; choose from {CASCADE}, {', '.join(METHODS.names())}.")
    opened = [sequence for spec in data for sequence in open_data(spec)]
    sequences = [PickedFrames(sequence, select_frames(sequence, frames)) for sequence in opened]
    dataset, _, rest = data[0].partition(":")
    root = Path(rest.partition(":")[0])
    measured = Bench(list(sequences), ranges or (RANGES[0], RANGES[2]), beside=lambda: find_sequences(dataset, root))
    return measured, bench_methods(methods or ("all",), ours, {"weights": method_weights, "masks": masks}, preset)


def run(measured: Bench, bench_methods: list[BenchMethod], threads: int, json_file: str | None) -> dict[str, Any]:
    """Measure all methods; the JSON file is written after each, so that an interruption loses little."""
    import cv2
    import torch

    from calibnet.evaluation.bench import initial_rows, measure_bench
    from inspector.cli.evaluate import Bars

    torch.set_num_threads(threads)
    cv2.setNumThreads(threads)
    content = measurement_settings(measured, threads) | {"initial": list(initial_rows(measured)), "methods": {}}
    bars = Bars()

    def show(step: BenchStep) -> None:
        from calibnet.evaluation.measure import Step

        bars.show(Step(step.row, step.done, step.total, ""))

    with bars:
        for name, entry in measure_bench(measured, bench_methods, show):
            content["methods"][name] = entry
            for row in entry["rows"]:
                if "why" in row:
                    say(f"{name}, {row['range']}: {row['why']}", err=True)
            keep_json(json_file, content, first=len(content["methods"]) == 1)
    return content


def measurement_settings(measured: Bench, threads: int) -> dict[str, Any]:
    """Settings and machine of the measurement."""
    import platform

    from calibnet import __version__

    return {
        "table": "bench",
        "version": __version__,
        "sequences": [{"name": one.name, "rig": one.rig, "frames": len(one)} for one in measured.sequences],
        "ranges": [str(range_) for range_ in measured.ranges],
        "repeats": measured.repeats,
        "seed": measured.seed,
        "most": measured.most,
        "limit_s": measured.limit_s,
        "threads": threads,
        "processor": platform.processor() or platform.machine(),
    }
