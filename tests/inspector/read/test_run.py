"""A recording read back: exact numbers, pictures on demand, and one sentence for what cannot be read."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import cv2
import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader

from calibnet.geometry import MiscalibrationRange, miscalibration, project
from calibnet.verdict import BadFrame, Cause, Verdict
from inspector import entities
from inspector.read.run import read_run
from inspector.read.understood import RecordingError
from inspector.read.verdict import read_verdict
from inspector.record import indexing
from inspector.record.recording import RunDescription
from inspector.record.sentence import record_sentence
from inspector.record.watch import record_watch
from inspector.run.start import Start
from tests.support.judged import REASON


@pytest.fixture(scope="module")
def long_recording(record: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve frames, of which the first are written before the last, as they are in long recordings."""
    file = tmp_path_factory.mktemp("long") / "long.rrd"
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(indexing, "ROUND_BYTES", 1 << 20)
        record(file, length=12, detail="overview", strides=(32,))
    return file


def cut(file: Path, share: float, target: Path) -> Path:
    """The first part of a file."""
    content = file.read_bytes()
    target.write_bytes(content[: int(share * len(content))])
    return target


def test_extrinsics_come_back_exactly(full_recording: Path, fakes: ModuleType) -> None:
    run = read_run(full_recording)
    assert [frame.index for frame in run.frames] == [0, 1, 2]
    assert run.stages == ((3, "5/0.5"), (4, "2/0.2"), (5, "1/0.1"))
    frame = fakes.make_frame(2)
    initial = Start(MiscalibrationRange(5, 0.5), 1).initial(frame)
    trace = fakes.FakeCascade().calibrate(frame, initial, detail=False)
    recorded = run.frames[2]
    assert (recorded.seconds, recorded.source) == (0.2, "fake 2")
    np.testing.assert_array_equal(recorded.initial, initial)
    np.testing.assert_array_equal(recorded.corrected, trace.corrected)
    np.testing.assert_array_equal(recorded.stages[3], trace.stages[0].after)
    np.testing.assert_array_equal(recorded.camera.matrix, frame.camera.matrix)
    assert (recorded.camera.width, recorded.camera.height) == (400, 120)
    error = recorded.error(recorded.corrected)
    assert error is not None
    assert error.translation_cm < 0.1 * recorded.error(recorded.initial).translation_cm


def test_verdicts_come_back_and_a_rejected_frame_keeps_its_start(record: Callable[..., Any], tmp_path: Path) -> None:
    causes = (Cause("mirrored", "The image looks mirrored.", "1.2 px, not 7.1 px"),)
    record(tmp_path / "doubted.rrd", detail="overview", strides=(32,), doubted=(1,), unsure=(2,), causes=causes)
    frames = read_run(tmp_path / "doubted.rrd").frames
    assert [frame.verdict.word for frame in frames] == ["accepted", "rejected", "cannot tell"]
    assert frames[1].verdict.causes == causes and frames[1].verdict.reason == REASON
    for frame in frames:
        np.testing.assert_array_equal(frame.verdict.camera_from_lidar, frame.stages[5])
        result = frame.initial if frame.rejected else frame.stages[5]
        np.testing.assert_array_equal(frame.corrected, result)
        assert not np.array_equal(frame.stages[5], frame.initial)


def test_a_verdict_is_read_as_it_was_written() -> None:
    pose, covariance = miscalibration([10.0, -20.0, 3.0], [0.1, 1 / 7, -0.3]), np.diag(np.arange(1.0, 7.0)) / 3
    skipped = (BadFrame(4, "It is cut short."),)
    causes = (Cause("units", "Ranges are in millimetres.", "median 11000"),)
    written = Verdict("cannot tell", "Who knows.", pose, (0.1, 2.5), causes, covariance, 9, skipped)
    found = read_verdict(json.dumps(written.as_dict()), Path("run.rrd"))
    assert found.as_dict() == written.as_dict()
    assert found.causes == causes and found.skipped == skipped and found.moved == (0.1, 2.5)
    np.testing.assert_array_equal(found.covariance, covariance)


def test_pictures_come_back(full_recording: Path, fakes: ModuleType) -> None:
    run = read_run(full_recording)
    image = cv2.imdecode(np.frombuffer(run.image(1), np.uint8), cv2.IMREAD_COLOR)
    frame = fakes.make_frame(1)
    assert np.abs(image[:, :, ::-1].astype(int) - frame.image).mean() < 4.0
    points = run.overlay(entities.OVERLAY_REFERENCE, 1)
    assert points.rgb.shape == (len(points.uv), 3)
    pixels = project(frame.points, frame.camera_from_lidar, frame.camera).pixels
    nearest = np.abs(pixels[None] - points.uv[:50, None]).max(axis=-1).min(axis=1)
    assert nearest.max() <= 0.126  # positions are rounded to a quarter of a pixel
    with pytest.raises(RecordingError, match="has no image of frame 7"):
        run.image(7)


def test_of_a_drive_solved_as_one_the_last_estimate_is_the_result(tmp_path: Path, full_recording: Path) -> None:
    file = tmp_path / "drive.rrd"
    rec = rr.RecordingStream("calib-inspect")
    rec.save(file)
    rr.send_chunks(RrdReader(full_recording).store().stream(), recording=rec)
    extrinsics = {index: np.eye(4) for index in (0, 2)}
    for index, extrinsic in extrinsics.items():
        extrinsic[0, 3] = index
        rec.set_time("frame", sequence=index)
        rec.log(entities.EXTRINSIC_DRIVE, rr.AnyValues(camera_from_lidar=extrinsic.ravel()))
    rec.disconnect()
    drive = read_run(file).drive
    assert drive is not None
    np.testing.assert_array_equal(drive, extrinsics[2])
    assert read_run(full_recording).drive is None


def test_without_reference_there_is_none(record: Callable[..., Any], tmp_path: Path) -> None:
    record(tmp_path / "own.rrd", length=1, detail="overview", as_is=True)
    run = read_run(tmp_path / "own.rrd")
    assert not run.has_reference
    assert run.frames[0].reference is None
    assert run.frames[0].error(run.frames[0].corrected) is None


def test_cameras_of_different_sizes(record: Callable[..., Any], tmp_path: Path, fakes: ModuleType) -> None:
    class Rigs(fakes.FakeSequence):  # type: ignore[misc, name-defined]
        def __getitem__(self, position: int) -> Any:
            return fakes.make_frame(position, width=400 + 80 * position, height=120 + 40 * position)

    record(tmp_path / "rigs.rrd", length=2, detail="overview", sequence=Rigs(2))
    sizes = [(frame.camera.width, frame.camera.height) for frame in read_run(tmp_path / "rigs.rrd").frames]
    assert sizes == [(400, 120), (480, 160)]


@pytest.mark.parametrize("share", [0.55, 0.8])
def test_a_cut_recording_gives_its_complete_frames_and_warns(
    long_recording: Path, tmp_path: Path, share: float
) -> None:
    run = read_run(cut(long_recording, share, tmp_path / "cut.rrd"))
    assert [frame.index for frame in run.frames] in [list(range(count)) for count in range(2, 13)]
    assert f"only its {len(run.frames)} complete frames" in run.warning
    last = run.frames[-1].index
    assert run.image(last).startswith(b"\xff\xd8")
    assert len(run.overlay(entities.OVERLAY_CORRECTED, last).uv) > 100
    assert read_run(long_recording).warning == ""
    accepted = replace(run.frames_verdict, word="accepted")
    whole = replace(run, given_verdict=accepted, warning="")
    assert whole.verdict is accepted
    verdict = replace(whole, warning=run.warning).verdict
    assert verdict.word == "cannot tell" and "cut off" in verdict.reason


def foreign(file: Path) -> None:
    rec = rr.RecordingStream("somebody-else")
    rec.save(file)
    rec.log("x", rr.Scalars(1.0))
    rec.disconnect()


def from_before(file: Path) -> None:
    rec = rr.RecordingStream("calib-inspect")
    rec.save(file)
    rec.send_property("run", rr.AnyValues(seed=1))
    rec.disconnect()


def of_watch(file: Path) -> None:
    record_watch([rr.FileSink(file)], "watched", "id", None, ["Too few frames."])


def of_failure(file: Path) -> None:
    record_sentence(file, RunDescription("drive", {"seed": 0}), "failed", "", "No frame can be read.")


def of_rig(file: Path) -> None:
    rec = rr.RecordingStream("calib-inspect")
    rec.save(file)
    rec.log(entities.RIG, rr.AnyValues(rig_json="{}"), static=True)
    rec.disconnect()


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (of_watch, "is a recording of watch"),
        (of_failure, "is the recording of a run that failed"),
        (of_rig, "is the recording of a rig"),
        (lambda file: None, "does not exist"),
        (lambda file: file.write_bytes(b""), "is not a Rerun recording"),
        (lambda file: file.write_bytes(b"not a recording" * 99), "is not a Rerun recording"),
        (foreign, "was recorded by 'somebody-else'"),
        (from_before, "was made by an earlier calib-inspect"),
    ],
)
def test_what_cannot_be_read_is_one_sentence(make: Callable[[Path], Any], sentence: str, tmp_path: Path) -> None:
    file = tmp_path / "x.rrd"
    make(file)
    with pytest.raises(RecordingError, match=f"{re.escape(sentence)}.*; "):
        read_run(file)


def test_cut_before_the_first_frame(long_recording: Path, tmp_path: Path) -> None:
    content = long_recording.read_bytes()
    first = content.index(b"camera_from_lidar")  # the schema of the first chunk of extrinsics
    with pytest.raises(RecordingError, match="before its first frame is complete"):
        read_run(cut(long_recording, first / len(content), tmp_path / "cut.rrd"))


def test_damage_in_the_middle(full_recording: Path, tmp_path: Path) -> None:
    content = bytearray(full_recording.read_bytes())
    where = content.index(b"camera_from_lidar")  # the schema of a chunk of extrinsics; its data follow
    content[where : where + 400] = bytes(400)
    (tmp_path / "x.rrd").write_bytes(content)
    with pytest.raises(RecordingError, match="is damaged in the middle"):
        read_run(tmp_path / "x.rrd")


def test_the_weights_training_record_and_the_versions_come_along(record: Callable[..., Any], tmp_path: Path) -> None:
    from calibnet import __version__
    from calibnet.geometry import RANGES
    from calibnet.weights import read_record, weights_path
    from inspector.cli.preparing import describe_provenance

    provenance = describe_provenance("compact", [3], None)
    record(tmp_path / "x.rrd", length=1, detail="overview", strides=(32,), provenance=provenance)
    run = read_run(tmp_path / "x.rrd")
    assert run.weights == {3: read_record(weights_path("compact", RANGES[2]))}
    assert run.provenance["calib_inspect"] == __version__
    assert {"torch", "rerun"} <= run.provenance.keys()
    assert run.settings == {"seed": 1, "detail": "overview"}
