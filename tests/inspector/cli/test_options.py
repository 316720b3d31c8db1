from __future__ import annotations

from typing import Any

import click
import numpy as np
import pytest

from calibnet.geometry import RANGES, MiscalibrationRange, euler_xyz, range_of, sample_miscalibration, stages_within
from inspector.cli.errors import run
from inspector.cli.main import cli
from inspector.cli.options import FRAMES, MISCALIBRATION, RANGE, SEED, STAGES


def convert(option_type: click.ParamType[Any], text: str) -> Any:
    return option_type.convert(text, None, None)


def test_range() -> None:
    assert convert(RANGE, "5/0.5") == MiscalibrationRange(5.0, 0.5)


@pytest.mark.parametrize("text", ["5", "5/", "a/b", "5/0.5/1", "-1/0.5", "5/nan", "90/1"])
def test_bad_ranges_are_usage_errors(text: str) -> None:
    with pytest.raises(click.BadParameter, match="Range"):
        convert(RANGE, text)


@pytest.mark.parametrize("number", ["nan", "inf"])
@pytest.mark.parametrize(
    ("command", "option"),
    [
        (("bench",), "--limit"),
        (("fit-verdict",), "--minutes"),
        (("pack-training",), "--synthetic"),
        (("folder",), "--max-time-difference"),
        (("bag",), "--max-time-difference"),
        (("bag",), "--every"),
    ],
)
def test_numbers_are_finite(
    command: tuple[str, ...], option: str, number: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(cli, [*command, option, number]) == 2
    assert f"Invalid value for '{option}'" in capsys.readouterr().err


def test_seeds_are_whole_numbers_of_64_bits() -> None:
    assert convert(SEED, "0") == 0 and convert(SEED, str(2**63 - 1)) == 2**63 - 1
    for text in ("-1", "1.5", str(2**63), "x", ""):
        with pytest.raises(click.BadParameter):
            convert(SEED, text)


@pytest.mark.parametrize(
    ("text", "stages"),
    [("3-5", (3, 4, 5)), ("3,5", (3, 5)), ("4", (4,)), ("5,3", (3, 5)), ("1-2,2,5", (1, 2, 5)), (" 3 - 4 ", (3, 4))],
)
def test_stages(text: str, stages: tuple[int, ...]) -> None:
    assert convert(STAGES, text) == stages


@pytest.mark.parametrize("text", ["", "0", "6", "3-6", "5-3", "a", "3..5", "3,", "-3"])
def test_bad_stages_are_usage_errors(text: str) -> None:
    with pytest.raises(click.BadParameter):
        convert(STAGES, text)


@pytest.mark.parametrize("text", ["7", "-1", ":", "0:100:5", "10:", ":10", "-5:", "::2", "::-1"])
def test_frames_are_kept_as_text(text: str) -> None:
    assert convert(FRAMES, text) == text


@pytest.mark.parametrize("text", ["", "a", "1,2", "1-5", "::0", "1:2:3:4", "1.5"])
def test_bad_frames_are_usage_errors(text: str) -> None:
    with pytest.raises(click.BadParameter, match="START:STOP:STEP"):
        convert(FRAMES, text)


def test_miscalibration_reads_roll_pitch_yaw_then_metres() -> None:
    delta = convert(MISCALIBRATION, "1,-2,3,0.1,-0.2,0.3")
    pitch, yaw, roll = np.degrees(euler_xyz(delta[:3, :3]))
    assert (roll, pitch, yaw) == pytest.approx((1, -2, 3))
    assert delta[:3, 3] == pytest.approx([0.1, -0.2, 0.3])


@pytest.mark.parametrize("text", ["1,2,3", "1,2,3,4,5,six", "1,2,3,4,5,6,7", "nan,0,0,0,0,0", "inf,0,0,0,0,0", ""])
def test_bad_miscalibrations_are_usage_errors(text: str) -> None:
    with pytest.raises(click.BadParameter, match="six numbers"):
        convert(MISCALIBRATION, text)


def test_a_negative_miscalibration_is_no_option() -> None:
    @click.command()
    @click.option("--miscalibrate", type=MISCALIBRATION)
    def command(miscalibrate: Any) -> None:
        assert miscalibrate[0, 3] == -0.1

    command.main(["--miscalibrate", "-1,0,0,-0.1,0,0"], standalone_mode=False)


@pytest.mark.parametrize(
    ("range_", "stages"),
    [("20/1.5", 5), ("10/1.0", 4), ("5/0.5", 3), ("2/0.2", 2), ("1/0.1", 1), ("3/0.3", 3), ("5/1.0", 4), ("0/0", 1)],
)
def test_stages_within_a_range_are_the_last_ones(range_: str, stages: int) -> None:
    assert stages_within(MiscalibrationRange.parse(range_)) == tuple(range(6 - stages, 6))


def test_beyond_all_ranges_every_stage_runs() -> None:
    assert stages_within(MiscalibrationRange(30, 2)) == (1, 2, 3, 4, 5)


def test_bounds_of_a_drawn_miscalibration_start_at_its_range_or_a_finer_one() -> None:
    generator = np.random.default_rng(0)
    for number, stage in enumerate(RANGES, start=1):
        for _ in range(20):
            range_ = range_of(sample_miscalibration(stage, generator))
            assert range_.rotation_deg <= stage.rotation_deg
            assert range_.translation_m <= stage.translation_m
            assert stages_within(range_)[0] >= number
