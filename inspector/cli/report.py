"""``calib-inspect report``: a report of a recording, as a folder that a browser shows."""

from __future__ import annotations

import tempfile
from contextlib import nullcontext
from pathlib import Path

import click

from inspector.cli.options import FOLDER
from inspector.cli.output import overwrite_option, say


@click.command()
@click.argument("recording", type=click.Path(path_type=Path), metavar="RUN.rrd")
@click.option("--output", "out", type=FOLDER, required=True, metavar="DIR", help="Folder of the report.")
@click.option(
    "--open",
    "serve",
    is_flag=True,
    help="Serve the report with the embedded viewer on this machine until Ctrl-C, and open it.",
)
@click.option(
    "--with-viewer", is_flag=True, help="Put the embedded viewer (43 MB) into the folder, for any web server to serve."
)
@overwrite_option
def report(recording: Path, out: Path, serve: bool, with_viewer: bool) -> None:
    """Write a report of a run from its recording: index.html, pictures, metrics.json and the recording.

    The page works from disk and without a network; only its embedded viewer needs a web server, which is what --open
    starts. Other files in the folder are left alone.
    """
    write_report_of(recording, out)
    if with_viewer:
        from inspector.report.files import VIEWER
        from inspector.serving.viewer_files import fetch_viewer

        fetch_viewer(out / VIEWER)
    if serve:
        serve_report(out)


def write_report_of(recording: Path, out: Path, on_stderr: bool = False) -> None:
    """Make the report and print where it is."""
    from inspector.read.rig import is_rig, read_rig
    from inspector.read.run import read_run
    from inspector.report.rig import write_rig_report
    from inspector.report.write import write_report

    if is_rig(recording):
        say(f"Report: {write_rig_report(read_rig(recording), out)}", err=on_stderr)
        return
    run = read_run(recording)
    if run.warning:
        say(run.warning, err=True)
    say(f"Report: {write_report(run, out)}", err=on_stderr)


def serve_report(folder: Path) -> None:
    """Serve a report and the viewer until Ctrl-C or SIGTERM; opens a browser if there is a display."""
    from calibnet.runtime.interruption import StopRequest
    from inspector.record.outputs import has_display
    from inspector.report.files import PAGE
    from inspector.report.serve import report_app
    from inspector.serving.browser import opened_page
    from inspector.serving.server import PageServer
    from inspector.serving.viewer_files import INDEX, fetch_viewer

    with tempfile.TemporaryDirectory(prefix="calib-inspect-") as viewer:
        fetch_viewer(Path(viewer))
        app, pages = report_app(folder, Path(viewer)), [folder / PAGE, Path(viewer) / INDEX]
        with StopRequest() as stop, PageServer(app, pages=pages) as server:
            say(f"Serving at {server.address} until Ctrl-C.")
            with opened_page(server.address) if has_display() else nullcontext():
                stop.wait()
