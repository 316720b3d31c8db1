"""The layout of a comparison: overlays side by side, curves of all runs in one plot, the table.

The overlays show the drive's result of runs that solved one; those of single frames are on the second tab.
"""

from __future__ import annotations

import rerun.blueprint as rrb

from inspector import entities
from inspector.compare.comparison import ComparedRun, Comparison, of_kind
from inspector.record.pictures.captions import caption_strip
from inspector.record.tabs.views import (
    LEGEND_HEIGHT,
    SCREEN_HEIGHT,
    SCREEN_WIDTH,
    View,
    curve_view,
    in_rows,
    legend,
    overlay_view,
)

COMPARISON_TABLE = "comparison/table"
LEGEND_RUNS = "legend/runs"
"""Legend with the names of the runs in the colours of their curves."""
LARGEST_OVERLAY = 390.0
"""Largest height of overlays in pixels, which leaves room for curves and table."""
TITLE_BAR = 64.0
MOST_COLUMNS = 3
HEADROOM = 1.1
"""Upper limit of an error axis relative to the largest error; the axis starts at zero."""


def make_comparison_blueprint(comparison: Comparison) -> rrb.Blueprint:
    """Both tabs."""
    return rrb.Blueprint(
        rrb.Tabs(results_tab(comparison), overlays_tab(comparison), active_tab=0),
        rrb.TimePanel(state="collapsed", timeline=entities.FRAME),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
        auto_layout=False,
    )


def results_tab(comparison: Comparison) -> View:
    """The tab of results: overlays, curves and table."""
    table = rrb.TextDocumentView(origin=f"/{COMPARISON_TABLE}", name="The runs in figures")
    below: View = table
    if any(run.run.has_reference for run in comparison.runs):
        curves = rrb.Horizontal(*(_curves(comparison, kind, unit) for kind, unit in entities.ERROR_KINDS.items()))
        plots = rrb.Vertical(curves, legend("Runs", LEGEND_RUNS), row_shares=[1.0, 0.15])
        below = rrb.Horizontal(plots, table, column_shares=[0.8, 1.0])
    height = _overlay_height(comparison)
    shares = [height, LEGEND_HEIGHT, SCREEN_HEIGHT - LEGEND_HEIGHT - height]
    small = len(comparison.runs) >= MOST_COLUMNS
    answers = in_rows([_answer(comparison, run, small) for run in comparison.runs], MOST_COLUMNS)
    return rrb.Vertical(answers, _point_legends(comparison), below, row_shares=shares, name="Comparison")


def overlays_tab(comparison: Comparison) -> View:
    """The tab with start and reference above each run's results, which include single frames if drives were solved."""
    start = entities.OVERLAY_MISCALIBRATED
    if comparison.one_start:
        before = [_overlay(comparison, "Start of all runs", comparison.first.path(start), small=True)]
    else:
        before = [_overlay(comparison, f"{run.name}: start", run.path(start), small=True) for run in comparison.runs]
    if any(run.run.has_reference for run in comparison.runs):
        before.append(_overlay(comparison, "Reference (truth)", entities.OVERLAY_REFERENCE, small=True))
    rows = [before, [_answer(comparison, run, small=True) for run in comparison.runs]]
    rows.append([_alone(comparison, run, small=True) for run in comparison.runs if run.shows_drive])
    pictures = [in_rows(row, MOST_COLUMNS) for row in rows if row]
    shares = [SCREEN_HEIGHT - LEGEND_HEIGHT, LEGEND_HEIGHT]
    return rrb.Vertical(rrb.Vertical(*pictures), _point_legends(comparison), row_shares=shares, name="Before and after")


def _answer(comparison: Comparison, run: ComparedRun, small: bool) -> rrb.Spatial2DView:
    if not run.shows_drive:
        return _alone(comparison, run, small)
    return _overlay(comparison, f"{run.name}: whole drive as one", run.path(entities.OVERLAY_DRIVE), small)


def _alone(comparison: Comparison, run: ComparedRun, small: bool) -> rrb.Spatial2DView:
    return _overlay(comparison, f"{run.name}: each frame alone", run.path(entities.OVERLAY_CORRECTED), small)


def _overlay(comparison: Comparison, name: str, points: str, small: bool = False) -> rrb.Spatial2DView:
    """Points over the frame's image; all views show the same part, whatever lies outside the image."""
    cameras = [frame.camera for frame in comparison.first.frames]
    size = (max(camera.width for camera in cameras), max(camera.height for camera in cameras))
    return overlay_view(name, points, size, small=small)


def _point_legends(comparison: Comparison) -> View:
    """Legends of the points' colours: one, or one per run if the runs were recorded with different colours."""
    runs = comparison.runs[:1] if comparison.one_coloring else comparison.runs
    return rrb.Horizontal(*(legend("Colours of the points", run.path(entities.LEGEND_POINTS)) for run in runs))


def _curves(comparison: Comparison, kind: str, unit: str) -> rrb.TimeSeriesView:
    errors = [frame.error(frame.corrected) for run in comparison.runs for frame in run.frames]
    largest = max(of_kind(error, kind) for error in errors if error is not None)
    paths = [f"/{run.path(entities.error_corrected(kind))}" for run in comparison.runs]
    paths += [f"/{run.path(entities.error_drive(kind))}" for run in comparison.runs if run.run.drive_error is not None]
    return curve_view(f"{kind.capitalize()} error [{unit}]", "/", *paths, highest=HEADROOM * largest)


def _overlay_height(comparison: Comparison) -> float:
    """Height of all overlays together in pixels, so that they fill the width of a 1920 x 1080 screen."""
    camera = comparison.first.frames[0].camera
    columns = min(len(comparison.runs), MOST_COLUMNS)
    rows = -(-len(comparison.runs) // columns)
    high = camera.height + caption_strip((camera.width, camera.height)).height
    wanted = rows * (SCREEN_WIDTH / columns * high / camera.width + TITLE_BAR)
    return min(wanted, LARGEST_OVERLAY)
