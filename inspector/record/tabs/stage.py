"""What is logged for every stage: displacement, confidence, cost volumes and hourglass."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from calibnet.trace import ScaleTrace, StageDetail, StageTrace
from inspector import colors, entities
from inspector.record.contents import Contents, Part
from inspector.record.observation import Observation
from inspector.record.pictures.channel_grid import channel_grid, palette_png, slice_grid
from inspector.record.pictures.matches import Match, StartingPoints, chosen_match

CELL_FRAME: colors.Rgb = (255, 0, 200)
ARROW_SPACING = (2, 3)
"""Fewest and most cells between two arrows of the displacement field: long arrows stand farther apart."""
TENSOR_DIMENSIONS = ("dy", "dx", "y", "x")


def log_stages(rec: rr.RecordingStream, observation: Observation, contents: Contents) -> None:
    """Log the intermediate results of every stage that has them."""
    for stage in observation.trace.stages:
        if stage.detail is not None and contents.inside:
            log_stage(rec, observation, stage, stage.detail, contents)


def log_stage(
    rec: rr.RecordingStream, observation: Observation, stage: StageTrace, results: StageDetail, contents: Contents
) -> None:
    """Log one stage: its displacement field, then every scale of its cost volumes."""
    number = stage.number
    if Part.VOLUMES in contents.parts:
        log_displacement(rec, number, results)
    if contents.parts & {Part.VOLUMES, Part.TENSORS}:
        points = StartingPoints.of(observation, stage)
        match = chosen_match(points, results)
        for scale in contents.scales(results):
            true = points.true_field(scale.stride)
            if Part.VOLUMES in contents.parts:
                log_maps(rec, number, scale, true)
                if match is not None:
                    log_window(rec, number, scale, match)
            if Part.TENSORS in contents.parts:
                log_tensors(rec, number, scale)
                log_slices(rec, number, scale, true)
    if Part.HOURGLASS in contents.parts:
        for scale in contents.scales(results):
            log_hourglass(rec, number, scale)


def log_displacement(rec: rr.RecordingStream, number: int, results: StageDetail) -> None:
    """Log the displacement field as flow colours with arrows, and its confidence."""
    finest = results.scales[0]
    seen = results.confidence > 0
    rec.log(entities.displacement(number), _flow_image(results.displacement, _reach_px(finest), seen))
    rows, columns = np.nonzero(seen)
    lengths = np.linalg.norm(results.displacement[seen], axis=1) / finest.stride
    every = int(np.clip(np.median(lengths), *ARROW_SPACING)) if len(lengths) else 1
    drawn = (rows % every == 0) & (columns % every == 0)
    rows, columns = rows[drawn], columns[drawn]
    rec.log(
        entities.displacement_arrows(number),
        rr.Arrows2D(
            origins=np.stack([columns + 0.5, rows + 0.5], axis=1),
            vectors=results.displacement[rows, columns] / finest.stride,
            colors=(20, 20, 20),
            radii=rr.Radius.ui_points(0.7),
        ),
    )
    rec.log(entities.confidence(number), _certainty_image(results.confidence, seen))


def log_maps(rec: rr.RecordingStream, number: int, scale: ScaleTrace, true: NDArray[np.float32] | None) -> None:
    """Log which displacement won in every cell, how surely, and which is the true one."""
    stride, reach = scale.stride, _reach_px(scale)
    rec.log(entities.best_match(number, stride), _flow_image(scale.best * stride, reach, scale.occupied))
    peak = scale.probability.max(axis=(0, 1))
    rec.log(entities.peak_probability(number, stride), _certainty_image(peak, scale.occupied))
    if true is not None:
        rec.log(entities.true_match(number, stride), _flow_image(true, reach, scale.occupied))


def log_window(rec: rr.RecordingStream, number: int, scale: ScaleTrace, match: Match) -> None:
    """Log the search window of the chosen cell, and mark that cell on the maps."""
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


def log_tensors(rec: rr.RecordingStream, number: int, scale: ScaleTrace) -> None:
    """Log the volume before and after aggregation as they are."""
    low, high = colors.robust_limits(scale.volume)
    limits = (low, max(high, low + 1e-3))
    rec.log(
        entities.cost_volume(number, scale.stride),
        rr.Tensor(scale.volume, dim_names=TENSOR_DIMENSIONS, value_range=limits),
    )
    rec.log(entities.probability(number, scale.stride), rr.Tensor(scale.probability, dim_names=TENSOR_DIMENSIONS))


def log_slices(rec: rr.RecordingStream, number: int, scale: ScaleTrace, true: NDArray[np.float32] | None) -> None:
    """Log every slice of the aggregated volume in one picture; frame the winner and the true displacement."""
    down, across, height, width = scale.probability.shape
    high = (
        float(np.percentile(scale.probability.max(axis=(0, 1))[scale.occupied], 90.0)) if scale.occupied.any() else 1.0
    )
    grid = slice_grid(scale.probability, scale.occupied, high)
    rec.log(entities.slices(number, scale.stride), rr.EncodedImage(contents=palette_png(grid), media_type="image/png"))
    middle = np.array([across // 2, down // 2])
    marked = [("now", np.zeros(2, dtype=int), colors.INITIAL)]
    marked.append(("won most cells", _most_common(scale.best[scale.occupied]), colors.FOUND))
    if true is not None and scale.occupied.any():
        typical = np.rint(np.median(true[scale.occupied], axis=0) / scale.stride).astype(int)
        marked.append(("true", np.clip(typical, -middle, middle), colors.REFERENCE))
    names: dict[tuple[int, ...], tuple[str, colors.Rgb]] = {}
    for name, cell, color in marked:  # one frame a tile: names that share one are joined
        known = names.get(tuple(cell))
        names[tuple(cell)] = (f"{known[0]}, {name}" if known else name, color)
    tile = np.array([width + 1, height + 1])
    rec.log(
        entities.slice_marks(number, scale.stride),
        rr.Boxes2D(
            mins=[(middle + cell) * tile for cell in names],
            sizes=[tile for _ in names],
            colors=[color for _, color in names.values()],
            labels=[name for name, _ in names.values()],
            radii=rr.Radius.ui_points(2.0),
            show_labels=True,
        ),
    )


def log_hourglass(rec: rr.RecordingStream, number: int, scale: ScaleTrace) -> None:
    """Log the activations entering and leaving the hourglass on one colour scale, channels side by side."""
    both = np.concatenate([scale.before.ravel(), scale.after.ravel()])
    low, high = colors.robust_limits(both)
    for path, activations in (
        (entities.hourglass_before(number, scale.stride), scale.before),
        (entities.hourglass_after(number, scale.stride), scale.after),
    ):
        picture = palette_png(channel_grid(activations, low, high))
        rec.log(path, rr.EncodedImage(contents=picture, media_type="image/png"))


def _reach_px(scale: ScaleTrace) -> float:
    """Longest displacement along one axis that the window holds."""
    return scale.stride * float(max(scale.volume.shape[0] // 2, scale.volume.shape[1] // 2))


def _flow_image(
    displacement: NDArray[np.floating] | NDArray[np.integer], reach: float, seen: NDArray[np.bool_]
) -> rr.Image:
    picture = colors.flow_colors(displacement, reach)
    picture[~seen] = colors.EMPTY
    return rr.Image(picture)


def _certainty_image(values: NDArray[np.floating], seen: NDArray[np.bool_]) -> rr.Image:
    picture = colors.certainty_colors(values)
    picture[~seen] = colors.EMPTY
    return rr.Image(picture)


def _most_common(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """The displacement ``(dx, dy)`` that most of ``[N, 2]`` share; none of no cells."""
    if not len(cells):
        return np.zeros(2, dtype=np.int64)
    found, counts = np.unique(cells, axis=0, return_counts=True)
    return np.asarray(found[counts.argmax()])
