"""The target of tabs: a stream of Rerun and the prefix of one calibration's entities."""

from __future__ import annotations

from collections.abc import Iterable
from weakref import WeakKeyDictionary

import rerun as rr

from inspector import entities

Components = rr.AsComponents | Iterable[rr.DescribedComponentBatch]

_SAID_ONCE: WeakKeyDictionary[rr.RecordingStream, set[str]] = WeakKeyDictionary()
"""Paths of the static entities of each stream; Rerun would write each again whenever it is logged."""


class Subtree:
    """The entities of a stream below a prefix, or all of them if the prefix is empty.

    It neither opens nor closes the stream. Entities are named as in `inspector.entities`, without the prefix.
    """

    def __init__(self, stream: rr.RecordingStream, prefix: str = "") -> None:
        """Log below ``prefix``, an entity path in Rerun's notation."""
        self._stream = stream
        self._prefix = prefix
        self._said_once = _SAID_ONCE.setdefault(stream, set())

    def path(self, entity: str) -> str:
        """The full path of an entity."""
        return below(self._prefix, entity)

    def log(self, entity: str, *components: Components) -> None:
        """Log components of an entity at the current time."""
        self._stream.log(self.path(entity), *components)

    def log_once(self, entity: str, *components: Components) -> None:
        """Log static data; does nothing if the stream has it already, since several tabs may share a legend."""
        path = self.path(entity)
        if path not in self._said_once:
            self._said_once.add(path)
            self._stream.log(path, *components, static=True)

    def log_for_all(self, entity: str, *components: Components) -> None:
        """Log static data, replacing earlier static data of the entity."""
        self._stream.log(self.path(entity), *components, static=True)

    def set_frame(self, index: int, seconds: float) -> None:
        """Set all timelines to a frame, before its first stage."""
        self._stream.set_time(entities.FRAME, sequence=index)
        self._stream.set_time(entities.TIME, duration=seconds)
        self.set_step(index, 0)

    def set_step(self, index: int, stage: int) -> None:
        """Set only the timeline `entities.STEP`, to a stage of a frame; 0 is before the first."""
        self._stream.set_time(entities.STEP, sequence=index * entities.STEPS_PER_FRAME + stage)


class Timeless(Subtree):
    """The same entities, but logs everything as static data, which replaces earlier static data."""

    def __init__(self, rec: Subtree) -> None:
        """Log to the same stream and prefix as ``rec``."""
        super().__init__(rec._stream, rec._prefix)

    def log(self, entity: str, *components: Components) -> None:
        """Log static data."""
        self.log_for_all(entity, *components)


def below(prefix: str, entity: str) -> str:
    """An entity's path below a prefix, or the entity itself without one."""
    prefix = prefix.strip("/")
    return f"{prefix}/{entity.lstrip('/')}" if prefix else entity
