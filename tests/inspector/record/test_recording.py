"""A recording of the fake cascade, read back: every stream at every frame, and nothing that should not be there."""

from __future__ import annotations

import datetime
import subprocess
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from rerun.chunk import RrdReader

from calibnet.verdict import Cause
from inspector import entities
from inspector.programs import rerun_binary
from inspector.read.run import RecordedRun, read_run
from inspector.record import recording as recording_module
from inspector.record.tabs import cascade, cost_volumes
from tests.support.judged import REASON, UNSURE

STAGES, STRIDES, FRAMES = (3, 4, 5), (8, 16, 32), [0, 1, 2]
Read = Callable[..., list[tuple[Any, Any]]]


def expected_streams() -> dict[str, str]:
    """Entities of a full recording of a frame, and the component that carries each."""
    points, image, encoded = "Points2D:positions", "Image:buffer", "EncodedImage:blob"
    streams = {
        "image": encoded,
        "table": "TextDocument:text",
        "verdict/frame": "verdict_json",
        "overlay/miscalibrated": points,
        "overlay/corrected": points,
        "overlay/reference": points,
        "overlay/current": points,
        "world/cloud": "Points3D:positions",
        "world/camera/initial": "Pinhole:image_from_camera",
        "world/camera/reference": "Pinhole:image_from_camera",
    }
    for kind in ("rotation", "translation"):
        for name in ("initial", "corrected", *(f"stage_{stage}" for stage in STAGES)):
            streams[f"error/{kind}/{name}"] = "Scalars:scalars"
    for stage in STAGES:
        streams |= {
            f"overlay/stage_{stage}": points,
            f"world/camera/stage_{stage}": "Transform3D:translation",
            f"stage_{stage}/displacement": encoded,
            f"stage_{stage}/displacement/arrows": "Arrows2D:vectors",
            f"stage_{stage}/confidence": encoded,
        }
        for stride in STRIDES:
            scale = f"stage_{stage}/scale_{stride}"
            streams |= {
                f"{scale}/cost_volume": "Tensor:data",
                f"{scale}/probability": "Tensor:data",
                f"{scale}/picture": encoded,
                f"{scale}/best_match": encoded,
                f"{scale}/true_match": encoded,
                f"{scale}/peak_probability": encoded,
                f"{scale}/slices": encoded,
                f"{scale}/slices/marks": "Boxes2D:half_sizes",
                f"{scale}/window": image,
                f"{scale}/window/truth": points,
                f"{scale}/hourglass_before": encoded,
                f"{scale}/hourglass_after": encoded,
                f"{scale}/decided_before": encoded,
                f"{scale}/decided_after": encoded,
                f"{scale}/on_truth_before": encoded,
                f"{scale}/on_truth_after": encoded,
            }
    return streams


@pytest.mark.parametrize(("entity", "component"), expected_streams().items())
def test_every_stream_is_there_at_every_frame(full_recording: Path, read: Read, entity: str, component: str) -> None:
    rows = read(full_recording, entity, component)
    assert sorted({frame for frame, _ in rows}) == FRAMES
    assert all(len(value) > 0 for _, value in rows)


def test_timelines_are_frame_time_and_step_only(full_recording: Path) -> None:
    schema = RrdReader(full_recording).store().schema()
    assert {column.name for column in schema.index_columns()} == {"frame", "time", "step"}


def test_current_overlay_walks_through_the_stages_on_step_and_ends_corrected(full_recording: Path, read: Read) -> None:
    steps = [step for step, _ in read(full_recording, "overlay/current", "Points2D:positions", "step")]
    assert steps == [8 * frame + stage for frame in FRAMES for stage in (0, *STAGES, 6, 7)]
    for frame, (_, corrected) in zip(
        FRAMES, read(full_recording, "overlay/corrected", "Points2D:positions"), strict=True
    ):
        rows = dict(read(full_recording, "overlay/current", "Points2D:positions", "step"))
        assert rows[8 * frame + 5] == rows[8 * frame + 7] == corrected
        assert rows[8 * frame] != corrected != rows[8 * frame + 6]
    for component in ("overlay/{}", "Points2D:positions"), ("overlay/{}/caption", "EncodedImage:blob"):
        current, corrected = (
            dict(read(full_recording, component[0].format(name), component[1])) for name in ("current", "corrected")
        )
        assert current == corrected, "of a frame's rows the last is what other timelines show"


def test_time_is_the_frames_timestamp(full_recording: Path, read: Read) -> None:
    times = [time for time, _ in read(full_recording, "image", "EncodedImage:blob", "time")]
    assert times == [datetime.timedelta(seconds=0.1 * frame) for frame in FRAMES]


def test_errors_shrink_by_the_known_share_of_each_stage(full_recording: Path, read: Read, fakes: ModuleType) -> None:
    def curve(name: str) -> np.ndarray:
        return np.array([value.as_py()[0] for _, value in read(full_recording, f"error/{name}", "Scalars:scalars")])

    initial = curve("translation/initial")
    assert initial.min() > 1.0  # centimetres
    for order, stage in enumerate(STAGES, start=1):
        np.testing.assert_allclose(curve(f"translation/stage_{stage}"), initial * fakes.LEFTOVER**order, rtol=0.01)
    np.testing.assert_array_equal(curve("rotation/corrected"), curve("rotation/stage_5"))
    assert (curve("rotation/corrected") < 0.1 * curve("rotation/initial")).all()


def test_cost_volume_is_the_traces_own(full_recording: Path, read: Read, fakes: ModuleType) -> None:
    (_, row), *_ = read(full_recording, "stage_3/scale_16/cost_volume", "Tensor:data")
    tensor = row.values
    shape = tensor.field("shape")[0].as_py()
    assert shape == [9, 9, 10, 32]
    assert tensor.field("names")[0].as_py() == ["dy", "dx", "y", "x"]
    values = tensor.field("buffer")[0].value.values.to_numpy().reshape(shape)
    assert values.dtype == np.float16
    assert values.max() > 0.5


def test_the_true_cell_is_marked_where_the_volume_peaks(full_recording: Path, read: Read) -> None:
    """The fake volumes peak at the truth: the mark must lie within a cell of the found one."""
    for stride in STRIDES:
        scale = f"stage_3/scale_{stride}/window"
        truths = read(full_recording, f"{scale}/truth", "Points2D:positions")
        cells = read(full_recording, f"{scale}/cells", "Boxes2D:centers")
        for (_, truth), (_, centers) in zip(truths, cells, strict=True):
            offset = np.array(truth.as_py()[0]) - np.array(centers.as_py()[1])
            assert np.abs(offset).max() <= 1.0


def test_table_names_errors_skipped_stages_and_no_milliseconds(full_recording: Path, read: Read) -> None:
    (_, row), *_ = read(full_recording, "table", "TextDocument:text")
    text = row.as_py()[0]
    assert "±5° / 0.5 m" in text
    assert "Stage 2 (±10°/1 m) has no weights" in text
    assert "millisecond" not in text
    assert " ms" not in text


@pytest.mark.parametrize("detail", ["full", "overview"])
def test_same_seed_same_recording(record: Callable[..., Any], tmp_path: Path, detail: str) -> None:
    for name in ("a", "b"):
        record(tmp_path / f"{name}.rrd", length=5, detail=detail)
    assert compare(tmp_path / "a.rrd", tmp_path / "b.rrd") == 0


def test_another_seed_is_another_recording(record: Callable[..., Any], tmp_path: Path) -> None:
    """Kept small: rerun prints every chunk that differs."""
    for seed in (1, 2):
        record(tmp_path / f"{seed}.rrd", length=1, detail="overview", seed=seed, stages=(5,), strides=(32,))
    assert compare(tmp_path / "1.rrd", tmp_path / "2.rrd") == 1


def test_a_kill_loses_nothing_of_what_was_recorded(
    record: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After every frame what the file holds at that moment is read, as after a kill."""
    log, file, found = recording_module.Recording.log, tmp_path / "run.rrd", []

    def killed() -> RecordedRun:
        copy = tmp_path / "killed.rrd"
        copy.write_bytes(file.read_bytes())
        return read_run(copy)

    def logged(recording: Any, observation: Any) -> None:
        log(recording, observation)
        run = killed()
        found.append([frame.index for frame in run.frames])
        np.testing.assert_array_equal(run.frames[-1].corrected, observation.trace.corrected)

    monkeypatch.setattr(recording_module.Recording, "log", logged)
    record(file, length=4, detail="overview", strides=(32,))
    assert found == [list(range(count)) for count in range(1, 5)]
    assert read_run(file).warning == ""


def compare(one: Path, other: Path) -> int:
    command = [rerun_binary(), "rrd", "compare", "--unordered", str(one), str(other)]
    return subprocess.run(command, capture_output=True, check=False).returncode


def test_without_reference_nothing_claims_to_know_it(record: Callable[..., Any], tmp_path: Path, read: Read) -> None:
    file = tmp_path / "own.rrd"
    record(file, as_is=True)
    paths = {column.entity_path for column in RrdReader(file).store().schema().component_columns()}
    assert "/overlay/corrected" in paths
    assert not {path for path in paths if "reference" in path or "error" in path or "truth" in path}
    (_, row), *_ = read(file, "table", "TextDocument:text")
    assert "have no reference" in row.as_py()[0]


def test_a_rejected_frame_is_shown_as_it_was(
    record: Callable[..., Any], tmp_path: Path, read: Read, fakes: ModuleType
) -> None:
    file = tmp_path / "doubted.rrd"
    causes = (Cause("mirrored", "The image looks mirrored.", "1.2 px, not 7.1 px"),)
    summary = record(file, detail="overview", doubted=(1,), unsure=(2,), causes=causes)
    captions = [row.as_py()[0] for _, row in read(file, "overlay/corrected/caption", "text")]
    told = [caption.partition(":")[0] for caption in captions]
    assert told == ["corrected, accepted", "rejected, left as it was", "corrected, cannot tell"]
    shown, given = (
        [row.as_py() for _, row in read(file, f"overlay/{name}", "Points2D:positions")]
        for name in ("corrected", "miscalibrated")
    )
    assert [one == other for one, other in zip(shown, given, strict=True)] == [False, True, False]
    fit = [row.as_py()[0] for _, row in read(file, "fit/stage_5", "Scalars:scalars")]
    scale = fakes.make_frame().camera.width / 512
    assert fit == pytest.approx([2.0 * scale, 6.0 * scale, 2.0 * scale])
    assert read(file, "fit/limit", "Scalars:scalars")[0][1].as_py() == pytest.approx([4.0 * scale])
    texts = [row.as_py()[0] for _, row in read(file, "table", "TextDocument:text")]
    assert texts[0].startswith("# Accepted\n\nImage and scan fit together.\n")
    assert "Expected match error after stage 5: 1.6 px; results with at most 3.1 px are believed." in texts[0]
    assert texts[1].startswith(
        f"# Rejected\n\n{REASON}\n\n- **mirrored**: The image looks mirrored. *(1.2 px, not 7.1 px)*\n"
    )
    assert "### Frame 1: left as it was" in texts[1]
    assert texts[2].startswith(f"# Cannot tell\n\n{UNSURE}\n")
    assert summary.verdict == (
        f"Verdict: 1 accepted, 1 rejected (frame 1: {REASON} The image looks mirrored), "
        f"1 cannot tell (frame 2: {UNSURE[:-1]})."
    )


def test_overview_keeps_every_view_but_the_raw_volumes_and_coarse_scales(
    record: Callable[..., Any], tmp_path: Path
) -> None:
    file = tmp_path / "overview.rrd"
    record(file, detail="overview", length=5)
    paths = {str(column.entity_path).lstrip("/") for column in RrdReader(file).store().schema().component_columns()}
    raw = ("cost_volume", "/probability", "slices", "slices/marks")
    left_out = {path for path in expected_streams() if path.endswith(raw) or "scale_16" in path or "scale_32" in path}
    assert expected_streams().keys() - paths == left_out
    assert not [path for path in paths if "scale_16" in path or "scale_32" in path]


def test_the_cloud_has_colours_through_every_extrinsic(full_recording: Path, read: Read) -> None:
    names = ("initial", *(f"stage_{stage}" for stage in STAGES), "reference")
    through = {name: read(full_recording, "world/cloud", f"colors_through:{name}")[0][1] for name in names}
    positions = read(full_recording, "world/cloud", "Points3D:positions")[0][1]
    assert {len(value) for value in through.values()} == {len(positions)}
    assert through["stage_5"] != through["initial"]


@pytest.mark.parametrize("parts", [("curves",), ("overlays", "scene"), ("hourglass",), ("tensors",)])
def test_custom_detail_records_what_is_named_and_no_more(
    record: Callable[..., Any], tmp_path: Path, parts: tuple[str, ...]
) -> None:
    file = tmp_path / "custom.rrd"
    record(file, length=1, detail="custom", parts=parts, stages=(3,), strides=(8,))
    paths = {str(column.entity_path).lstrip("/") for column in RrdReader(file).store().schema().component_columns()}
    shows = {
        "curves": "error/rotation/stage_3",
        "overlays": "overlay/stage_3",
        "scene": "world/cloud",
        "volumes": "stage_3/scale_8/best_match",
        "hourglass": "stage_3/scale_8/hourglass_after",
        "tensors": "stage_3/scale_8/cost_volume",
    }
    assert {part for part, path in shows.items() if path in paths} == set(parts)
    assert {"image", "overlay/miscalibrated", "overlay/corrected", "table", "extrinsic/initial"} <= paths


def test_other_strides_and_radii(record: Callable[..., Any], tmp_path: Path, read: Read) -> None:
    file = tmp_path / "other.rrd"
    record(file, length=1, strides=(4, 8, 16), radius=2, stages=(1, 2, 3, 4, 5), size=(256, 96))
    assert len(read(file, "stage_1/scale_4/window", "Image:buffer")) == 1
    steps = [step for step, _ in read(file, "overlay/current", "Points2D:positions", "step")]
    assert steps == [0, 1, 2, 3, 4, 5, 6, 7]


def test_recording_passes_verification(full_recording: Path) -> None:
    command = [rerun_binary(), "rrd", "verify", str(full_recording)]
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0


def test_entities_are_those_of_the_modules() -> None:
    """The names written out above are what the code calls them: scripts may rely on either."""
    assert entities.of_scale(3, 8, cost_volumes.WINDOW_TRUTH) == "stage_3/scale_8/window/truth"
    assert cascade.displacement_arrows(3) == "stage_3/displacement/arrows"
    assert entities.error_stage("rotation", 4) == "error/rotation/stage_4"
