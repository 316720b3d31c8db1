"""What weights were trained on, by the names that datasets give to rigs."""

from __future__ import annotations

import pytest

from calibnet.geometry import RANGES
from calibnet.methods.card import MethodCard
from calibnet.weights import read_record, weights_path


@pytest.mark.parametrize(
    ("rig", "known"),
    [
        ("kitti360-image00", True),
        ("KITTI-360, camera 0", True),
        ("KITTI-360, camera 1", False),
        ("nuscenes-n015a-front", True),
        ("nuScenes, CAM_FRONT", True),
        ("ircv-car", True),
        ("ircv-car2", False),
        ("KITTI 2011_09_26, camera 2", True),
        ("KITTI 2011_09_30, camera 2", False),
        ("KITTI object detection, camera 2", True),
        ("usl-garage-vlp32-left", False),
    ],
)
def test_weights_that_ship_know_the_rigs_of_their_records(rig: str, known: bool) -> None:
    for range_ in RANGES:
        card = MethodCard.trained(0, 0, [read_record(weights_path("compact", range_))])
        assert card.knows(rig) == known, range_
        assert not any("/" in name for name in card.trained_on), "they are names of rigs"


def test_a_rig_that_a_record_names_whole_is_known_by_its_name() -> None:
    card = MethodCard.trained(0, 0, [{"rigs": ["KITTI 2011_09_30, camera 2", "robot"]}])
    assert card.knows("KITTI 2011_09_30, camera 2") and card.knows("robot")
    assert not card.knows("KITTI 2011_09_30, camera 3") and not card.knows("robot-b")


def test_drives_of_kitti_raw_are_of_their_days_rig() -> None:
    card = MethodCard.trained(0, 0, [{"rigs": ["kitti-raw/2011_09_26_drive_0002", "kitti-raw/2011_09_26_drive_0051"]}])
    assert card.trained_on == ("KITTI 2011_09_26",)
