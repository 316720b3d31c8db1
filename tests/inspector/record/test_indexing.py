"""A recording gets its footer at the end: the same rows in few chunks, and what was there stays until that is whole."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import Chunk, RrdReader

from inspector.record import indexing
from inspector.record import stream as stream_module
from inspector.record.indexing import NotIndexedError
from inspector.record.stream import Stream

FRAMES = 40


def write(file: Path, order: Sequence[int] = range(FRAMES)) -> Stream:
    """A stream of small rows, large rows and static rows, flushed after every frame."""
    stream = Stream("calib-inspect", "test", "title", [file], rrb.Blueprint())
    for frame in order:
        stream.rec.set_time("frame", sequence=frame)
        stream.rec.log("small", rr.Scalars(float(frame)))
        stream.rec.log("large", rr.Tensor(np.full((100, 1000), frame, np.int16)))
        stream.rec.log("static", rr.TextDocument(str(frame)), static=True)
        stream.flush()
    return stream


def rows(file: Path, entity: str, component: str) -> list[tuple[int | None, Any]]:
    """Frame and value of every row, in the order of the file."""
    found: list[tuple[int | None, Any]] = []
    for chunk in RrdReader(file).stream().filter(content=f"/{entity}"):
        batch = chunk.to_record_batch()
        frames = [None] * batch.num_rows if chunk.is_static else batch["frame"].to_pylist()
        found += zip(frames, [value[0] for value in batch[component].to_pylist()], strict=True)
    return found


def chunks(file: Path) -> Iterator[str]:
    return (chunk.entity_path for chunk in RrdReader(file).store().stream())


@pytest.mark.parametrize("order", [range(FRAMES), range(FRAMES)[::-1]])
def test_the_same_rows_in_few_chunks(tmp_path: Path, order: range) -> None:
    file = tmp_path / "run.rrd"
    write(file, order).close()
    assert rows(file, "small", "Scalars:scalars") == [(frame, float(frame)) for frame in order]
    assert rows(file, "static", "TextDocument:text") == [(None, str(order[-1]))]
    tensors = dict(rows(file, "large", "Tensor:data"))
    assert [tensors[frame]["buffer"][0] for frame in sorted(tensors)] == list(range(FRAMES))
    counts = {entity: list(chunks(file)).count(entity) for entity in ("/small", "/static", "/large")}
    assert counts == {"/small": 1, "/static": 1, "/large": 4}  # 8 MB in chunks of 2 MiB
    (small,) = RrdReader(file).store().stream().filter(content="/small")
    assert (small.to_record_batch().schema.field("frame").metadata.get(b"rerun:is_sorted") == b"true") == (
        order == range(FRAMES)
    )


def test_rows_of_other_types_are_another_chunk() -> None:
    values = [[1], [2], ["three"], [4]]
    batches = [pa.record_batch({"frame": [frame], "value": value}) for frame, value in enumerate(values)]
    chunks = [
        chunk for batch in batches for chunk in Chunk.from_record_batch(batch, index="frame", entity_path="/changing")
    ]
    merged = [chunk.to_record_batch()["value"].to_pylist() for chunk in indexing.merged(chunks)]
    assert merged == [[[1], [2]], [["three"]], [[4]]]


def test_a_long_recording_is_not_kept_back_to_its_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(indexing, "ROUND_BYTES", 1 << 20)
    write(tmp_path / "run.rrd").close()
    entities = list(chunks(tmp_path / "run.rrd"))
    assert entities.count("/small") == 5  # after 1 MB, and whenever there is half as much again


def test_layout_and_title_are_there_once(tmp_path: Path) -> None:
    write(tmp_path / "run.rrd").close()
    reader = RrdReader(tmp_path / "run.rrd")
    assert [entry.recording_id for entry in reader.recordings()] == ["test"]
    assert len(reader.blueprints()) == 1
    assert list(chunks(tmp_path / "run.rrd")).count("/__properties") == 2  # title and time


def test_without_room_the_recording_stays_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "run.rrd"
    stream = write(file)

    class Full:
        free = 1000

    monkeypatch.setattr(indexing.shutil, "disk_usage", lambda _: Full)
    stream.close()
    assert stream.remark.startswith(f"{file} has no index, since the disk lacks ")
    assert len(rows(file, "small", "Scalars:scalars")) == FRAMES
    assert list(tmp_path.iterdir()) == [file]


def test_who_does_not_wait_for_the_index_keeps_the_recording(tmp_path: Path) -> None:
    file = tmp_path / "run.rrd"
    stream, told = write(file), []
    before = file.stat().st_size

    def advance(written: int, expected: int) -> bool:
        told.append((written, expected))
        return len(told) < 3

    stream.close(advance)
    assert stream.remark == (
        f"{file} has no index, since indexing was interrupted, and opens more slowly; to add it, run: "
        f"rerun rrd optimize {file} -o NEW.rrd."
    )
    assert [expected for _, expected in told] == [before] * 3
    assert 0 < told[0][0] < told[1][0] < told[2][0] < before
    assert file.stat().st_size == before
    assert len(rows(file, "small", "Scalars:scalars")) == FRAMES
    assert list(tmp_path.iterdir()) == [file]


def test_an_error_while_the_index_is_written_leaves_the_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "run.rrd"
    stream = write(file)
    before = file.stat().st_size
    monkeypatch.setattr(stream_module, "index", fails_in_the_middle)
    with pytest.raises(KeyboardInterrupt):
        stream.close()
    assert file.stat().st_size == before
    assert list(tmp_path.iterdir()) == [file]


def fails_in_the_middle(file: Path, opened: Any, _: Any) -> None:
    def interrupt(*_: int) -> bool:
        raise KeyboardInterrupt

    indexing.index(file, opened, interrupt)


def test_no_room_is_an_error_with_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "run.rrd").write_bytes(bytes(3_000_000))

    class Full:
        free = 1000

    monkeypatch.setattr(indexing.shutil, "disk_usage", lambda _: Full)
    with pytest.raises(NotIndexedError, match=r"lacks 3 MB.*rerun rrd optimize"):
        indexing.index(tmp_path / "run.rrd", lambda _: rr.RecordingStream("x"))
