"""Fills a chunk of road with ground, buildings, parked cars, furniture, plants and people."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from calibnet.datasets.synthetic import buildings, library
from calibnet.datasets.synthetic.ground import cross_section, markings
from calibnet.datasets.synthetic.mesh import Mesh, concatenate
from calibnet.datasets.synthetic.textures import atlas

if TYPE_CHECKING:
    from calibnet.datasets.synthetic.world import Scene

Generator = np.random.Generator
CHUNK = 20.0
"""Metres of road that are populated together."""
_BUILDERS = {
    "town_house": buildings.town_house,
    "detached_house": buildings.detached_house,
    "block": buildings.block,
}
_CAR_COLOURS = np.array(
    [
        [0.75, 0.75, 0.76],
        [0.62, 0.62, 0.62],
        [0.38, 0.40, 0.42],
        [0.20, 0.21, 0.23],
        [0.10, 0.105, 0.11],
        [0.02, 0.02, 0.025],
        [0.02, 0.02, 0.022],
        [0.90, 0.90, 0.90],
        [0.02, 0.04, 0.14],
        [0.06, 0.14, 0.35],
        [0.35, 0.02, 0.02],
        [0.14, 0.01, 0.02],
        [0.04, 0.10, 0.06],
        [0.30, 0.25, 0.18],
        [0.65, 0.48, 0.03],
    ]
)


def car_colour(generator: Generator) -> np.ndarray:
    """Linear RGB of a car's paint, as frequent as on the road."""
    return np.asarray(_CAR_COLOURS[int(generator.integers(len(_CAR_COLOURS)))] * generator.uniform(0.7, 1.2))


def vehicle(kind: str, generator: Generator) -> tuple[Mesh, np.ndarray]:
    """A vehicle's prototype and colour."""
    return library.pick(kind, generator), car_colour(generator)


def populate(scene: Scene, index: int, near: bool) -> Mesh:
    """Everything that stands still between two stations; the same for the same scene and index.

    Chunks that are not ``near`` have plants of fewer leaves, in the same places.
    """
    generator = np.random.default_rng([scene.seed, index + 10_000])
    start, stop = index * CHUNK, (index + 1) * CHUNK
    parts = [*cross_section(scene, start, stop), *markings(scene, generator, start, stop)]
    for side in (-1.0, 1.0):
        parts += _plots(scene, generator, start, stop, side, near)
        parts += _roadside(scene, generator, start, stop, side)
        parts += _nature(scene, generator, start, stop, side, near)
    if scene.style.kind == "highway":
        parts += _motorway(scene, generator, start, stop)
    return concatenate(parts)


def _stand(
    scene: Scene,
    mesh: Mesh,
    station: float,
    lateral: float,
    turn: float = 0.0,
    lift: float = 0.0,
    scale: object = 1.0,
    colour: object = None,
) -> Mesh:
    """Place a prototype on the ground at a station; ``turn`` is relative to the road's direction."""
    position, heading = scene.line.stand(float(station), float(lateral), lift + scene.lift(lateral))
    position[2] += scene.relief.height(position, lateral)
    return mesh.placed(position, heading + turn, scale, colour)  # type: ignore[arg-type]


def _plots(scene: Scene, generator: Generator, start: float, stop: float, side: float, near: bool) -> list[Mesh]:
    style = scene.style
    parts: list[Mesh] = []
    if generator.random() < 0.06 and style.kind in ("street", "suburb", "industrial"):
        return parts  # a side street
    pieces = 1 if style.building == "block" or generator.random() < 0.45 else 2
    width = (stop - start) / pieces
    for piece in range(pieces):
        station = start + (piece + 0.5) * width
        fence = generator.random() < style.fences and style.setback > 2.0
        if fence:
            shape = (
                library.pick(scene.fence_kind, generator, near) if scene.fence_kind != "fence" else scene.fence(side)
            )
            lateral = side * max(style.edge + style.pavement + 0.4, 5.0)
            parts += [
                _stand(scene, shape, s, lateral, colour=scene.leaf_colour)
                for s in np.arange(station - 0.5 * width + 2.0, station + 0.5 * width, 4.0)
            ]
        if generator.random() >= style.buildings:
            continue
        gap = 0.0 if style.building == "town_house" and generator.random() < 0.8 else generator.uniform(1.0, 5.0)
        if style.building == "detached_house":
            gap = generator.uniform(0.15, 0.4) * width
        builder = _BUILDERS[style.building]
        house = builder(atlas(), generator, max(width - gap, 5.0), int(generator.integers(*style.storeys)))
        lateral = side * (style.front + generator.uniform(0.0, 0.6 if style.kind == "street" else 4.0))
        turn = 0.0 if side > 0 else np.pi
        turn += generator.normal(0.0, 0.0 if style.kind == "street" else 0.05)
        parts.append(_stand(scene, house, station, lateral, turn, -0.3))
    return parts


def _roadside(scene: Scene, generator: Generator, start: float, stop: float, side: float) -> list[Mesh]:
    style = scene.style
    parts: list[Mesh] = []
    if style.parked:
        lateral = side * (style.edge - 0.5 * max(style.parking, 2.0) + (0.0 if style.parking > 1.0 else 0.9))
        if style.parking > 1.0 or scene.park_on_pavement:
            for slot in np.arange(start + 3.0, stop - 2.0, 6.2):
                if generator.random() < style.parked:
                    mesh, colour = vehicle("van" if generator.random() < 0.12 else "car", generator)
                    turn = (0.0 if generator.random() < 0.8 else np.pi) + (0.0 if side == style.side else np.pi)
                    spot = lateral + generator.normal(0.0, 0.08)
                    parts.append(
                        _stand(
                            scene,
                            mesh,
                            slot + generator.uniform(-0.4, 0.4),
                            spot,
                            turn + generator.normal(0.0, 0.02),
                            -scene.lift(spot) - 0.03,
                            colour=colour,
                        )
                    )
    walk = style.edge + (0.5 if style.pavement else 1.5)
    facing = 0.0 if side == style.side else np.pi
    for name, share, distance in (
        ("lamp_post", 0.5, 0.0),
        ("sign", 0.55, 0.1),
        ("pole", 0.15, 0.3),
        ("bollard", 0.25, 0.0),
        ("bin", 0.3, 1.0),
        ("traffic_light", 0.12, 0.1),
        ("billboard", 0.08, 2.0),
        ("bench", 0.08, 1.2),
        ("bicycle", 0.2, 1.0),
    ):
        if generator.random() < share * style.furniture:
            turn = facing + generator.normal(0.0, 0.15)
            if name == "lamp_post":
                turn = -side * np.pi / 2
            if name in ("bin", "bicycle", "bench"):
                turn = generator.uniform(0.0, 2.0 * np.pi)
            count = int(generator.integers(2, 7)) if name == "bollard" else 1
            station, shape = generator.uniform(start, stop), library.pick(name, generator)
            colour = generator.uniform(0.05, 0.8, 3)
            lateral = side * (walk + distance * generator.uniform(0.5, 1.2))
            parts += [_stand(scene, shape, station + 1.6 * i, lateral, turn, colour=colour) for i in range(count)]
    for _ in range(int(generator.poisson(2.0 * style.people))):
        lateral = side * (style.edge + generator.uniform(0.4, max(style.pavement, 1.5)))
        if generator.random() < 0.12:
            lateral = side * generator.uniform(0.6, 1.0) * style.edge
        figure, shirt = library.pick("person", generator), 0.7 * generator.uniform(0.1, 1.0, 3) ** 2
        parts.append(
            _stand(scene, figure, generator.uniform(start, stop), lateral, generator.uniform(0, 6.3), colour=shirt)
        )
    if generator.random() < 0.4 * style.people:
        lateral = side * (style.edge - max(style.parking, 0.6) - 0.3)
        turn = 0.0 if side == style.side else np.pi
        shirt, shape = generator.uniform(0.02, 0.8, 3), library.pick("cyclist", generator)
        parts.append(_stand(scene, shape, generator.uniform(start, stop), lateral, turn, colour=shirt))
    return parts


def _nature(scene: Scene, generator: Generator, start: float, stop: float, side: float, near: bool) -> list[Mesh]:
    style = scene.style
    parts: list[Mesh] = []
    verge = style.edge + style.pavement if style.kind != "street" else style.edge + 0.8
    wild = style.kind in ("off-road", "park")

    def grow(name: str, station: float, lateral: float, turn: float, size: object = 1.0) -> None:
        colour = scene.leaf_colour * generator.uniform(0.7, 1.3) * generator.uniform(0.88, 1.12, 3)
        shape = library.pick(name, generator, near)
        parts.append(_stand(scene, shape, station, lateral, turn, -0.05, size, colour))

    def scatter(name: str, count: float, low: float, high: float, sizes: tuple[float, float]) -> None:
        for _ in range(int(generator.poisson(count))):
            lateral = side * (low + (high - low) * generator.random() ** 1.5)
            size = generator.uniform(*sizes) * np.array([1.0, 1.0, generator.uniform(0.85, 1.2)])
            grow(name, generator.uniform(start, stop), lateral, generator.uniform(0.0, 2.0 * np.pi), size)

    def tree() -> str:
        return style.trees_set[int(generator.integers(len(style.trees_set)))]

    spread = 0.3 if style.kind == "street" else max(style.setback - 1.0, 1.0)
    scatter(tree(), 1.6 * style.trees, verge + 0.8, verge + 0.8 + spread, (0.6, 1.2))
    if style.kind != "street":
        far = style.front + (18.0 if style.buildings > 0.4 else 2.0)
        for _ in range(2):
            scatter(tree(), (0.8 if style.buildings > 0.4 else 1.5) * style.trees, far, far + 25.0, (0.9, 1.7))
    elif generator.random() < 0.3 * style.trees:
        scatter(tree(), 1.0, style.front + 2.0, style.front + 12.0, (0.8, 1.4))
    scatter("bush", (4.0 if wild else 1.5) * style.bushes, verge + 1.0, verge + (14.0 if wild else 5.0), (0.5, 1.4))
    room = style.setback if style.buildings > 0.4 else 12.0
    if room > 4.0 and generator.random() < style.thickets:
        lateral = side * (max(verge + 2.0, 6.0) + generator.uniform(0.0, min(room - 2.0, 5.0)))
        for station in (start + 5.0, stop - 5.0):
            grow("thicket", station, lateral, generator.normal(0.0, 0.1), generator.uniform(0.7, 1.2))
    if wild or style.verge.texture in atlas().groups["grass"]:
        scatter("tuft", (10.0 if wild else 3.0) * style.bushes, verge + 0.3, verge + 9.0, (0.5, 1.6))
    if style.kind == "off-road":
        scatter("rock", 1.0, verge + 0.3, verge + 14.0, (0.5, 1.6))
    return parts


def _motorway(scene: Scene, generator: Generator, start: float, stop: float) -> list[Mesh]:
    style = scene.style
    parts: list[Mesh] = []
    rail = scene.rail
    for station in np.arange(start + 2.0, stop, 4.0):
        parts.append(_stand(scene, rail, station, 0.0))
        if scene.outer_rails:
            parts += [_stand(scene, rail, station, side * (style.edge + 1.0)) for side in (-1.0, 1.0)]
    if generator.random() < 0.12:
        name = "gantry" if generator.random() < 0.6 else "bridge"
        parts.append(_stand(scene, library.pick(name, generator), 0.5 * (start + stop), 0.0))
    return parts
