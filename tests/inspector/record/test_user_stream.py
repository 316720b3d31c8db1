"""Calibrations in a stream of the user's own, read back and held against a recording of ours."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rerun as rr
from rerun.chunk import RrdReader

import inspector
from calibnet.errors import ConfigError
from inspector.record.contents import Coloring, Contents, Detail, Part
from inspector.record.observation import Layout, Observation
from inspector.record.recording import Recording, RunDescription
from tests.support.fakes import DELTA, FakeCascade, make_frame
from tests.support.layout import views

CASCADE = FakeCascade((3, 5), strides=(8, 16), radius=2, size=(256, 96))
TIMELINES = ("frame", "time", "step")
Rows = dict[tuple[str, str], list[Any]]


def observation(index: int) -> Observation:
    frame = make_frame(index, points=2000)
    return Observation(frame, CASCADE.calibrate(frame, DELTA @ frame.camera_from_lidar), frame.camera_from_lidar)


@pytest.fixture(scope="module")
def observations() -> list[Observation]:
    return [observation(index) for index in range(3)]


@pytest.fixture
def lenient() -> Iterator[None]:
    """Rerun's own default; recordings of ours in the same process have changed it."""
    before = rr.strict_mode()
    rr.set_strict_mode(False)
    yield
    rr.set_strict_mode(before)


def put(stream: rr.RecordingStream, seen: Observation, prefix: str = "", reference: bool = True) -> None:
    inspector.log_trace(stream, seen.frame, seen.trace, seen.reference if reference else None, prefix)


def rows(file: Path, prefix: str = "") -> Rows:
    """Everything below a prefix by entity and component: times and values, in order; links in tables without it."""
    found: Rows = defaultdict(list)
    top = f"/{prefix}/" if prefix else "/"
    for chunk in RrdReader(file).store().stream():
        batch, path = chunk.to_record_batch(), chunk.entity_path
        if not path.startswith(top) or path.startswith("/__"):
            continue
        times = [batch[line].to_pylist() if line in batch.schema.names else [None] * len(batch) for line in TIMELINES]
        for name in batch.schema.names:
            if ":" not in name and name not in ("width", "height", "source", "camera_matrix", "camera_from_lidar"):
                continue
            for *time, value in zip(*times, batch[name].to_pylist(), strict=True):
                found[path.removeprefix(top), name].append(
                    (*time, str(value).replace(f"recording://{prefix}/", "recording://"))
                )
    return {key: sorted(values, key=lambda row: (row[0] or 0, row[2] or 0)) for key, values in found.items()}


@pytest.fixture(scope="module")
def ours(observations: list[Observation], tmp_path_factory: pytest.TempPathFactory) -> Rows:
    file = tmp_path_factory.mktemp("ours") / "ours.rrd"
    layout = Layout.of(observations[0], Contents.of(Detail.FULL))
    with Recording([rr.FileSink(file)], RunDescription("fake", {"seed": 0}), layout) as recording:
        for seen in observations:
            recording.log(seen)
    return rows(file)


def test_without_a_prefix_the_entities_are_those_of_our_recordings(
    observations: list[Observation], ours: Rows, tmp_path: Path
) -> None:
    stream = rr.RecordingStream("mine")
    stream.save(tmp_path / "mine.rrd")
    for seen in observations:
        put(stream, seen)
    stream.disconnect()
    assert len(ours) > 100
    assert rows(tmp_path / "mine.rrd") == ours


def test_two_calibrations_lie_in_one_stream_below_their_prefixes(
    observations: list[Observation], ours: Rows, tmp_path: Path, lenient: None
) -> None:
    stream = rr.RecordingStream("mine")
    stream.save(tmp_path / "two.rrd")
    for seen in observations:
        put(stream, seen, "car/left")
        put(stream, seen, "car/right", reference=False)
        stream.log("mine", rr.Scalars(float(seen.frame.index)))  # the stream is still open, and stands at the frame
    stream.disconnect()
    assert not rr.strict_mode()
    assert rows(tmp_path / "two.rrd", "car/left") == ours
    right = rows(tmp_path / "two.rrd", "car/right")
    assert right["image", "EncodedImage:blob"] == ours["image", "EncodedImage:blob"]
    assert not [path for path, _ in right if "reference" in path or "error" in path]
    mine = rows(tmp_path / "two.rrd")["mine", "Scalars:scalars"]
    assert [(frame, value) for frame, _, _, value in mine] == [(0, "[0.0]"), (1, "[1.0]"), (2, "[2.0]")]


@pytest.mark.parametrize("prefix", ["", "car/left"])
def test_every_view_of_the_layout_finds_its_entities(observations: list[Observation], ours: Rows, prefix: str) -> None:
    seen, top = observations[0], f"/{prefix}/" if prefix else "/"
    entities = {f"{top}{path}" for path, _ in ours}
    root = inspector.blueprint(seen.frame, seen.trace, seen.reference, prefix).root_container
    shown = list(views(root))
    assert len(shown) > 30
    for view in shown:
        origin = "/" + view.origin.strip("/")
        for query in [view.contents] if isinstance(view.contents, str) else view.contents:
            path = query.removeprefix("- ").replace("$origin", origin).replace("//", "/")
            whole = path.removesuffix("/**")
            assert [entity for entity in entities if entity == whole or (path != whole and entity.startswith(whole))], (
                query
            )
        assert set(view.visualizer_overrides) <= entities


def test_the_layout_can_be_sent_and_has_the_tabs_that_are_named(
    observations: list[Observation], tmp_path: Path, lenient: None
) -> None:
    seen = observations[0]
    layout = inspector.blueprint(seen.frame, seen.trace, prefix="left", tabs=["3D", "Overview"])
    assert [tab.name for tab in layout.root_container.contents] == ["3D", "Overview"]
    stream = rr.RecordingStream("mine")
    stream.save(tmp_path / "sent.rrd")
    put(stream, seen, "left")
    stream.send_blueprint(layout)
    stream.disconnect()
    assert len(RrdReader(tmp_path / "sent.rrd").blueprints()) == 1
    assert not rr.strict_mode()


def test_a_tab_without_data_is_refused_by_name(observations: list[Observation]) -> None:
    seen, contents = observations[0], Contents.of(Detail.CUSTOM, frozenset({Part.SCENE}))
    with pytest.raises(ConfigError, match=r"'Hourglass' is not a tab of this trace; choose from Overview, 3D\."):
        inspector.blueprint(seen.frame, seen.trace, tabs=["Hourglass"], contents=contents)


def test_colours_by_error_need_a_reference(observations: list[Observation]) -> None:
    seen, contents = observations[0], Contents.of(Detail.FULL, color=Coloring.ERROR)
    with pytest.raises(ConfigError, match="without a reference"):
        inspector.log_trace(rr.RecordingStream("mine"), seen.frame, seen.trace, contents=contents)


def test_a_trace_without_details_has_no_empty_tabs() -> None:
    frame = make_frame(0)
    trace = CASCADE.calibrate(frame, DELTA @ frame.camera_from_lidar, detail=False)
    root = inspector.blueprint(frame, trace, frame.camera_from_lidar).root_container
    assert [tab.name for tab in root.contents] == ["Overview", "Cascade", "3D"]
