"""The drives a verdict is fitted to: which frames they have, and which sequences they are parts of."""

from __future__ import annotations

import numpy as np

from calibnet.cascade import Cascade, Stage
from calibnet.evaluation.verdict_drives import MOST, DriveStream, part
from calibnet.geometry import RANGES
from calibnet.judging.drive import FEWEST_JUDGED
from tests.support.scene import Scenes
from tests.support.tiny import tiny_network


def test_a_part_has_enough_frames_in_their_order_and_all_lengths_come() -> None:
    generator = np.random.default_rng(0)
    parts = [part(40, generator) for _ in range(300)]
    assert all(np.all(np.diff(one) > 0) and one[0] >= 0 and one[-1] < 40 for one in parts)
    assert {len(one) for one in parts} == set(range(FEWEST_JUDGED, MOST + 1))
    assert len({tuple(one) for one in parts}) > 270, "hardly any two are alike"
    assert part(FEWEST_JUDGED, generator) == list(range(FEWEST_JUDGED)), "of few frames all"


def test_short_sequences_are_left_out_and_cameras_of_one_recording_count_once() -> None:
    def scenes(name: str, length: int) -> Scenes:
        sequence = Scenes(length)
        sequence.name = name
        return sequence

    drives = [scenes("a", 12), scenes("a", 12), scenes("b", 4), scenes("c", FEWEST_JUDGED - 1)]
    stream = DriveStream(Cascade([Stage(5, RANGES[4], tiny_network(seed=5, stage=5))]), drives, 0)
    assert [sequence.name for sequence in stream.sequences] == ["a", "a", "b"]
    np.testing.assert_allclose(stream.odds, np.array([4, 4, 4]) / 12)
