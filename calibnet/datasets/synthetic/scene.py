"""A scene: one place of the synthetic world, with its road, its light and choices that hold everywhere in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from calibnet.datasets.synthetic import library
from calibnet.datasets.synthetic.mesh import Material, Mesh
from calibnet.datasets.synthetic.road import CentreLine, Relief
from calibnet.datasets.synthetic.style import Style, sample_style
from calibnet.datasets.synthetic.textures import atlas
from calibnet.datasets.synthetic.weather import Weather, sample_weather
from calibnet.geometry import rotation_from_euler_xyz, transform
from calibnet.geometry.types import Floats, Transform


@dataclass(frozen=True, eq=False)
class Scene:
    """One place with its road and its light: everything that is drawn once for all its objects and traffic.

    Attributes:
        seed: seeds the generators of chunks and vehicles, together with their numbers.
        style: the kind of place, its widths, densities and materials.
        weather: its light.
        line: the centre line of its road.
        paint: material of the road markings.
        kerb_texture: layer of the texture atlas.
        dash: lengths of the dashes of a lane line and of the gaps between them, metres.
        center_line: "dashed", "double" or "none".
        edge_lines: whether solid lines bound the carriageway.
        banks: rise of the land over the 74 m beyond the plots, right and left, metres.
        leaf_colour: ``[3]`` linear RGB factor on all foliage, by the season.
        fence_kind: "fence" or "hedge" around the plots.
        fences: the fence of the right and of the left side.
        rail: a segment of the crash barrier.
        outer_rails: whether a motorway has barriers at its edges too.
        park_on_pavement: whether cars park on the pavement if there is no parking strip.
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
    leaf_colour: Floats
    fence_kind: str
    fences: tuple[Mesh, Mesh]
    rail: Mesh
    outer_rails: bool
    park_on_pavement: bool

    @property
    def relief(self) -> Relief:
        """Bumps of the land beside the road: right beside a track, behind the plots of a street."""
        return Relief(self.style.rough, self.style.edge if self.style.wild else self.style.front + 1.0)

    def lift(self, lateral: float) -> float:
        """Height of the smooth ground above the centre line."""
        beyond = abs(lateral) - self.style.front - 1.0
        if beyond > 0.0:
            return self.style.kerb + self.bank(lateral) * beyond / 74.0
        return self.style.kerb if abs(lateral) > self.style.edge else 0.0

    def bank(self, side: float) -> float:
        """Rise of the land on one side of the road (right is negative), metres."""
        return self.banks[0 if side < 0 else 1]

    def fence(self, side: float) -> Mesh:
        """The fence of one side of the road (right is negative)."""
        return self.fences[0 if side < 0 else 1]

    def pose(self, station: float, lateral: float | None = None, yaw: float = 0.0) -> Transform:
        """``world_from_vehicle`` of a vehicle driving at a station, by default in the ego lane."""
        lateral = self.style.lane_center(0, own=True) if lateral is None else lateral
        slope = float(self.line.height(station + 1.0) - self.line.height(station - 1.0)) / 2.0
        heading = float(self.line.heading(station)) + yaw
        turn = rotation_from_euler_xyz([0.0, 0.0, heading]) @ rotation_from_euler_xyz([0.0, -np.arctan(slope), 0.0])
        return transform(turn, self.line.place(station, lateral))

    def stand(
        self,
        mesh: Mesh,
        station: float,
        lateral: float,
        turn: float = 0.0,
        lift: float = 0.0,
        scale: ArrayLike = 1.0,
        colour: ArrayLike | None = None,
    ) -> Mesh:
        """Place a prototype on the ground at a station.

        Args:
            mesh: the prototype; x is its front.
            station: metres along the road.
            lateral: metres left of the centre line.
            turn: radians from the road's direction.
            lift: metres above the ground.
            scale: factors of its size, one or ``[3]``.
            colour: ``[3]`` linear RGB of its painted triangles.
        """
        position, heading = self.line.stand(float(station), float(lateral), lift + self.lift(lateral))
        position[2] += self.relief.height(position, lateral)
        return mesh.placed(position, heading + turn, scale, colour)


def sample_scene(generator: Generator, length: float = 400.0) -> Scene:
    """Draw a scene whose road is at least ``length`` metres long."""
    tiles = atlas()
    style = sample_style(tiles, generator)
    bend = {"highway": 0.12, "off-road": 0.6, "park": 0.6}.get(style.kind, 0.3) * generator.uniform(0.1, 1.0)
    wave = 140.0 if style.wild else 320.0
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
