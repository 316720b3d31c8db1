"""The road's centre line and the ground swept along it: lanes, kerbs, pavements, verges, markings."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from calibnet.datasets.synthetic.mesh import Material, Mesh, patches, quads
from calibnet.geometry.types import Floats, Vector3

_FIRST = -300.0
"""First tabulated station, metres."""


@dataclass(frozen=True, eq=False)
class CentreLine:
    """A curve that never crosses itself: heading and height are bounded sums of sines of the station.

    Attributes:
        bends: ``[B, 3]`` amplitude (radians), wavelength (metres), phase of the heading.
        hills: ``[H, 3]`` amplitude (metres), wavelength (metres), phase of the height.
        length: length that is tabulated, metres.
    """

    bends: Floats
    hills: Floats
    length: float

    def heading(self, station: ArrayLike) -> Floats:
        """Direction of travel at stations ``[...]``, radians from x."""
        return _waves(self.bends, station)

    def height(self, station: ArrayLike) -> Floats:
        """Height of the centre line at stations ``[...]``, metres."""
        return _waves(self.hills, station)

    @cached_property
    def _table(self) -> Floats:
        """Rows x, y, height, cos and sin of the heading, one a metre from ``_FIRST``."""
        stations = np.arange(_FIRST, self.length + 600.0, 1.0)
        between = self.heading(stations + 0.5)
        steps = np.stack([np.cos(between), np.sin(between)], axis=1)
        position = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)[:-1]])
        heading = self.heading(stations)
        return np.column_stack([position, self.height(stations), np.cos(heading), np.sin(heading)])

    def place(self, station: ArrayLike, lateral: ArrayLike, lift: ArrayLike = 0.0) -> Floats:
        """World positions ``[..., 3]`` of points ``lateral`` metres left of the centre line."""
        row = np.asarray(station, dtype=np.float64) - _FIRST
        floor = np.floor(row).astype(np.int64)
        share = (row - floor)[..., None]
        x, y, z, cos, sin = np.moveaxis((1.0 - share) * self._table[floor] + share * self._table[floor + 1], -1, 0)
        parts = np.broadcast_arrays(x - sin * lateral, y + cos * lateral, z + lift)
        return np.stack(parts, axis=-1)

    def stand(self, station: float, lateral: float, lift: float) -> tuple[Vector3, float]:
        """World position ``[3]`` and heading at one place: like `place` for a single object, but much faster."""
        row = station - _FIRST
        index = int(row)
        first, share = self._table[index], row - index
        x, y, z, cos, sin = (first + share * (self._table[index + 1] - first)).tolist()
        return np.array([x - sin * lateral, y + cos * lateral, z + lift]), math.atan2(sin, cos)

    def nearest_station(self, position: ArrayLike) -> float:
        """Station of the tabulated point closest to a world position."""
        gap = self._table[:, :2] - np.asarray(position, dtype=np.float64)[:2]
        return float(np.argmin((gap**2).sum(axis=1))) + _FIRST


def _waves(table: Floats, station: ArrayLike) -> Floats:
    """Sum at stations ``[...]`` of the sines in a table ``[W, 3]``: amplitude, wavelength, phase."""
    amplitude, wave, phase = table.T
    s = np.asarray(station, dtype=np.float64)[..., None]
    return np.asarray((amplitude * np.sin(2.0 * np.pi * s / wave + phase)).sum(axis=-1))


@dataclass(frozen=True)
class Strip:
    """One strip of the ground's cross-section.

    Attributes:
        inner, outer: positions of its edges, metres left of the centre line.
        inner_lift, outer_lift: heights of its edges above the centre line, metres.
        material: material of its surface.
    """

    inner: float
    outer: float
    inner_lift: float
    outer_lift: float
    material: Material


@dataclass(frozen=True)
class Relief:
    """Bumps of the open land, which begin at ``start`` and reach their full height 4 m farther from the road.

    Attributes:
        amplitude: height of the bumps, metres.
        start: edge of the road with its pavements, metres from the centre line.
    """

    amplitude: float
    start: float

    def height(self, position: Floats, lateral: Floats | float) -> Floats:
        """Metres to add at world positions ``[..., 3]``, ``lateral`` metres from the centre line."""
        x, y = position[..., 0], position[..., 1]
        wide = np.sin(0.31 * x + 0.7 * np.sin(0.23 * y)) * np.cos(0.27 * y + 0.5 * np.sin(0.19 * x))
        fine = np.sin(1.3 * x + 1.1 * np.sin(0.9 * y)) * np.cos(1.1 * y + 0.8 * np.sin(1.4 * x))
        fade = np.clip((np.abs(lateral) - self.start) / 4.0, 0.0, 1.0)
        return np.asarray(self.amplitude * fade * (0.7 * wide + 0.3 * fine))


def sweep(line: CentreLine, strips: list[Strip], relief: Relief, start: float, stop: float, step: float) -> list[Mesh]:
    """Extrude strips along the centre line between two stations."""
    stations = np.linspace(start, stop, max(round((stop - start) / step), 1) + 1)
    meshes = []
    for strip in strips:
        width = abs(strip.outer - strip.inner)
        bumpy = relief.amplitude > 0.0 and abs(strip.outer) > relief.start
        pieces = int(np.clip(width / 2.5, 1, 10)) if bumpy else 1
        share = np.linspace(0.0, 1.0, pieces + 1)
        lateral = strip.inner + share * (strip.outer - strip.inner)
        lift = strip.inner_lift + share * (strip.outer_lift - strip.inner_lift)
        grid = line.place(stations[:, None], lateral[None], lift[None])
        if bumpy:
            grid[..., 2] += relief.height(grid, lateral)
        side = np.hypot(lateral - lateral[0], lift - lift[0])
        uv = np.stack(np.broadcast_arrays(stations[:, None], side[None] + strip.inner), axis=-1)
        meshes.append(quads(patches(grid), patches(uv), strip.material))
    return meshes


def decals(line: CentreLine, areas: ArrayLike, material: Material, lift: float, camber: float) -> Mesh:
    """Markings on the road, from areas ``[N, 4]``: start and stop station, right and left lateral bound.

    ``lift`` is their height above the road, ``camber`` the slope of the road across, from its centre.
    """
    start, stop, right, left = np.asarray(areas, dtype=np.float64).reshape(-1, 4).T
    station = np.stack([start, stop, stop, start], axis=1)
    lateral = np.stack([right, right, left, left], axis=1)
    corners = line.place(station, lateral, lift - camber * np.abs(lateral))
    return quads(corners, np.stack([station, lateral], axis=-1), material)


def dashes(start: float, stop: float, lateral: float, width: float, length: float, gap: float) -> Floats:
    """Areas ``[N, 4]`` of a dashed line, on a grid fixed to the station so that neighbouring chunks agree."""
    period = length + gap
    first = np.arange(np.ceil(start / period) * period, stop, period)
    half = np.full(len(first), 0.5 * width)
    return np.stack([first, first + length, lateral - half, lateral + half], axis=1)


def solid(start: float, stop: float, lateral: float, width: float, step: float = 2.5) -> Floats:
    """Areas ``[N, 4]`` of a solid line, in pieces short enough to follow bends."""
    edges = np.linspace(start, stop, max(round((stop - start) / step), 1) + 1)
    half = np.full(len(edges) - 1, 0.5 * width)
    return np.stack([edges[:-1], edges[1:], lateral - half, lateral + half], axis=1)
