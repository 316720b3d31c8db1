"""Surroundings outside the chunks: moving traffic, and the land and skyline beyond the populated road."""

from __future__ import annotations

import numpy as np

from calibnet.datasets.synthetic.library import pick_vehicle
from calibnet.datasets.synthetic.mesh import Material, Mesh, concatenate, quads
from calibnet.datasets.synthetic.scene import Scene
from calibnet.datasets.synthetic.textures import atlas
from calibnet.geometry.types import Vector3

EGO_SPEED = 10.0
"""Speed of the ego vehicle, metres per second: one metre per frame at 10 Hz."""


def moving_traffic(scene: Scene, station: float, time: float, behind: float, ahead: float, ego: Vector3) -> list[Mesh]:
    """Moving vehicles: every lane is an endless queue on a jittered grid that moves at one speed.

    Args:
        scene: the place.
        station: station of the ego vehicle, metres.
        time: time in seconds.
        behind: length of road behind the ego vehicle, metres.
        ahead: length of road ahead of it, metres.
        ego: ``[3]`` position of the ego vehicle, which other vehicles keep away from.
    """
    style = scene.style
    parts: list[Mesh] = []
    if not style.traffic:
        return parts
    for own in (True, False):
        for lane in range(style.lanes):
            our_lane = own and lane == 0
            speed = EGO_SPEED if our_lane else style.speed * (1.0 + 0.15 * lane)
            travelled = (speed if own else -speed) * time
            gap = style.traffic * (1.5 if our_lane else 1.0)
            first = int((station - behind - travelled) // gap)
            for number in range(first, int((station + ahead - travelled) // gap) + 1):
                generator = np.random.default_rng([scene.seed, 7, int(own), lane, number + 1_000_000])
                place = travelled + gap * (number + generator.uniform(0.15, 0.85))
                heavy = generator.random() < style.heavy
                kind = "lorry" if heavy and generator.random() < 0.5 else "van" if heavy else "car"
                mesh, colour = pick_vehicle(kind, generator)
                lateral = style.lane_center(lane, own) + generator.normal(0.0, 0.15)
                position, heading = scene.line.stand(place, lateral, 0.0)
                distance = float(np.linalg.norm(position - ego))
                clear = 9.0 if our_lane else 4.5
                if distance < clear + (6.0 if kind == "lorry" else 0.0):
                    continue
                turn = heading + (0.0 if own else np.pi)
                parts.append(mesh.placed(position - (0, 0, 0.02), turn, 1.0, colour))
    return parts


def horizon(scene: Scene, ego: Vector3) -> Mesh:
    """Distant land and a skyline around the vehicle, beyond any LiDAR's reach."""
    generator = np.random.default_rng([scene.seed, 3])
    groups = ("leaves", "facade", "soil") if scene.style.kind in ("street", "industrial") else ("leaves", "grass")
    parts = []
    for radius, low, high in ((190.0, 2.0, 14.0), (420.0, 6.0, 45.0)):
        count = 180
        angle = np.linspace(0.0, 2.0 * np.pi, count + 1)
        height = generator.uniform(low, high) * (0.6 + 0.4 * np.sin(3.0 * angle[:-1] + generator.uniform(0, 6)))
        height = height * generator.uniform(0.6, 1.2, count)
        ring = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(count + 1, -12.0)], 1) + ego
        top = ring + np.stack([np.zeros(count + 1), np.zeros(count + 1), 12.0 + np.append(height, height[0])], 1)
        flat = generator.random() < 0.5  # steps, as roofs, or slopes, as trees and hills
        right = np.column_stack([top[1:, :2], top[:-1, 2]]) if flat else top[1:]
        corners = np.stack([ring[:-1], ring[1:], right, top[:-1]], axis=1)
        u = np.stack([angle[:-1], angle[1:], angle[1:], angle[:-1]], 1) * radius
        uv = np.stack([u, corners[..., 2] * -1.0], axis=-1) * 0.5
        parts.append(
            quads(corners, uv, Material(atlas().pick(str(generator.choice(groups)), generator), (0.6, 0.6, 0.6)))
        )
    plain = np.array([[[-450, -450, -6], [450, -450, -6], [450, 450, -6], [-450, 450, -6]]]) + ego
    parts.append(quads(plain, plain[..., :2] - ego[:2], scene.style.field))
    return concatenate(parts)
