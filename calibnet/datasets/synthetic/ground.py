"""The ground of a stretch of road, with its markings."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.random import Generator

from calibnet.datasets.synthetic import road
from calibnet.datasets.synthetic.mesh import Material, Mesh
from calibnet.datasets.synthetic.scene import Scene
from calibnet.datasets.synthetic.style import Style
from calibnet.geometry.types import Floats

CAMBER = 0.04
"""Height of the centre of the carriageway above its edge, metres."""


def cross_section(scene: Scene, start: float, stop: float) -> list[Mesh]:
    """Carriageway, kerbs, pavements, verges and the land beyond, swept along the road."""
    strips = [strip for side in (-1.0, 1.0) for strip in _strips(scene, side)]
    return road.sweep(scene.line, strips, scene.relief, start, stop, 2.5)


def _strips(scene: Scene, side: float) -> Iterator[road.Strip]:
    """One side of the ground from the centre line outwards."""
    style = scene.style
    edge, verge, land = side * style.edge, side * (style.edge + style.pavement), side * (style.front + 1.0)
    horizon, lift = side * (style.front + 75.0), style.kerb
    yield road.Strip(0.0, edge, 0.0, -CAMBER, style.road)
    kerb = edge
    if style.kerb:
        stone = Material(scene.kerb_texture, (0.9, 0.9, 0.9))
        face, kerb = edge + 0.02 * side, edge + 0.16 * side
        yield road.Strip(edge, face, -CAMBER, lift, stone)
        yield road.Strip(face, kerb, lift, lift, stone)
    if style.pavement:
        yield road.Strip(kerb, verge, lift, lift + 0.03, style.walk)
    yield road.Strip(verge, land, lift + (0.03 if style.pavement else -CAMBER), lift + 0.05, style.verge)
    yield road.Strip(land, horizon, lift + 0.05, lift + 0.05 + scene.bank(side), style.field)


def markings(scene: Scene, generator: Generator, start: float, stop: float) -> list[Mesh]:
    """Lane lines, crossings, stop lines, arrows and repairs on the carriageway."""
    style = scene.style
    if style.wild:
        return []
    camber = CAMBER / style.edge
    parts = []
    areas = _lane_lines(scene, start, stop)
    if style.kind != "highway":
        areas += _junction(scene, generator, start, stop)
    if areas:
        parts.append(road.decals(scene.line, np.concatenate(areas), scene.paint, 0.012, camber))
    patches = int(generator.integers(0, 4))
    if patches:  # repairs, manholes, oil
        s, y = generator.uniform(start, stop, patches), generator.uniform(-style.edge, style.edge - 1.0, patches)
        long, wide = generator.choice([0.6, 0.6, 1.2, 2.5], patches), generator.uniform(0.5, 1.5, patches)
        tone = float(generator.choice([0.45, 0.7, 1.3]))
        material = Material(style.road.texture, (tone, tone, tone))
        parts.append(road.decals(scene.line, np.stack([s, s + long, y, y + wide], 1), material, 0.006, camber))
    return parts


def _lane_lines(scene: Scene, start: float, stop: float) -> list[Floats]:
    """Areas, each ``[N, 4]``, of the lines along the road."""
    style = scene.style
    areas = []
    for side in (-1.0, 1.0):
        if scene.edge_lines:
            areas.append(road.solid(start, stop, side * (_lanes_edge(style) - 0.15), 0.13))
        for lane in range(1, style.lanes):
            areas.append(road.dashes(start, stop, side * (style.median + lane * style.lane), 0.14, *scene.dash))
        if style.median:
            areas.append(road.solid(start, stop, side * (style.median + 0.2), 0.15))
    if not style.median and scene.center_line == "dashed":
        areas.append(road.dashes(start, stop, 0.0, 0.13, *scene.dash))
    elif not style.median and scene.center_line == "double":
        areas += [road.solid(start, stop, lateral, 0.11) for lateral in (-0.12, 0.12)]
    return areas


def _junction(scene: Scene, generator: Generator, start: float, stop: float) -> list[Floats]:
    """Areas, each ``[N, 4]``, of an occasional zebra crossing, and of an occasional stop line with an arrow."""
    style = scene.style
    areas = []
    if generator.random() < 0.10:
        stripes = np.arange(-_lanes_edge(style) + 0.3, _lanes_edge(style) - 0.5, 1.0)
        at = generator.uniform(start + 2.0, stop - 5.0)
        areas.append(np.stack([np.full_like(stripes, at), np.full_like(stripes, at + 3.0), stripes, stripes + 0.5], 1))
    if generator.random() < 0.12:
        at, own, half = generator.uniform(start, stop), style.lane_center(0, own=True), 0.45 * style.lane
        line = [at, at + 0.4, own - half, own + half]
        shaft, head = [at - 5.0, at - 2.0, own - 0.08, own + 0.08], [at - 2.4, at - 2.0, own - 0.4, own + 0.4]
        areas.append(np.array([line, shaft, head]))
    return areas


def _lanes_edge(style: Style) -> float:
    """Half the width of the carriageway without its parking strips, metres."""
    return style.median + style.lanes * style.lane
