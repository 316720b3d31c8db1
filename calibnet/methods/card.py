"""What a method costs and what it was trained on, as tables of methods state it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

_FOLDER = "folder/"
"""Records of weights that were trained on packed frames name a rig by its sequence; a folder's begins with this."""
_AS_DATASETS_SAY = {
    "kitti-object/train": "KITTI object detection",
    "folder/kitti360-image00": "KITTI-360, camera 0",
    "folder/nuscenes-n015a-front": "nuScenes, CAM_FRONT",
    "folder/nuscenes-n015a-front-left": "nuScenes, CAM_FRONT_LEFT",
    "folder/nuscenes-n015a-front-right": "nuScenes, CAM_FRONT_RIGHT",
    "folder/nuscenes-n015a-back": "nuScenes, CAM_BACK",
    "folder/nuscenes-n015a-back-left": "nuScenes, CAM_BACK_LEFT",
    "folder/nuscenes-n015a-back-right": "nuScenes, CAM_BACK_RIGHT",
}
"""What such records name, and the rig as the dataset names it that these frames are from."""


@dataclass(frozen=True)
class MethodCard:
    """What a method costs and what it was trained on, for tables.

    Attributes:
        parameters: of its networks, of all stages that run; 0 without networks.
        multiply_adds: of its networks for one frame, likewise.
        samples_trained: that its networks have seen, all stages together.
        trained_on: the rigs of these, `Sequence.rig`, with or without the camera: ``("KITTI 2011_09_26",)``.
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
        rigs = (rig for record in records for said in record.get("rigs", ()) for rig in _rigs(said))
        samples = sum(int(record.get("samples", 0)) for record in records)
        return cls(parameters, multiply_adds, samples, tuple(dict.fromkeys(rigs)))

    def knows(self, rig: str) -> bool:
        """Whether it was trained on a rig, `Sequence.rig`; a record may leave the camera out."""
        return any(rig == known or rig.startswith(f"{known}, ") for known in self.trained_on)


def _rigs(said: str) -> list[str]:
    """The names that datasets give to a rig of a record: of a folder its own, and that of the dataset it is from."""
    folder, dataset = said.removeprefix(_FOLDER), _AS_DATASETS_SAY.get(said)
    if dataset is None:
        return [folder]
    return [folder, dataset] if folder != said else [dataset]


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
