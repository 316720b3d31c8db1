"""Tab *Overview*: the result first, as one large picture and in words.

The large picture shows the result, which is the whole drive's if that is solved. On the timeline `entities.STEP` it
steps from the start through every stage and the reference to the result; the tabs above it switch between these. Below
it are curves over the frames, beside it is text, and below the text are start and reference. Its overlays are in every
recording, since reports and comparisons show them too; its curves belong to `Part.CURVES`.
"""

from __future__ import annotations

import math

import rerun as rr
import rerun.blueprint as rrb

from calibnet.verdict import FRAME_LIMITS
from inspector import colors, entities
from inspector.record.contents import Contents, Part
from inspector.record.frame import image_of
from inspector.record.observation import Layout, Observation
from inspector.record.pictures.captions import caption_strip
from inspector.record.pictures.frame_overlays import frame_overlays
from inspector.record.pictures.legends import log_names, log_point_legend
from inspector.record.subtree import Subtree
from inspector.record.tabs.views import (
    LEGEND_HEIGHT,
    SCREEN_HEIGHT,
    SCREEN_WIDTH,
    TITLE_HEIGHT,
    View,
    curve_view,
    frame_view,
    frames_named,
    legend,
    point_legend,
)

NAME = "Overview"

WORST = "Worst frame"
LARGE_SHARE = 0.62
"""Share of the tab's width that the large picture takes."""
LARGEST_OVERLAY, LARGEST_SMALL, LARGEST_ONLY = 600.0, 250.0, 420.0
"""Largest heights in pixels of the large picture, of one of two small ones and of a single one, which leave room for
the rest of their columns."""
_SMALL = (entities.OVERLAY_MISCALIBRATED, entities.OVERLAY_REFERENCE)

FIT = "fit"
"""Curves of the match error that the stages expect, in pixels of the frame's image."""
FIT_LIMIT = f"{FIT}/limit"
"""Largest match error at which the last stage's result is believed."""
LEGEND_CURVES = "legend/curves"
"""Legend of the curves."""
LIMITS = dict(zip(entities.ERROR_KINDS, FRAME_LIMITS, strict=True))
"""What the result of a frame must be within to be accepted, in the units of `entities.ERROR_KINDS`."""


def fit_stage(number: int) -> str:
    """Entity of the curve of one stage's match error."""
    return f"{FIT}/stage_{number}"


def wanted(layout: Layout) -> bool:
    """Always true, since every recording has data for it."""
    return True


def log_once(rec: Subtree, layout: Layout) -> None:
    """Log the legends of points and curves."""
    log_point_legend(rec, layout.contents.color)
    if Part.CURVES in layout.contents.parts:
        _log_curve_styles(rec, layout)


def log(rec: Subtree, observation: Observation, contents: Contents) -> None:
    """Log the overlays of a frame and its point of every curve."""
    trace, reference = observation.trace, observation.reference
    overlays = frame_overlays(observation, contents)
    overlays.log(rec, entities.OVERLAY_MISCALIBRATED, observation.start, trace.initial)
    overlays.log_result(rec, entities.OVERLAY_CORRECTED)
    if reference is not None:
        overlays.log_reference(rec, entities.OVERLAY_REFERENCE, reference)
    if Part.CURVES in contents.parts:
        _log_errors(rec, observation)
        _log_fit(rec, observation)


def log_worst(rec: Subtree, observation: Observation, contents: Contents) -> None:
    """Show a frame's result in the tab of the worst frame, replacing an earlier one."""
    frame_overlays(observation, contents).log_worst(rec)
    rec.log_for_all(entities.IMAGE_WORST, image_of(observation.frame))


def view(layout: Layout) -> View:
    """The large picture above curves, and the text beside them."""
    names = _pictures(layout)
    pictures = [frame_view(layout, name, path) for name, path in names.items()]
    if layout.with_worst:
        worst = frame_view(layout, WORST, entities.OVERLAY_WORST, image_of=entities.IMAGE_WORST)
        pictures.append(worst)
    left: list[View] = [rrb.Tabs(*pictures, active_tab=0, name="Result"), point_legend(layout)]
    shares = [min(_height(layout, LARGE_SHARE) + 2 * TITLE_HEIGHT, LARGEST_OVERLAY), LEGEND_HEIGHT]
    if _curve_views(layout) and layout.stages and Part.CURVES in layout.contents.parts:
        curves = rrb.Horizontal(*_curve_views(layout))
        left += [curves, legend("Curves", LEGEND_CURVES)]
        shares += [SCREEN_HEIGHT - sum(shares) - LEGEND_HEIGHT, 0.8 * LEGEND_HEIGHT]
    said: list[View] = [rrb.TextDocumentView(origin=entities.TABLE, name="This frame, stage by stage")]
    if layout.with_drive:
        said.insert(0, rrb.TextDocumentView(origin=entities.DRIVE_TEXT, name="The answer: whole drive as one"))
    small = [frame_view(layout, name, path, small=True) for name, path in names.items() if path in _SMALL]
    largest = LARGEST_SMALL if len(small) > 1 else LARGEST_ONLY
    heights = [min(_height(layout, 1.0 - LARGE_SHARE) + TITLE_HEIGHT, largest)] * len(small)
    return rrb.Horizontal(
        rrb.Vertical(*left, row_shares=shares),
        rrb.Vertical(rrb.Tabs(*said, active_tab=0), *small, row_shares=[SCREEN_HEIGHT - sum(heights), *heights]),
        column_shares=[LARGE_SHARE, 1.0 - LARGE_SHARE],
        name=NAME,
    )


def _pictures(layout: Layout) -> dict[str, str]:
    """The tabs of the large picture, and the overlay that each shows; the result comes first."""
    names = {"Result (on “step”: every stage)": entities.OVERLAY_CURRENT}
    if not layout.stages or Part.OVERLAYS not in layout.contents.parts:
        names = {"Result": entities.OVERLAY_DRIVE if layout.with_drive else entities.OVERLAY_CORRECTED}
    if layout.with_drive:
        names["This frame alone"] = entities.OVERLAY_CORRECTED
    names[layout.start] = entities.OVERLAY_MISCALIBRATED
    return names | ({"Reference (truth)": entities.OVERLAY_REFERENCE} if layout.has_reference else {})


def _height(layout: Layout, share: float) -> float:
    """Height in pixels of a picture with its caption, if it takes ``share`` of the screen's width."""
    width, height = layout.image
    return share * SCREEN_WIDTH * (height + caption_strip(layout.image, layout.has_reference).height) / width


def _curve_views(layout: Layout) -> list[View]:
    """The errors after every stage over the frames, where they are known, and the match errors that stages expect.

    The initial error is not among them: it is so large that the stages' would lie on zero. The table has it.
    """
    kinds = entities.ERROR_KINDS.items() if layout.has_reference else ()
    errors: list[View] = [
        curve_view(
            f"{kind.capitalize()} error [{unit}]",
            f"error/{kind}",
            "$origin/**",
            f"- /{entities.error_corrected(kind)}",
            f"- /{entities.error_initial(kind)}",
        )
        for kind, unit in kinds
    ]
    return [*errors, curve_view("Fit: match error [px]", FIT)] if layout.with_fit else errors


def _log_errors(rec: Subtree, observation: Observation) -> None:
    """Log the errors in degrees and centimetres of the start, every stage and the result."""
    trace = observation.trace
    if observation.reference is None:
        return
    for kind in entities.ERROR_KINDS:
        rec.log(entities.error_limit(kind), rr.Scalars(LIMITS[kind]))
        curves = {entities.error_initial(kind): trace.initial, entities.error_corrected(kind): trace.corrected}
        curves |= {entities.error_stage(kind, stage.number): stage.after for stage in trace.stages}
        for curve, camera_from_lidar in curves.items():
            error = observation.error(camera_from_lidar)
            if error is not None:
                rec.log(curve, rr.Scalars(error.rotation_deg if kind == "rotation" else error.translation_cm))


def _log_fit(rec: Subtree, observation: Observation) -> None:
    """Log the match error that every stage expects, which needs no reference, and the limit of the last one's."""
    trace = observation.trace
    for stage in trace.stages:
        if not (trace.method and math.isnan(stage.match_error_px)):
            rec.log(fit_stage(stage.number), rr.Scalars(observation.image_px(stage, stage.match_error_px)))
    if trace.stages and math.isfinite(trace.match_error_limit_px):
        limit = observation.image_px(trace.stages[-1], trace.match_error_limit_px)
        rec.log(FIT_LIMIT, rr.Scalars(limit))


def _log_curve_styles(rec: Subtree, layout: Layout) -> None:
    looks = {stage.number: (stage.short.lower(), colors.STAGES[stage.number]) for stage in layout.stages}
    names = {f"after {name}": color for name, color in looks.values()}
    names[f"limit: {FRAME_LIMITS}" if layout.has_reference else "limit"] = colors.LIMIT
    log_names(rec, LEGEND_CURVES, names | frames_named(layout))
    curves = {fit_stage(number): look for number, look in looks.items()} if layout.with_fit else {}
    limits = {FIT_LIMIT: "believed: below"} if layout.with_fit else {}
    for kind, unit in entities.ERROR_KINDS.items() if layout.has_reference else ():
        curves[entities.error_initial(kind)] = ("miscalibrated", colors.INITIAL)
        curves |= {entities.error_stage(kind, number): look for number, look in looks.items()}
        limits[entities.error_limit(kind)] = f"limit of a frame: {LIMITS[kind]:g} {unit}"
    for path, name in limits.items():
        rec.log_once(path, rr.SeriesLines(names=name, colors=colors.LIMIT, widths=1.5))
    for path, (name, color) in curves.items():
        line = rr.SeriesLines(names=name, colors=color, widths=2.0)
        rec.log_once(path, line, rr.SeriesPoints(names=name, colors=color, marker_sizes=3.0))
