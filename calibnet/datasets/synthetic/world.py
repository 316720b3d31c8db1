"""The synthetic driving world: the triangles of a scene, populated in chunks, with moving traffic."""

from __future__ import annotations

from collections import OrderedDict

from calibnet.datasets.synthetic.mesh import Mesh, concatenate
from calibnet.datasets.synthetic.population import CHUNK, populate
from calibnet.datasets.synthetic.scene import Scene
from calibnet.datasets.synthetic.surroundings import horizon, moving_traffic
from calibnet.datasets.synthetic.weather import Weather
from calibnet.geometry.types import Transform

_KEPT = 24
"""Largest number of chunks in memory, so that a drive of any length fits."""


class World:
    """Everything in a scene, static and moving. Chunks of road are populated when they are first needed."""

    def __init__(self, scene: Scene) -> None:
        """Start with nothing populated."""
        self.scene = scene
        self._chunks: OrderedDict[tuple[int, bool], Mesh] = OrderedDict()

    @property
    def weather(self) -> Weather:
        """The scene's light."""
        return self.scene.weather

    def mesh(self, world_from_vehicle: Transform, time: float, behind: float = 100.0, ahead: float = 120.0) -> Mesh:
        """Everything around a vehicle, as triangles in the world.

        Args:
            world_from_vehicle: pose of the vehicle, 4x4.
            time: time in seconds, which moves the traffic.
            behind: length of road behind the vehicle, metres.
            ahead: length of road ahead of it, metres.
        """
        position = world_from_vehicle[:3, 3]
        station = self.scene.line.nearest_station(position)
        first, last = int((station - behind) // CHUNK), int((station + ahead) // CHUNK)
        here = int(station // CHUNK)
        close = range(here - (behind > CHUNK), here + (ahead > CHUNK) + 1)
        parts = [self._chunk(index, index in close) for index in range(first, last + 1)]
        parts += moving_traffic(self.scene, station, time, behind, ahead, position)
        parts.append(horizon(self.scene, position))
        return concatenate(parts)

    def _chunk(self, index: int, near: bool) -> Mesh:
        key = (index, near)
        if key not in self._chunks:
            self._chunks[key] = populate(self.scene, index, near)
            while len(self._chunks) > _KEPT:
                self._chunks.popitem(last=False)
        return self._chunks[key]
