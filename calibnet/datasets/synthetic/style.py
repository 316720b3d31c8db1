"""The style of a scene: widths, densities and materials, drawn once per scene."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.random import Generator

from calibnet.datasets.synthetic.mesh import Material
from calibnet.datasets.synthetic.textures import Atlas

KINDS = ("street", "suburb", "highway", "industrial", "park", "off-road")
_WILD = ("park", "off-road")


@dataclass(frozen=True)
class Style:
    """Parameters of a kind of place; lengths in metres.

    Attributes:
        kind: one of ``KINDS``.
        side: -1 where traffic keeps right, 1 where it keeps left.
        lanes: number of lanes per direction.
        lane: width of a lane.
        median: half the width between the two directions.
        parking: width of a parking strip, 0 for none.
        pavement: width of the pavement, 0 for none.
        kerb: height of the kerb.
        setback: distance between pavement and building fronts.
        buildings: share of plots built on.
        storeys: range of the number of storeys, the upper bound excluded.
        building: type of building.
        parked: share of parking slots taken.
        trees, bushes, furniture, people: densities, 0 (none) to 1.
        thickets: probability of a thicket along a side of a chunk.
        fences: share of plots fenced off.
        trees_set: names of the trees that grow here; frequent ones occur more than once.
        traffic: mean gap between moving vehicles in a lane, 0 for none.
        speed: speed of the traffic in other lanes, metres per second.
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
    def wild(self) -> bool:
        """Whether the road is a track or path through open land, without kerbs, markings or traffic."""
        return self.kind in _WILD

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


_OTHER = "other"
_RANGES: dict[str, dict[str, tuple[float, float] | float]] = {
    "setback": {
        "street": (0.0, 3.0),
        "suburb": (3.0, 9.0),
        "highway": (12.0, 30.0),
        "industrial": (3.0, 12.0),
        "park": (12.0, 30.0),
        "off-road": 40.0,
    },
    "buildings": {
        "street": (0.75, 1.0),
        "suburb": (0.5, 0.9),
        "highway": (0.0, 0.35),
        "industrial": (0.4, 0.9),
        "park": (0.0, 0.3),
        "off-road": 0.0,
    },
    "parked": {"street": (0.2, 0.9), "suburb": (0.1, 0.7), "industrial": (0.1, 0.6), _OTHER: 0.0},
    "trees": {
        "street": (0.0, 0.6),
        "suburb": (0.2, 1.0),
        "highway": (0.1, 1.0),
        "industrial": (0.0, 0.5),
        _OTHER: (0.4, 1.0),
    },
    "thickets": {"street": 0.0, "suburb": 0.3, "industrial": 0.3, _OTHER: (0.2, 1.0)},
    "furniture": {"street": (0.4, 1.0), "off-road": 0.03, _OTHER: (0.2, 0.7)},
    "people": {"street": (0.1, 0.9), "suburb": (0.0, 0.4), "park": (0.1, 0.8), _OTHER: 0.05},
    "fences": {"suburb": (0.2, 0.9), "industrial": (0.3, 0.9), "park": 0.2, _OTHER: 0.08},
    "rough": {"off-road": (0.15, 0.7), "park": (0.1, 0.4), _OTHER: (0.0, 0.25)},
}
"""Parameters by kind of place: a value, or the range that it is drawn from."""
_STOREYS = {"street": (2, 7), "suburb": (1, 3), "highway": (2, 8), "industrial": (2, 7)}
_BUILDING = {"street": "town_house", "suburb": "detached_house", "park": "detached_house"}


def sample_style(atlas: Atlas, generator: Generator) -> Style:
    """Draw a kind of place and its parameters."""
    kind = str(generator.choice(KINDS, p=[0.34, 0.24, 0.14, 0.10, 0.08, 0.10]))
    tone = float(generator.uniform(0.6, 1.25))
    trees = ("broadleaf", "broadleaf", "conifer") if generator.random() < 0.8 else ("bare_tree", "conifer")
    wild, highway, city = kind in _WILD, kind == "highway", kind in ("street", "industrial")
    road = ("soil", "grass", "paving") if wild else ("asphalt", "asphalt", "asphalt", "concrete")
    verge = ("paving", "grass", "asphalt") if kind == "street" else ("grass",)
    field = ("asphalt", "grass", "concrete") if city else ("grass", "grass", "soil")

    def uniform(low: float, high: float) -> float:
        return float(generator.uniform(low, high))

    def of_kind(parameter: str) -> float:
        """Draw for every kind and keep this one's: a seed's scene depends on how many numbers are drawn."""
        values = {of: uniform(*v) if isinstance(v, tuple) else v for of, v in _RANGES[parameter].items()}
        return values[kind if kind in values else _OTHER]

    def lanes() -> int:
        if highway:
            return int(generator.integers(2, 4))
        return 2 if kind == "street" and generator.random() < 0.25 else 1

    def material(*groups: str, grey: float = 1.0) -> Material:
        value = grey * uniform(0.75, 1.25)
        return Material(atlas.pick(str(generator.choice(groups)), generator), (value, value, value))

    return Style(  # the order of the arguments is that of the draws
        kind=kind,
        side=-1 if generator.random() < 0.75 else 1,
        lanes=lanes(),
        lane=uniform(1.4, 2.2) if wild else uniform(2.8, 3.7),
        median=uniform(0.8, 3.0) if highway else 0.0,
        parking=uniform(2.0, 2.4) if kind in ("street", "suburb") and generator.random() < 0.7 else 0.3,
        pavement=0.0 if highway or wild else uniform(1.3, 4.0),
        kerb=0.0 if highway or wild else uniform(0.06, 0.16),
        setback=of_kind("setback"),
        buildings=of_kind("buildings"),
        storeys=_STOREYS.get(kind, (1, 3)),
        building=_BUILDING.get(kind, "block"),
        parked=of_kind("parked"),
        trees=of_kind("trees"),
        bushes=uniform(0.3, 1.0) if wild else uniform(0.0, 0.5),
        thickets=of_kind("thickets"),
        furniture=of_kind("furniture"),
        people=of_kind("people"),
        fences=of_kind("fences"),
        trees_set=trees,
        traffic=0.0 if wild else uniform(18.0, 60.0),
        speed=uniform(20.0, 33.0) if highway else uniform(6.0, 14.0),
        heavy=uniform(0.15, 0.6) if highway or kind == "industrial" else uniform(0.05, 0.25),
        rough=of_kind("rough"),
        road=material(*road, grey=1.0 if wild else tone),
        walk=material("paving", "paving", "asphalt", "concrete"),
        verge=material(*verge),
        field=material(*field),
    )
