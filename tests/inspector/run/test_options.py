"""What a user asks of a run: what contradicts itself is refused, the rest is passed on as it was meant."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from calibnet.errors import DatasetError
from calibnet.geometry import MiscalibrationRange
from calibnet.geometry.prior import Prior
from inspector.record.contents import Coloring, Detail, Part
from inspector.run.options import OptionsError, RunOptions
from tests.support.drive import Drive

RANGE = MiscalibrationRange(2, 0.2)
SEQUENCE = Drive([4, 5, 6])


def asked(**options: Any) -> RunOptions:
    return RunOptions(sequence=SEQUENCE, **options)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"range": RANGE, "miscalibration": np.eye(4)}, "Give --range or --miscalibrate, not both."),
        ({"miscalibration": np.eye(4), "per_frame": True}, "--per-frame draws from --range"),
        ({"drive": True, "per_frame": True}, "--drive needs one mount for all frames"),
        ({"as_is": True, "color": Coloring.ERROR}, "test/drive has none; give --range or --miscalibrate"),
        ({"detail": Detail.CUSTOM}, "give both or neither"),
        ({"detail": Detail.FULL, "parts": frozenset({Part.SCENE})}, "give both or neither"),
    ],
)
def test_options_that_contradict_each_other(options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(OptionsError) as refused:
        asked(**options)
    assert sentence in str(refused.value)


def test_nothing_asked_is_a_run_of_everything_within_five_degrees() -> None:
    options = asked()
    assert options.positions == [0, 1, 2]
    assert (options.start.range, options.start.stages) == (MiscalibrationRange(5, 0.5), (3, 4, 5))
    assert options.contents.parts == frozenset(Part) and options.contents.dense
    assert options.title == "test/drive, miscalibrated within 5/0.5, seed 0"


def test_what_is_asked_arrives() -> None:
    options = asked(frames="1:", range=RANGE, per_frame=True, seed=3, parts=frozenset({Part.SCENE, Part.CURVES}))
    assert options.positions == [1, 2]
    assert str(options.start) == "miscalibrated within 2/0.2, anew in every frame, seed 3"
    assert options.contents.parts == {Part.SCENE, Part.CURVES}
    assert str(asked(as_is=True).start) == "from the calibration as it is"
    assert str(asked(miscalibration=np.eye(4)).start) == "miscalibrated as given"
    assert not asked(detail=Detail.OVERVIEW).contents.dense


def test_what_is_known_is_asked_for_or_said_by_the_data(monkeypatch: pytest.MonkeyPatch) -> None:
    assert not asked().prior and "known" not in asked().identity([5])
    options = asked(fix=("x", "y", "z"), prior_rotation=0.01)
    assert options.prior.words == "known to 0.573°; x, y, z fixed"
    assert options.identity([5])["known"] == options.prior.words
    monkeypatch.setattr(SEQUENCE, "prior", Prior.of(["roll"]), raising=False)
    assert asked().prior.words == "roll fixed"
    assert asked(prior_translation=0.02).prior.words == "known to 2 cm", "what is asked for goes before"


def test_the_identity_has_the_names_that_recordings_always_had() -> None:
    assert asked(camera=2, drive=True, parts=frozenset({Part.SCENE, Part.CURVES})).identity([4, 5]) == {
        "sequence": "test/drive",
        "rig": "test rig",
        "frames": ":",
        "camera": "2",
        "start": "miscalibrated within 5/0.5, seed 0",
        "seed": 0,
        "stages": "4,5",
        "preset": "compact",
        "detail": "full",
        "parts": "curves,scene",
        "color": "depth",
        "as_one_drive": True,
    }


def test_frames_that_are_not_there() -> None:
    with pytest.raises(DatasetError, match="select nothing of test/drive"):
        _ = asked(frames="7").positions


def test_of_a_long_sequence_frames_from_all_over_it_are_run_and_it_says_what_that_takes() -> None:
    many = Drive(list(range(4541)))
    options = RunOptions(sequence=many)
    assert len(options.positions) == 200
    assert options.positions[-1] == 4540 and set(np.diff(options.positions)) <= {22, 23}
    assert not options.contents.dense and options.identity([5])["detail"] == "overview"
    assert options.identity([5])["frames"] == "200 spread over all"
    assert options.expectation == (
        "200 of its 4,541 frames, evenly spread (--frames : runs all). This takes about 2 minutes on two cores, and "
        "about 180 MB in overview detail (--detail full keeps everything)."
    )
    everything = RunOptions(sequence=many, frames=":", detail=Detail.FULL)
    assert len(everything.positions) == 4541 and everything.contents.dense
    assert everything.expectation == "This takes about 68 minutes on two cores, and about 21.3 GB."
    assert asked().expectation == "" and asked().contents.dense
