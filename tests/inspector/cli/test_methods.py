"""``--method``: any method runs, is recorded and shown with what it has, and nothing of it is accepted."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
from rerun.chunk import RrdReader

from calibnet.datasets import open_sequence
from calibnet.datasets.frame import Frame, Frames
from calibnet.errors import CalibnetError, CalibrationError, WeightsError
from calibnet.exhibit import Curve, Exhibit
from calibnet.geometry import RANGES, MiscalibrationRange, invert, miscalibration
from calibnet.geometry.types import Extrinsic
from calibnet.methods.registry import METHODS
from calibnet.methods.unjudged import unjudged
from calibnet.trace import CascadeTrace, DriveEstimate, StageTrace
from calibnet.verdict import ACCEPTED, Verdict
from inspector.cli.run import calibrate
from inspector.cli.viewing import Viewing
from inspector.read.run import read_run
from inspector.record.contents import Contents, Detail
from inspector.record.observation import Layout, Observation
from inspector.record.tabs import exhibits
from inspector.record.tabs.registry import wanted_tabs
from tests.inspector.cli.test_plugins import start
from tests.support.fakes import DELTA, make_frame
from tests.support.folder import write_folder
from tests.support.layout import views
from tests.support.toy_package import install_toys


class Boaster:
    """Goes to the truth of the test's frames, shows a map and a curve, and accepts itself."""

    def __init__(self, range_: MiscalibrationRange, masks: Path | None = None) -> None:
        self.range, self.masks = range_, masks

    def calibrate(self, frame: Frame, initial: Extrinsic, detail: bool = False) -> CascadeTrace:
        after = make_frame(0).camera_from_lidar
        shown = {
            "exhibits": (Exhibit("Height of things", np.arange(12, dtype=np.float32).reshape(3, 4)),),
            "curves": (Curve("Score", np.array([3.0, 2.0, 1.0])),),
        }
        stage = StageTrace(
            1, self.range, frame.camera, initial, after, after @ invert(initial), **(shown if detail else {})
        )
        return CascadeTrace(initial, (stage,), verdict=Verdict(ACCEPTED, "I am sure.", after))


class Mover(Boaster):
    """The same for whole drives alone."""

    drives_only = True

    def calibrate(self, frame: Frame, initial: Extrinsic, detail: bool = False) -> CascadeTrace:
        raise CalibrationError("It needs several frames.")

    def calibrate_drive(
        self, frames: Frames, initial: Extrinsic, observer: Callable[[int, int], None] | None = None
    ) -> DriveEstimate:
        traces = {frame.index: Boaster.calibrate(self, frame, initial, True) for frame in (frames[0], frames[1])}
        found = make_frame(0).camera_from_lidar
        return DriveEstimate(found, 1e-4 * np.eye(6), len(frames), history=(), traces=traces)


class Hungry(Boaster):
    """Needs weights."""

    def __init__(self, range_: MiscalibrationRange, weights: Path | None = None) -> None:
        raise WeightsError(f"There are no weights of hungry in {weights}; train them.")


@pytest.fixture
def calibrated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Path]:
    """``calibrated("boaster", ...)`` runs a method on three frames that start 1° off; returns the recording."""
    methods = {"boaster": Boaster, "mover": Mover, "hungry": Hungry}
    own = {name: f"{__name__}:{kind.__name__}" for name, kind in methods.items()}
    for name, target in own.items():
        monkeypatch.setitem(METHODS.own, name, target)
    folder = write_folder(tmp_path / "own", 3)

    def run(method: str, **asked: Any) -> Path:
        file = tmp_path / "run.rrd"
        sequence = open_sequence("folder", folder)
        away = miscalibration([1, 0, 0], [0, 0, 0])
        viewing = Viewing(file, True, False, None, None)
        assert calibrate(sequence, viewing=viewing, report=None, miscalibration=away, method=method, **asked) == 0
        return file

    return run


def paths(file: Path) -> set[str]:
    return {str(column.entity_path) for column in RrdReader(file).store().schema().component_columns()}


def test_a_method_is_recorded_with_what_it_shows_and_is_never_accepted(
    calibrated: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    file = calibrated("boaster")
    out = capsys.readouterr().out
    assert "0 accepted, 0 rejected, 3 cannot tell" in out and "boaster, median milliseconds" in out
    run = read_run(file)
    assert [frame.verdict.word for frame in run.frames if frame.verdict] == ["cannot tell"] * 3
    assert run.settings["method"] == "boaster" and "preset" not in run.settings
    recorded = paths(file)
    assert {"/stage_1/inside/picture_0", "/stage_1/inside/curve_0"} <= recorded
    assert not any("scale_" in path or path.startswith(("/fit", "/drive")) for path in recorded)


def test_tabs_with_nothing_to_show_are_left_out() -> None:
    frame = make_frame(0, points=200)
    trace = unjudged("boaster", Boaster(RANGES[4])).calibrate(frame, DELTA @ frame.camera_from_lidar, detail=True)
    layout = Layout.of(Observation(frame, trace, frame.camera_from_lidar), Contents.of(Detail.FULL))
    tabs = wanted_tabs(layout)
    assert [tab.view(layout).name for tab in tabs] == ["Overview", "Steps", "Inside", "3D"]
    assert [view.name for view in views(exhibits.view(layout))] == ["Height of things", "Score"]
    assert not any("Fit" in str(view.name) for tab in tabs for view in views(tab.view(layout)))


def test_a_method_of_drives_alone_shows_its_answer_on_every_frame(
    calibrated: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    run = read_run(calibrated("mover"))
    truth = make_frame(0).camera_from_lidar
    assert [np.abs(frame.corrected - truth).max() < 1e-9 for frame in run.frames] == [True] * 3
    assert "Verdict: cannot tell. Results of mover are not judged" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("method", "asked", "sentence"),
    [
        ("boaster", {"drive": True}, "boaster calibrates single frames only"),
        ("mover", {"drive": False}, "mover needs a drive"),
        ("hungry", {}, "There are no weights of hungry"),
        ("mover", {"intrinsics": True}, "--intrinsics does not apply to the method 'mover'"),
    ],
)
def test_what_a_method_cannot_do_is_a_sentence(
    calibrated: Callable[..., Path], method: str, asked: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(CalibnetError) as raised:
        calibrated(method, **asked)
    assert sentence in str(raised.value)


def test_options_of_the_cascade_are_refused(calibrated: Callable[..., Path]) -> None:
    with pytest.raises(click.UsageError, match="--stages and --preset apply to the cascade"):
        calibrated("boaster", stages=(3,))
    with pytest.raises(click.UsageError, match="choose one with --method"):
        calibrated("cascade", intrinsics=True)


def test_a_method_of_another_package_runs_by_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install_toys(tmp_path, monkeypatch)
    folder = write_folder(tmp_path / "own", 2)
    done = start(tmp_path, "folder", str(folder), "--method", "nothing", "--headless", "--save", "run.rrd")
    assert done.returncode == 0, done.stderr
    assert "0 accepted, 0 rejected, 2 cannot tell" in done.stdout
