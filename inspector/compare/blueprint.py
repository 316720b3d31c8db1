"""The layout of a comparison: overlays side by side, curves of all runs in one plot, the table."""

from __future__ import annotations

import rerun.blueprint as rrb

from inspector import entities
from inspector.compare.comparison import Comparison
from inspector.record.tabs.views import LEGEND_HEIGHT, SCREEN_HEIGHT, SCREEN_WIDTH, View, legend, overlay_view

COMPARISON_TABLE = "comparison/table"
LEGEND_RUNS = "legend/runs"
"""The names of the runs in the colours of their curves."""
LARGEST_OVERLAY = 390.0
"""Height in pixels beyond which curves and table would have too little room."""
TITLE_BAR = 64.0
MOST_COLUMNS = 3
HEADROOM = 1.1
"""Over the largest error: curves start at zero, so that twice as high is twice as bad."""


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
    """What each run arrived at: overlays, curves, table."""
    table = rrb.TextDocumentView(origin=f"/{COMPARISON_TABLE}", name="The runs in figures")
    below: View = table
    if any(run.run.has_reference for run in comparison.runs):
        curves = [_curves(comparison, kind, unit) for kind, unit in entities.ERROR_KINDS.items()]
        plots = rrb.Vertical(*curves, legend("Runs", LEGEND_RUNS), row_shares=[1.0, 1.0, 0.2])
        below = rrb.Horizontal(plots, table, column_shares=[1.0, 1.2])
    overlays = side_by_side(_corrected(comparison))
    height = _overlay_height(comparison)
    if not comparison.one_coloring:
        return rrb.Vertical(overlays, below, row_shares=[height, SCREEN_HEIGHT - height], name="Comparison")
    shares = [height, LEGEND_HEIGHT, SCREEN_HEIGHT - LEGEND_HEIGHT - height]
    colors = legend("Colours of the points", entities.LEGEND_POINTS)
    return rrb.Vertical(overlays, colors, below, row_shares=shares, name="Comparison")


def overlays_tab(comparison: Comparison) -> View:
    """Before and after, and the truth where it is known."""
    start = entities.OVERLAY_MISCALIBRATED
    truth = []
    if any(run.run.has_reference for run in comparison.runs):
        truth.append(_overlay(comparison, "Reference (truth)", entities.OVERLAY_REFERENCE))
    if comparison.one_start:
        before = [_overlay(comparison, "Start of all runs", comparison.first.path(start)), *truth]
        return rrb.Vertical(side_by_side(before), side_by_side(_corrected(comparison)), name="Before and after")
    before = [_overlay(comparison, f"{run.name}: start", run.path(start)) for run in comparison.runs]
    return rrb.Vertical(side_by_side(before), side_by_side(_corrected(comparison)), *truth, name="Before and after")


def side_by_side(views: list[rrb.Spatial2DView]) -> View:
    """Views in rows of at most `MOST_COLUMNS`."""
    return rrb.Grid(*views, grid_columns=min(len(views), MOST_COLUMNS))


def _corrected(comparison: Comparison) -> list[rrb.Spatial2DView]:
    return [
        _overlay(comparison, f"{run.name}: corrected", run.path(entities.OVERLAY_CORRECTED)) for run in comparison.runs
    ]


def _overlay(comparison: Comparison, name: str, points: str) -> rrb.Spatial2DView:
    """Points over the frame's image; all views show the same part, whatever lies beside the image."""
    cameras = [frame.camera for frame in comparison.first.frames]
    size = (max(camera.width for camera in cameras), max(camera.height for camera in cameras))
    return overlay_view(name, points, size)


def _curves(comparison: Comparison, kind: str, unit: str) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin="/",
        contents=[f"/{run.path(entities.error_corrected(kind))}" for run in comparison.runs],
        name=f"{kind.capitalize()} error of the corrected extrinsic [{unit}]",
        plot_legend=rrb.PlotLegend(visible=False),  # it would lie over the curves' ends
        axis_y=rrb.ScalarAxis(range=(0.0, HEADROOM * _largest(comparison, kind))),
    )


def _largest(comparison: Comparison, kind: str) -> float:
    errors = [frame.error(frame.corrected) for run in comparison.runs for frame in run.frames]
    return max(
        error.rotation_deg if kind == "rotation" else error.translation_cm for error in errors if error is not None
    )


def _overlay_height(comparison: Comparison) -> float:
    """Height of the overlays together, so that they fill the width of a screen of 1920 x 1080."""
    camera = comparison.first.frames[0].camera
    columns = min(len(comparison.runs), MOST_COLUMNS)
    rows = -(-len(comparison.runs) // columns)
    wanted = rows * (SCREEN_WIDTH / columns * camera.height / camera.width + TITLE_BAR)
    return min(wanted, LARGEST_OVERLAY)
