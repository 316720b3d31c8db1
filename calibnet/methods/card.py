"""The card of a method: its cost and its training data, for tables of methods."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

_FOLDER = "folder/"
"""Prefix of a folder's sequence: records of weights trained on packed frames name rigs by their sequences."""
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
"""Rigs by the sequences in such records, as the datasets of these frames name them."""
_RAW_DRIVE = re.compile(r"kitti-raw/(\d{4}_\d\d_\d\d)_drive_\d+")
"""A drive of KITTI raw in such records; all drives of a day are of one rig."""


@dataclass(frozen=True)
class MethodCard:
    """The cost of a method, and what it was trained on.

    Attributes:
        parameters: number of parameters of the networks of all stages that run; 0 without networks.
        multiply_adds: multiply-adds of these networks for one frame.
        samples_trained: number of samples that all stages together were trained on.
        trained_on: rigs of these samples (`Sequence.rig`), with or without the camera: ``("KITTI 2011_09_26",)``.
    """

    parameters: int = 0
    multiply_adds: int = 0
    samples_trained: int = 0
    trained_on: tuple[str, ...] = ()

    @classmethod
    def trained(cls, parameters: int, multiply_adds: int, records: Iterable[Mapping[str, Any]]) -> MethodCard:
        """The card of trained networks.

        Args:
            parameters: parameters of all networks together.
            multiply_adds: multiply-adds of all networks together, for one frame.
            records: training records of the networks, see `calibnet.weights.read_record`.
        """
        records = list(records)
        rigs = (rig for record in records for said in record.get("rigs", ()) for rig in _rigs(said))
        samples = sum(int(record.get("samples", 0)) for record in records)
        return cls(parameters, multiply_adds, samples, tuple(dict.fromkeys(rigs)))

    def knows(self, rig: str) -> bool:
        """Whether the method was trained on a rig (`Sequence.rig`); records may leave out the camera."""
        return any(rig == known or rig.startswith(f"{known}, ") for known in self.trained_on)


def _rigs(said: str) -> list[str]:
    """The names of a rig in a record: for a folder, its own name and that of the dataset it was made from."""
    if drive := _RAW_DRIVE.fullmatch(said):
        return [f"KITTI {drive[1]}"]
    folder, dataset = said.removeprefix(_FOLDER), _AS_DATASETS_SAY.get(said)
    if dataset is None:
        return [folder]
    return [folder, dataset] if folder != said else [dataset]


@runtime_checkable
class Described(Protocol):
    """A method with a card; one without is taken to have no networks."""

    @property
    def card(self) -> MethodCard:
        """The card of this method."""
        ...


def card_of(calibrator: object) -> MethodCard:
    """The card of a method; an empty one if it has none."""
    return calibrator.card if isinstance(calibrator, Described) else MethodCard()
