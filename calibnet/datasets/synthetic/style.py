"""What kind of place a scene is: widths, densities and materials, drawn once a scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibnet.datasets.synthetic.mesh import Material
from calibnet.datasets.synthetic.textures import Atlas

Generator = np.random.Generator
KINDS = ("street", "suburb", "highway", "industrial", "park", "off-road")


@dataclass(frozen=True)
class Style:
    """Parameters of a kind of place; lengths in metres, densities as probabilities per opportunity.

    Attributes:
        kind: one of ``KINDS``.
        side: -1 where traffic keeps right, 1 where it keeps left.
        lanes: lanes a direction.
        lane: their width.
        median: half the width between the two directions.
        parking: width of a parking strip, 0 for none.
        pavement: width of the pavement, 0 for none.
        kerb: its height.
        setback: between pavement and building fronts.
        buildings: share of plots built on; ``storeys`` their range; ``building`` their type.
        parked, trees, bushes, thickets, furniture, people, fences: densities.
        trees_set: prototypes that grow here.
        traffic: mean gap between moving vehicles in a lane, 0 for none.
        speed: of the other lanes' traffic, metres a second.
        heavy: share of lorries and vans.
        rough: height of the bumps beside the road.
        road, walk, verge, field: materials.
    """

    kind: str
    side: int
    lanes: int
    lane: float
    median: float
    parking: float
    pavement: float
    kerb: float
    setback: float
    buildings: float
    storeys: tuple[int, int]
    building: str
    parked: float
    trees: float
    bushes: float
    thickets: float
    furniture: float
    people: float
    fences: float
    trees_set: tuple[str, ...]
    traffic: float
    speed: float
    heavy: float
    rough: float
    road: Material
    walk: Material
    verge: Material
    field: Material

    @property
    def edge(self) -> float:
        """Half the width of the carriageway with its parking strips."""
        return self.median + self.lanes * self.lane + self.parking

    @property
    def front(self) -> float:
        """Distance of the building fronts from the centre line."""
        return self.edge + self.pavement + self.setback

    def lane_center(self, lane: int, own: bool) -> float:
        """Lateral position of a lane (0 = innermost) of our direction or the other."""
        offset = self.median + (lane + 0.5) * self.lane
        return self.side * offset * (1 if own else -1)


def sample_style(atlas: Atlas, generator: Generator) -> Style:
    """Draw a kind of place and its parameters."""
    kind = str(generator.choice(KINDS, p=[0.34, 0.24, 0.14, 0.10, 0.08, 0.10]))
    uniform, tone = generator.uniform, float(generator.uniform(0.6, 1.25))

    def material(*groups: str, grey: float = 1.0) -> Material:
        value = grey * float(uniform(0.75, 1.25))
        return Material(atlas.pick(str(generator.choice(groups)), generator), (value, value, value))

    trees = ("broadleaf", "broadleaf", "conifer") if generator.random() < 0.8 else ("bare_tree", "conifer")
    wild = kind in ("park", "off-road")
    highway = kind == "highway"
    return Style(
        kind=kind,
        side=-1 if generator.random() < 0.75 else 1,
        lanes=int(generator.integers(2, 4))
        if highway
        else (2 if kind == "street" and generator.random() < 0.25 else 1),
        lane=float(uniform(1.4, 2.2)) if wild else float(uniform(2.8, 3.7)),
        median=float(uniform(0.8, 3.0)) if highway else 0.0,
        parking=float(uniform(2.0, 2.4)) if kind in ("street", "suburb") and generator.random() < 0.7 else 0.3,
        pavement=0.0 if highway or wild else float(uniform(1.3, 4.0)),
        kerb=0.0 if highway or wild else float(uniform(0.06, 0.16)),
        setback={
            "street": uniform(0.0, 3.0),
            "suburb": uniform(3.0, 9.0),
            "highway": uniform(12.0, 30.0),
            "industrial": uniform(3.0, 12.0),
            "park": uniform(12.0, 30.0),
            "off-road": 40.0,
        }[kind],
        buildings={
            "street": uniform(0.75, 1.0),
            "suburb": uniform(0.5, 0.9),
            "highway": uniform(0.0, 0.35),
            "industrial": uniform(0.4, 0.9),
            "park": uniform(0.0, 0.3),
            "off-road": 0.0,
        }[kind],
        storeys={"street": (2, 7), "suburb": (1, 3), "highway": (2, 8), "industrial": (2, 7)}.get(kind, (1, 3)),
        building={"street": "town_house", "suburb": "detached_house", "park": "detached_house"}.get(kind, "block"),
        parked={"street": uniform(0.2, 0.9), "suburb": uniform(0.1, 0.7), "industrial": uniform(0.1, 0.6)}.get(
            kind, 0.0
        ),
        trees={
            "street": uniform(0.0, 0.6),
            "suburb": uniform(0.2, 1.0),
            "highway": uniform(0.1, 1.0),
            "industrial": uniform(0.0, 0.5),
        }.get(kind, uniform(0.4, 1.0)),
        bushes=float(uniform(0.3, 1.0)) if wild else float(uniform(0.0, 0.5)),
        thickets={"street": 0.0, "suburb": 0.3, "industrial": 0.3}.get(kind, uniform(0.2, 1.0)),
        furniture={"street": uniform(0.4, 1.0), "off-road": 0.03}.get(kind, uniform(0.2, 0.7)),
        people={"street": uniform(0.1, 0.9), "suburb": uniform(0.0, 0.4), "park": uniform(0.1, 0.8)}.get(kind, 0.05),
        fences={"suburb": uniform(0.2, 0.9), "industrial": uniform(0.3, 0.9), "park": 0.2}.get(kind, 0.08),
        trees_set=trees,
        traffic=0.0 if wild else float(uniform(18.0, 60.0)),
        speed=float(uniform(20.0, 33.0)) if highway else float(uniform(6.0, 14.0)),
        heavy=float(uniform(0.15, 0.6)) if highway or kind == "industrial" else float(uniform(0.05, 0.25)),
        rough={"off-road": uniform(0.15, 0.7), "park": uniform(0.1, 0.4)}.get(kind, uniform(0.0, 0.25)),
        road=material("soil", "grass", "paving")
        if wild
        else material("asphalt", "asphalt", "asphalt", "concrete", grey=tone),
        walk=material("paving", "paving", "asphalt", "concrete"),
        verge=material("grass") if kind != "street" else material("paving", "grass", "asphalt"),
        field=material("grass", "grass", "soil")
        if kind not in ("street", "industrial")
        else material("asphalt", "grass", "concrete"),
    )
