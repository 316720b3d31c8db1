"""The moving picture of a run: one still for the start and every stage of each frame, with its error."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from PIL import Image

from inspector import entities
from inspector.cli.errors import run
from inspector.cli.main import cli
from inspector.read.run import RecordedRun, read_run
from inspector.report.animation import CAPTION_HEIGHT, FIRST_MS, LAST_MS, STAGE_MS, WIDTH, steps_of, write_animation


@pytest.fixture(scope="module")
def recorded(record: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> RecordedRun:
    """Five frames with the overlays of three stages; frame 1 is rejected."""
    file = tmp_path_factory.mktemp("animated") / "run.rrd"
    record(file, length=5, detail="overview", strides=(32,), doubted=(1,))
    return read_run(file)


def stills(file: Path) -> list[tuple[np.ndarray, int]]:
    """Pixels and milliseconds of every still."""
    found = []
    with Image.open(file) as moving:
        assert moving.info["loop"] == 0  # for ever
        for position in range(moving.n_frames):
            moving.seek(position)
            moving.load()  # WebP knows a still's time only then
            found.append((np.asarray(moving.convert("RGB")), moving.info["duration"]))
    return found


def test_the_steps_of_a_frame_name_every_stage_with_its_error(recorded: RecordedRun, fakes: ModuleType) -> None:
    start, *stages = steps_of(recorded, recorded.frames[0])
    assert [step.name for step in (start, *stages)] == [
        "miscalibrated",
        "after stage 3 (for ±5°/0.5 m)",
        "after stage 4 (for ±2°/0.2 m)",
        "after stage 5 (for ±1°/0.1 m)",
    ]
    assert [step.overlay for step in stages] == [entities.overlay_stage(number) for number in (3, 4, 5)]
    assert [step.milliseconds for step in (start, *stages)] == [FIRST_MS, STAGE_MS, STAGE_MS, LAST_MS]
    before = recorded.frames[0].error(recorded.frames[0].initial)
    assert before is not None
    assert start.error == f"{before.rotation_deg:.2f}° and {before.translation_cm:.0f} cm off"
    degrees = [float(step.error.partition("°")[0]) for step in (start, *stages)]
    assert degrees == pytest.approx([before.rotation_deg * fakes.LEFTOVER**n for n in range(4)], abs=0.01)


def test_a_frame_that_was_left_as_it_was_ends_so(recorded: RecordedRun) -> None:
    *_, fifth, last = steps_of(recorded, recorded.frames[1])
    assert last.name == "rejected, left as it was"
    assert last.error == next(steps_of(recorded, recorded.frames[1])).error  # the initial one
    assert (last.overlay, fifth.milliseconds) == (entities.OVERLAY_CORRECTED, STAGE_MS)


def test_without_a_reference_no_error_is_shown(record: Callable[..., Any], tmp_path: Path) -> None:
    record(tmp_path / "own.rrd", length=1, detail="overview", as_is=True)
    run_ = read_run(tmp_path / "own.rrd")
    assert [step.error for step in steps_of(run_, run_.frames[0])] == [""] * 4
    assert next(steps_of(run_, run_.frames[0])).name == "as given"


@pytest.mark.parametrize("suffix", [".webp", ".gif"])
def test_stills_follow_one_another_and_show_where_the_points_are(
    recorded: RecordedRun, tmp_path: Path, suffix: str
) -> None:
    file = tmp_path / f"moving{suffix}"
    write_animation(recorded, file, [0, 4])
    pictures = stills(file)
    assert [milliseconds for _, milliseconds in pictures] == 2 * [FIRST_MS, STAGE_MS, STAGE_MS, LAST_MS]
    camera = recorded.frames[0].camera
    height = CAPTION_HEIGHT + round(camera.height * WIDTH / camera.width)
    assert all(pixels.shape == (height, WIDTH, 3) for pixels, _ in pictures)
    scene = [pixels[CAPTION_HEIGHT:].astype(int) for pixels, _ in pictures]
    to_result = [np.abs(one - scene[3]).mean() for one in scene[:3]]
    assert to_result[0] > to_result[2] > 0  # stages come closer to the result
    assert np.abs(scene[3] - scene[7]).mean() > to_result[2]  # another frame is another picture


def test_the_command_writes_three_frames_or_the_one_asked_for(
    recorded: RecordedRun, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "new" / "moving.webp"
    arguments = ["pictures", str(recorded.path), "--animate", str(file)]
    assert run(cli, arguments) == 0
    assert capsys.readouterr().out == f"{file}\n"
    assert len(stills(file)) == 3 * 4  # frames 0, 2 and 4
    assert run(cli, [*arguments, "--frame", "1"]) == 0
    assert len(stills(file)) == 5


@pytest.mark.parametrize(
    ("options", "code", "sentence"),
    [
        ([], 2, "Give --output DIR for pictures of the tabs, --animate FILE for an animation, or both."),
        (["--animate", "x.mp4"], 3, "x.mp4 is not a .webp or .gif file; give a name with one of these endings."),
        (["--animate", "x.gif", "--frame", "9"], 2, "has no frame 9; choose one from 0 to 4."),
    ],
)
def test_wrong_options_are_one_sentence(
    recorded: RecordedRun, options: list[str], code: int, sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(cli, ["pictures", str(recorded.path), *options]) == code
    assert sentence in capsys.readouterr().err


def test_a_recording_without_the_stages_overlays_is_refused(
    record: Callable[..., Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record(tmp_path / "curves.rrd", length=1, detail="custom", parts=("curves",))
    assert run(cli, ["pictures", str(tmp_path / "curves.rrd"), "--animate", str(tmp_path / "x.webp")]) == 3
    assert "has no overlay/stage_3 of frame 0" in capsys.readouterr().err
    assert not (tmp_path / "x.webp").exists()
