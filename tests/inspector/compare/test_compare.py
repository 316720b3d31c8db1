"""``calib-inspect compare``: what is copied, what is compared, and what it refuses."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from rerun.chunk import RrdReader

from calibnet.errors import ConfigError
from inspector.cli.errors import run
from inspector.cli.main import cli
from inspector.compare.blueprint import make_comparison_blueprint
from inspector.compare.comparison import Comparison
from inspector.compare.table import comparison_table
from inspector.programs import rerun_binary
from inspector.read.run import RecordedRun, read_run
from inspector.read.understood import RecordingError
from tests.support.layout import views

Read = Callable[..., list[tuple[Any, Any]]]


@pytest.fixture(scope="module")
def files(record: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A: three frames in full detail; B: another seed; short: two frames; own: without reference."""
    folder = tmp_path_factory.mktemp("runs")
    made = {name: folder / f"{name}.rrd" for name in ("A", "B", "short", "own")}
    record(made["A"], strides=(32,))
    record(made["B"], detail="overview", strides=(32,), seed=2)
    record(made["short"], length=2, detail="overview", strides=(32,), seed=2)
    record(made["own"], detail="overview", strides=(32,), as_is=True)
    return made


@pytest.fixture
def runs(files: dict[str, Path]) -> dict[str, RecordedRun]:
    return {name: read_run(file) for name, file in files.items()}


def call(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    code = run(cli, ["compare", *map(str, arguments), "--headless"])
    out, err = capsys.readouterr()
    return code, out, err


def rows_of(file: Path) -> dict[str, int]:
    """Rows by entity, of what changes with time."""
    rows: dict[str, int] = {}
    for chunk in RrdReader(file).store().stream():
        if not chunk.is_static:
            rows[chunk.entity_path] = rows.get(chunk.entity_path, 0) + chunk.num_rows
    return rows


def test_each_run_keeps_its_overlays_and_curves_and_nothing_else(
    files: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], read: Read
) -> None:
    file = tmp_path / "AB.rrd"
    code, out, _ = call(capsys, files["A"], files["B"], "--save", file)
    assert code == 0
    assert out.startswith("A: 0.16° / 1.4 cm off, median over 3 frames.")
    own = {"overlay/miscalibrated", "overlay/corrected", "error/rotation/corrected", "error/translation/corrected"}
    expected = {"/image", "/overlay/reference", *(f"/{name}/{path}" for name in "AB" for path in own)}
    rows = rows_of(file)
    moving = {path for path in rows if "caption" not in path}
    assert moving == expected
    assert {rows[path] for path in moving} == {3}
    for name in "AB":
        curve = "error/translation/corrected"
        assert read(file, f"{name}/{curve}", "Scalars:scalars") == read(files[name], curve, "Scalars:scalars")
        assert read(file, f"{name}/{curve}", "SeriesLines:names", "frame") == []  # said once, not every frame


def test_every_view_has_data(files: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "AB.rrd"
    names = "first,second run"
    assert call(capsys, files["A"], files["B"], "--save", file, "--names", names)[0] == 0
    paths = {chunk.entity_path for chunk in RrdReader(file).store().stream()}
    comparison = Comparison.of([read_run(files["A"]), read_run(files["B"])], names.split(","))
    shown = list(views(make_comparison_blueprint(comparison).root_container))
    assert {"first: each frame alone", "second run: each frame alone", "second run: start", "Reference (truth)"} <= {
        str(view.name) for view in shown
    }
    for view in shown:
        contents = [view.origin] if isinstance(view.contents, str) else view.contents
        wanted = [str(path).removesuffix("/**") for path in contents]
        assert all(any(path == want or path.startswith(f"{want}/") for path in paths) for want in wanted), view.name


def test_other_frames_need_the_flag(files: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "AB.rrd"
    code, _, err = call(capsys, files["A"], files["short"], "--save", file)
    assert code == 3
    assert "has 3 frames and" in err
    assert "--common-frames" in err
    assert not file.exists()
    assert call(capsys, files["A"], files["short"], "--save", file, "--common-frames")[0] == 0
    assert set(rows_of(file).values()) == {2}


def test_the_table_says_what_changed(runs: dict[str, RecordedRun]) -> None:
    table = comparison_table(Comparison.of([runs["A"], runs["B"]], ["A", "B"]))
    assert "### Errors of each frame alone, over 3 frames" in table
    assert "| A, at the start |" in table
    assert "| seed | 1 | 2 |" in table
    assert "detail" not in table
    (row,) = [line for line in table.splitlines() if line.startswith("| **B** |")]
    assert row.startswith("| **B** | 0.12° (−0.04°) | 0.12° (−0.04°) | ")
    assert row.endswith("| 100 % | 100 % |")  # equal: nothing in brackets


def test_without_any_reference_only_distances_are_left(runs: dict[str, RecordedRun]) -> None:
    comparison = Comparison.of([runs["own"], runs["own"]], ["A", "B"])
    table = comparison_table(comparison)
    assert "Errors" not in table
    assert "| B | 0.00° |" in table
    assert not [view for view in views(make_comparison_blueprint(comparison).root_container) if "error" in view.name]


@pytest.mark.parametrize("setting", ["sequence", "rig", "camera"])
def test_other_data_is_refused(runs: dict[str, RecordedRun], setting: str) -> None:
    one, other = (replace(runs["A"], settings={setting: value}) for value in ("x", "y"))
    with pytest.raises(RecordingError, match=f"has the {setting} 'x' and .* has 'y'"):
        Comparison.of([one, other], ["A", "B"])


def test_other_pictures_under_the_same_numbers_are_refused(
    runs: dict[str, RecordedRun], record: Callable[..., Any], tmp_path: Path, fakes: ModuleType
) -> None:
    class Wider(fakes.FakeSequence):  # type: ignore[misc, name-defined]
        def __getitem__(self, position: int) -> Any:
            return fakes.make_frame(position, width=480)

    record(tmp_path / "wide.rrd", detail="overview", strides=(32,), sequence=Wider(3))
    with pytest.raises(RecordingError, match="Frame 0 has a different image or camera"):
        Comparison.of([runs["A"], read_run(tmp_path / "wide.rrd")], ["A", "B"])


@pytest.mark.parametrize("names", [["A", "A"], ["A", "image"], ["", "B"]])
def test_names_that_cannot_be_used(runs: dict[str, RecordedRun], names: list[str]) -> None:
    with pytest.raises(ConfigError, match="--names"):
        Comparison.of([runs["A"], runs["B"]], names)


def test_the_runs_themselves_are_never_overwritten(files: dict[str, Path], capsys: pytest.CaptureFixture[str]) -> None:
    before = files["B"].read_bytes()
    code, _, err = call(capsys, files["A"], files["B"], "--save", files["B"])
    assert code == 3
    assert "is an input of this run" in err
    assert files["B"].read_bytes() == before


@pytest.mark.parametrize("arguments", [("A",), ("A", "B", "--names", "one")])
def test_wrong_usage(files: dict[str, Path], arguments: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    code, _, _ = call(capsys, *(files.get(argument, argument) for argument in arguments))
    assert code == 2


def test_the_same_runs_give_the_same_comparison(
    files: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("1", "2"):
        assert call(capsys, files["A"], files["B"], "--save", tmp_path / f"{name}.rrd")[0] == 0
    command = [rerun_binary(), "rrd", "compare", "--unordered", str(tmp_path / "1.rrd"), str(tmp_path / "2.rrd")]
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0
