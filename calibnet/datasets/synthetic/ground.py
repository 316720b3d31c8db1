"""The ground of a stretch of road and what is painted on it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from calibnet.datasets.synthetic import road
from calibnet.datasets.synthetic.mesh import Material, Mesh

if TYPE_CHECKING:
    from calibnet.datasets.synthetic.world import Scene

Generator = np.random.Generator
CAMBER = 0.04
"""Metres by which the edge of the carriageway lies below its centre."""


def cross_section(scene: Scene, start: float, stop: float) -> list[Mesh]:
    """Carriageway, kerbs, pavements, verges and the land beyond, swept along the road."""
    style = scene.style
    strips: list[road.Strip] = []
    kerb = Material(scene.kerb_texture, (0.9, 0.9, 0.9))
    for side in (-1.0, 1.0):
        a, b, c = side * style.edge, side * (style.edge + style.pavement), side * (style.front + 1.0)
        far, lift = side * (style.front + 75.0), style.kerb
        strips.append(road.Strip(0.0, a, 0.0, -CAMBER, style.road))
        if style.kerb:
            strips.append(road.Strip(a, a + 0.02 * side, -CAMBER, lift, kerb))
            strips.append(road.Strip(a + 0.02 * side, a + 0.16 * side, lift, lift, kerb))
        if style.pavement:
            strips.append(road.Strip(a + 0.16 * side if style.kerb else a, b, lift, lift + 0.03, style.walk))
        strips.append(road.Strip(b, c, lift + (0.03 if style.pavement else -CAMBER), lift + 0.05, style.verge))
        bank = scene.banks[0 if side < 0 else 1]
        strips.append(road.Strip(c, far, lift + 0.05, lift + 0.05 + bank, style.field))
    return road.sweep(scene.line, strips, scene.relief, start, stop, 2.5)


def markings(scene: Scene, generator: Generator, start: float, stop: float) -> list[Mesh]:
    """Lane lines, crossings, stop lines, arrows and repairs on the carriageway."""
    style, line = scene.style, scene.line
    if style.kind in ("off-road", "park"):
        return []
    areas, paint, camber = [], scene.paint, CAMBER / style.edge
    lanes_edge = style.median + style.lanes * style.lane
    for side in (-1.0, 1.0):
        if scene.edge_lines:
            areas.append(road.solid(start, stop, side * (lanes_edge - 0.15), 0.13))
        for lane in range(1, style.lanes):
            areas.append(road.dashes(start, stop, side * (style.median + lane * style.lane), 0.14, *scene.dash))
        if style.median:
            areas.append(road.solid(start, stop, side * (style.median + 0.2), 0.15))
    if not style.median and scene.center_line == "dashed":
        areas.append(road.dashes(start, stop, 0.0, 0.13, *scene.dash))
    elif not style.median and scene.center_line == "double":
        areas += [road.solid(start, stop, lateral, 0.11) for lateral in (-0.12, 0.12)]
    parts = []
    if style.kind != "highway" and generator.random() < 0.10:  # a zebra crossing
        stripes = np.arange(-lanes_edge + 0.3, lanes_edge - 0.5, 1.0)
        at = generator.uniform(start + 2.0, stop - 5.0)
        areas.append(np.stack([np.full_like(stripes, at), np.full_like(stripes, at + 3.0), stripes, stripes + 0.5], 1))
    if style.kind != "highway" and generator.random() < 0.12:  # a stop line and an arrow
        at, own = generator.uniform(start, stop), style.lane_center(0, True)
        areas.append(np.array([[at, at + 0.4, own - 0.45 * style.lane, own + 0.45 * style.lane]]))
        areas.append(
            np.array([[at - 5.0, at - 2.0, own - 0.08, own + 0.08], [at - 2.4, at - 2.0, own - 0.4, own + 0.4]])
        )
    if areas:
        parts.append(road.decals(line, np.concatenate(areas), paint, 0.012, camber))
    patches = int(generator.integers(0, 4))
    if patches:  # repairs, manholes, oil
        s, y = generator.uniform(start, stop, patches), generator.uniform(-style.edge, style.edge - 1.0, patches)
        long, wide = generator.choice([0.6, 0.6, 1.2, 2.5], patches), generator.uniform(0.5, 1.5, patches)
        tone = float(generator.choice([0.45, 0.7, 1.3]))
        material = Material(style.road.texture, (tone, tone, tone))
        parts.append(road.decals(line, np.stack([s, s + long, y, y + wide], 1), material, 0.006, camber))
    return parts
