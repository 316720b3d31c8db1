"""``calib-inspect fleet-report``, ``fleet-view`` and ``fleet-simulate``: views of a fleet, and one to try."""

from __future__ import annotations

import shlex
from pathlib import Path

import click

from inspector.cli.options import FOLDER, SEED
from inspector.cli.output import make_console, overwrite_option, say


@click.command("fleet-simulate")
@click.argument("count", type=click.IntRange(1, 100_000), metavar="N")
@click.option("--output", "out", type=FOLDER, required=True, metavar="DIR", help="New folder of the drives.")
@click.option("--frames", type=click.IntRange(1, 1000), default=4, show_default=True, help="Frames of each drive.")
@click.option("--seed", type=SEED, default=0, show_default=True, help="Seed of all random numbers.")
def simulate(count: int, out: Path, frames: int, seed: int) -> None:
    """Write a fleet of N synthetic drives, to try `fleet` or to measure it.

    A few streets are rendered once and reused. Most calibrations are good; the mount of some cars moves, some have a
    wrong camera matrix, and some scans are cut off. truth.csv says what is wrong with each.
    """
    from rich.progress import Progress

    from inspector.fleet.simulation import simulate as write_fleet

    with Progress(console=make_console()) as progress:
        task = progress.add_task("rendering", total=None)
        drives = write_fleet(
            out, count, seed, frames, lambda done, total: progress.update(task, completed=done, total=total)
        )
    say(f"{count} drives: {drives}")
    say(f"Calibrate them: {shlex.join(['calib-inspect', 'fleet', str(drives), '--output', str(out / 'results')])}")


@click.command("fleet-report")
@click.argument("folder", type=FOLDER, metavar="DIR")
@overwrite_option
def report(folder: Path) -> None:
    """Write a page about a fleet: its cars, their moved mounts, and every drive, worst first.

    DIR is the folder given to `fleet --output`. Each drive links to its report and recording.
    """
    from inspector.fleet.page import write_page
    from inspector.fleet.table import TABLE, read_table

    say(f"Page: {write_page(read_table(folder / TABLE), folder)}")


@click.command("fleet-view")
@click.argument("folder", type=FOLDER, metavar="DIR")
@click.option("--serve", "in_browser", is_flag=True, help="Show the viewer as a web page, on this machine only.")
@click.option("--headless", is_flag=True, help="Open no window.")
def view(folder: Path, in_browser: bool, headless: bool) -> None:
    """Serve all recordings of a fleet on this machine as one table in the Rerun viewer, until Ctrl-C.

    The table sorts and filters by verdict, cause and how far the calibration was off; a row opens its drive.
    """
    from calibnet.runtime.interruption import StopRequest
    from inspector.fleet.catalogue import serve
    from inspector.fleet.table import TABLE, read_table
    from inspector.fleet.viewing import open_viewer

    rows = read_table(folder / TABLE)
    with StopRequest() as stop, serve(rows, folder.absolute()) as catalogue:
        say(f"{catalogue.count} drives at {catalogue.address} until Ctrl-C.")
        with open_viewer(catalogue.address, in_browser, headless) as where:
            say(where)
            stop.wait()
