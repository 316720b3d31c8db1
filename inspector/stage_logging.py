"""What is logged for every stage: displacement, confidence, cost volumes and hourglass."""

from __future__ import annotations

import numpy as np
import rerun as rr

from calibnet.trace import ScaleTrace, StageDetail, StageTrace
from inspector import colors, entities
from inspector.channel_grid import channel_grid_png
from inspector.matches import Match, chosen_match
from inspector.observation import Detail, Observation

CELL_FRAME: colors.Rgb = (255, 0, 200)
ARROW_SPACING = (2, 3)
"""Fewest and most cells between two arrows of the displacement field: long arrows stand farther apart."""
TENSOR_DIMENSIONS = ("dy", "dx", "y", "x")


def log_stages(rec: rr.RecordingStream, observation: Observation, detail: Detail) -> None:
    """Log the intermediate results of every stage that has them."""
    for stage in observation.trace.stages:
        if stage.detail is not None:
            log_stage(rec, observation, stage, stage.detail, detail)


def log_stage(
    rec: rr.RecordingStream, observation: Observation, stage: StageTrace, results: StageDetail, detail: Detail
) -> None:
    """Log one stage: its displacement field, then every scale of its cost volumes."""
    finest = results.scales[0]
    reach = finest.stride * (finest.volume.shape[0] // 2)
    log_displacement(rec, stage.number, results, finest.stride, reach)
    match = chosen_match(observation, stage, results)
    for scale in results.scales:
        log_cost_volume(rec, stage.number, scale, match, detail)
        log_hourglass(rec, stage.number, scale)


def log_displacement(rec: rr.RecordingStream, number: int, results: StageDetail, stride: int, reach_px: float) -> None:
    """Log the displacement field as flow colours with arrows, and its confidence."""
    seen = results.confidence > 0
    field = colors.flow_colors(results.displacement, reach_px)
    field[~seen] = colors.EMPTY
    rec.log(entities.displacement(number), rr.Image(field))
    rows, columns = np.nonzero(seen)
    lengths = np.linalg.norm(results.displacement[seen], axis=1) / stride
    every = int(np.clip(np.median(lengths), *ARROW_SPACING)) if len(lengths) else 1
    drawn = (rows % every == 0) & (columns % every == 0)
    rows, columns = rows[drawn], columns[drawn]
    rec.log(
        entities.displacement_arrows(number),
        rr.Arrows2D(
            origins=np.stack([columns + 0.5, rows + 0.5], axis=1),
            vectors=results.displacement[rows, columns] / stride,
            colors=(20, 20, 20),
            radii=rr.Radius.ui_points(0.7),
        ),
    )
    confidence = colors.map_colors(results.confidence, 0.0, 1.0)
    confidence[~seen] = colors.EMPTY
    rec.log(entities.confidence(number), rr.Image(confidence))


def log_cost_volume(
    rec: rr.RecordingStream, number: int, scale: ScaleTrace, match: Match | None, detail: Detail
) -> None:
    """Log one cost volume: three readable slices and, in full detail, the tensors themselves."""
    stride = scale.stride
    middle_y, middle_x = scale.volume.shape[0] // 2, scale.volume.shape[1] // 2
    centre = scale.volume[middle_y, middle_x]
    score = colors.map_colors(centre, *colors.robust_limits(centre[scale.occupied]))
    score[~scale.occupied] = colors.EMPTY
    rec.log(entities.score(number, stride), rr.Image(score))
    best = colors.flow_colors(scale.best, max(middle_x, middle_y))
    best[~scale.occupied] = colors.EMPTY
    rec.log(entities.best_match(number, stride), rr.Image(best))
    if match is not None:
        _log_window(rec, number, scale, match)
    if detail is Detail.FULL:
        low, high = colors.robust_limits(scale.volume)
        limits = (low, max(high, low + 1e-3))
        rec.log(
            entities.cost_volume(number, stride),
            rr.Tensor(scale.volume, dim_names=TENSOR_DIMENSIONS, value_range=limits),
        )
        rec.log(entities.probability(number, stride), rr.Tensor(scale.probability, dim_names=TENSOR_DIMENSIONS))


def _log_window(rec: rr.RecordingStream, number: int, scale: ScaleTrace, match: Match) -> None:
    """Log the search window of the chosen cell, and mark that cell on both slices."""
    stride = scale.stride
    x, y = match.cell(stride)
    height, width = scale.occupied.shape
    x, y = min(x, width - 1), min(y, height - 1)
    frame = rr.Boxes2D(mins=[[x, y]], sizes=[[1, 1]], colors=CELL_FRAME, radii=rr.Radius.ui_points(1.5))
    rec.log(entities.chosen_cell(number, stride), frame)
    window = scale.volume[:, :, y, x].astype(np.float32)
    rec.log(
        entities.window(number, stride), rr.Image(colors.map_colors(window, float(window.min()), float(window.max())))
    )
    middle = np.array([window.shape[1] // 2, window.shape[0] // 2]) + 0.5
    rec.log(
        entities.window_cells(number, stride),
        rr.Boxes2D(
            centers=[middle, middle + scale.best[y, x]],
            half_sizes=[[0.5, 0.5], [0.4, 0.4]],
            colors=[colors.INITIAL, colors.FOUND],
            radii=rr.Radius.ui_points(1.5),
        ),
    )
    if match.true_displacement is not None:
        true = middle + np.asarray(match.true_displacement) / stride
        at_border = np.clip(true, 0.0, [window.shape[1], window.shape[0]])
        rec.log(
            entities.window_truth(number, stride),
            rr.Points2D([at_border], colors=colors.REFERENCE, radii=rr.Radius.ui_points(5.0)),
        )


def log_hourglass(rec: rr.RecordingStream, number: int, scale: ScaleTrace) -> None:
    """Log the activations entering and leaving the hourglass, channels side by side."""
    for path, activations in (
        (entities.hourglass_before(number, scale.stride), scale.before),
        (entities.hourglass_after(number, scale.stride), scale.after),
    ):
        rec.log(path, rr.EncodedImage(contents=channel_grid_png(activations), media_type="image/png"))
