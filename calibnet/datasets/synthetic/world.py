"""The synthetic driving world: an endless seeded road, populated in chunks, with moving traffic."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.synthetic import library
from calibnet.datasets.synthetic.mesh import Material, Mesh, concatenate
from calibnet.datasets.synthetic.population import CHUNK, populate
from calibnet.datasets.synthetic.road import CentreLine, Relief
from calibnet.datasets.synthetic.style import Style, sample_style
from calibnet.datasets.synthetic.surroundings import horizon, moving_traffic
from calibnet.datasets.synthetic.textures import atlas
from calibnet.datasets.synthetic.weather import Weather, sample_weather
from calibnet.geometry import rotation_from_euler_xyz, transform
from calibnet.geometry.types import Transform

Generator = np.random.Generator


@dataclass(eq=False)
class Scene:
    """One world; its chunks are built when first looked at and a few are kept.

    Attributes:
        seed: what every chunk's own generator starts from.
        style, weather, line: the kind of place, its light, its road.
        paint, kerb_texture, dash, center_line, edge_lines: road markings.
        banks: rise of the land on either side, metres.
        leaf_colour: ``[3]`` of the season.
        fence_kind, fences, rail, outer_rails, park_on_pavement: choices held over the whole scene.
    """

    seed: int
    style: Style
    weather: Weather
    line: CentreLine
    paint: Material
    kerb_texture: int
    dash: tuple[float, float]
    center_line: str
    edge_lines: bool
    banks: tuple[float, float]
    leaf_colour: NDArray[np.float64]
    fence_kind: str
    fences: tuple[Mesh, Mesh]
    rail: Mesh
    outer_rails: bool
    park_on_pavement: bool
    _chunks: OrderedDict[tuple[int, bool], Mesh] = field(default_factory=OrderedDict, repr=False)

    @property
    def relief(self) -> Relief:
        """Bumps of the land beside the road: right beside a track, behind the plots of a street."""
        open_land = self.style.kind in ("park", "off-road")
        return Relief(self.style.rough, self.style.edge if open_land else self.style.front + 1.0)

    def lift(self, lateral: float) -> float:
        """Height of the smooth ground above the centre line."""
        beyond = abs(lateral) - self.style.front - 1.0
        if beyond > 0.0:
            return self.style.kerb + self.banks[0 if lateral < 0 else 1] * beyond / 74.0
        return self.style.kerb if abs(lateral) > self.style.edge else 0.0

    def fence(self, side: float) -> Mesh:
        """The fence of one side of the road."""
        return self.fences[0 if side < 0 else 1]

    def pose(self, station: float, lateral: float | None = None, yaw: float = 0.0) -> Transform:
        """``world_from_vehicle`` of a vehicle that drives at a station, in the own lane by default."""
        lateral = self.style.lane_center(0, own=True) if lateral is None else lateral
        slope = float(self.line.height(station + 1.0) - self.line.height(station - 1.0)) / 2.0
        heading = float(self.line.heading(station)) + yaw
        turn = rotation_from_euler_xyz([0.0, 0.0, heading]) @ rotation_from_euler_xyz([0.0, -np.arctan(slope), 0.0])
        return transform(turn, self.line.place(station, lateral))

    def mesh(self, world_from_vehicle: Transform, time: float, behind: float = 100.0, ahead: float = 120.0) -> Mesh:
        """Everything around a vehicle at a time, as triangles in the world."""
        station = self.line.nearest_station(world_from_vehicle[:3, 3])
        first, last = int((station - behind) // CHUNK), int((station + ahead) // CHUNK)
        here = int(station // CHUNK)
        close = range(here - (behind > CHUNK), here + (ahead > CHUNK) + 1)
        parts = [self._chunk(index, index in close) for index in range(first, last + 1)]
        parts += moving_traffic(self, station, time, behind, ahead, world_from_vehicle[:3, 3])
        parts.append(horizon(self, world_from_vehicle[:3, 3]))
        return concatenate(parts)

    def _chunk(self, index: int, near: bool) -> Mesh:
        key = (index, near)
        if key not in self._chunks:
            self._chunks[key] = populate(self, index, near)
            while len(self._chunks) > 24:
                self._chunks.popitem(last=False)
        return self._chunks[key]


def build_scene(generator: Generator, length: float = 400.0) -> Scene:
    """Draw a scene whose road is at least ``length`` metres long."""
    tiles = atlas()
    style = sample_style(tiles, generator)
    bend = {"highway": 0.12, "off-road": 0.6, "park": 0.6}.get(style.kind, 0.3) * generator.uniform(0.1, 1.0)
    wave = 140.0 if style.kind in ("off-road", "park") else 320.0
    bends = np.column_stack(
        [bend * generator.uniform(0.2, 0.6, 2), wave * generator.uniform(0.7, 2.5, 2), generator.uniform(0, 6.3, 2)]
    )
    hills = np.column_stack(
        [generator.uniform(0.0, 1.8, 2), generator.uniform(160, 400, 2), generator.uniform(0, 6.3, 2)]
    )
    tone = float(generator.uniform(0.6, 1.0))
    season = np.array([1.0, 1.0, 1.0]) if generator.random() < 0.85 else np.array([2.2, 1.2, 0.6])
    return Scene(
        seed=int(generator.integers(2**62)),
        style=style,
        weather=sample_weather(generator),
        line=CentreLine(bends, hills, length),
        paint=Material(
            tiles.pick("paint", generator), (tone, tone, tone * float(generator.choice([1.0, 1.0, 0.3]))), 0.0, 1.0
        ),
        kerb_texture=tiles.pick("kerb", generator),
        dash=((6.0, 12.0), (3.0, 6.0), (2.0, 4.0), (4.0, 8.0))[int(generator.integers(4))],
        center_line=str(generator.choice(["dashed", "double", "none"], p=[0.5, 0.2, 0.3])),
        edge_lines=bool(style.kind == "highway" or generator.random() < 0.4),
        banks=(float(generator.normal(0.5, 2.5)), float(generator.normal(0.5, 2.5))),
        leaf_colour=season * generator.uniform(0.7, 1.2),
        fence_kind="hedge" if generator.random() < 0.4 else "fence",
        fences=(library.pick("fence", generator), library.pick("fence", generator)),
        rail=library.pick("guard_rail", generator),
        outer_rails=bool(generator.random() < 0.6),
        park_on_pavement=bool(generator.random() < 0.3),
    )
