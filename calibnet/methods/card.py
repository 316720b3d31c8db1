"""What a method costs and what it was trained on, as tables of methods state it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

_RENAMED = {"kitti-object/train": "KITTI object detection"}
"""Names that older training records give to rigs, and the names that datasets give them."""


@dataclass(frozen=True)
class MethodCard:
    """What a method costs and what it was trained on, for tables.

    Attributes:
        parameters: of its networks, of all stages that run; 0 without networks.
        multiply_adds: of its networks for one frame, likewise.
        samples_trained: that its networks have seen, all stages together.
        trained_on: the rigs of these, as `Sequence.rig` begins, for instance ``("KITTI 2011_09_26",)``.
    """

    parameters: int = 0
    multiply_adds: int = 0
    samples_trained: int = 0
    trained_on: tuple[str, ...] = ()

    @classmethod
    def trained(cls, parameters: int, multiply_adds: int, records: Iterable[Mapping[str, Any]]) -> MethodCard:
        """The card of trained networks.

        Args:
            parameters: of all networks together.
            multiply_adds: of all networks together, for one frame.
            records: training records of the networks, as `calibnet.weights.read_record` reads them.
        """
        records = list(records)
        rigs = (_RENAMED.get(rig, rig) for record in records for rig in record.get("rigs", ()))
        samples = sum(int(record.get("samples", 0)) for record in records)
        return cls(parameters, multiply_adds, samples, tuple(dict.fromkeys(rigs)))

    def knows(self, rig: str) -> bool:
        """Whether it was trained on a rig."""
        return any(rig.startswith(one) for one in self.trained_on)


@runtime_checkable
class Described(Protocol):
    """A method that says what it costs; one that does not is taken to have no networks."""

    @property
    def card(self) -> MethodCard:
        """Its costs."""
        ...


def card_of(calibrator: object) -> MethodCard:
    """What a method costs."""
    return calibrator.card if isinstance(calibrator, Described) else MethodCard()
