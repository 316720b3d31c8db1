"""Every try as data for the viewer."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from rerun.chunk import RrdReader

from calibnet.geometry import MiscalibrationRange
from inspector.live.stream import TIMELINE, TryStream
from inspector.live.tries import Try
from inspector.live.workspace import Workspace
from inspector.record.observation import Observation
from inspector.run.start import Start
from tests.support.fakes import FakeCascade, FakeSequence


def rows(file: Path, entity: str, component: str) -> list[tuple[int, Any]]:
    found = []
    for chunk in RrdReader(file).stream().filter(content=f"/{entity}"):
        batch = chunk.to_record_batch()
        names = batch.schema.names
        if TIMELINE in names and component in names:
            found += list(zip(batch[TIMELINE].to_pylist(), batch[component].to_pylist(), strict=True))
    return sorted(found, key=lambda row: row[0])


def test_tries_lie_one_after_the_other_with_their_stages(tmp_path: Path) -> None:
    workspace = Workspace(FakeSequence(2), [0, 1], Start(MiscalibrationRange(5, 0.5)))
    trace = FakeCascade().calibrate(workspace.frame, workspace.extrinsic)
    observation, stream = Observation(workspace.frame, trace, workspace.reference), TryStream()
    tries = [Try.of_trace(number, 0, trace, 5.0) for number in (0, 1)]
    for made in tries:
        stream.log(made, observation)
    point = int(observation.projected(trace.initial).index[-1])
    stream.log_point(tries[1], observation, point)
    assert len(stream) == 3
    files = []
    for number in range(3):  # each piece is a recording of its own: the viewer is given one after the other
        files.append(tmp_path / f"{number}.rrd")
        files[-1].write_bytes(stream.piece(number))
    stream.close()
    titles = [
        chunk.to_record_batch()["Points2D:labels"].to_pylist()[0][0]
        for chunk in RrdReader(files[0]).stream()
        if str(chunk.entity_path).endswith("/title")
    ]
    assert sorted(titles) == [f"stage {stage}, 8 px cells" for stage in (3, 4, 5)]
    for number in (0, 1):
        steps = [time for time, _ in rows(files[number], "overlay/current", "Points2D:positions")]
        assert steps == [8 * number + stage for stage in (0, 3, 4, 5, 6, 7)]
        (at, row), *_ = rows(files[number], "stage_5/scale_8/best_match", "EncodedImage:blob")
        assert at == 8 * number and row
    assert rows(files[2], "overlay/current", "Points2D:positions") == []
    before, after = (rows(file, "stage_3/scale_8/chosen_cell", "Boxes2D:centers") for file in files[1:])
    assert [time for time, _ in after] == [8]
    assert not np.allclose(before[0][1], after[0][1])
