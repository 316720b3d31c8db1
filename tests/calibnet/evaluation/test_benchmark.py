from __future__ import annotations

import json

import pytest

from calibnet.evaluation.benchmark import BATCHES, WARM_UP, benchmark
from tests.calibnet.cascade.test_cascade import cascade
from tests.support.scene import make_frame


def test_parts_and_stages_make_up_the_whole() -> None:
    told = []
    result = benchmark(cascade((4, 5)), [make_frame(0), make_frame(1)], 2, lambda: told.append(1))
    assert (result.frames, len(told)) == (4, WARM_UP + 4)
    content = json.loads(json.dumps(result.as_dict()))
    assert [stage["range"] for stage in content["stages"]] == ["2/0.2", "1/0.1"]
    parts = {"projection", "lidar_features", "cost_volumes", "hourglass", "displacement", "pose"}
    for stage in content["stages"]:
        assert set(stage["parts_ms_per_frame"]) == parts
        assert set(stage["batch_ms_per_frame"]) == {str(size) for size in BATCHES}
    assert set(content["parts_ms_per_frame"]) == parts | {"preparation", "resize", "image_features", "verdict"}
    assert content["parts_ms_per_frame"]["pose"] == pytest.approx(
        sum(stage["parts_ms_per_frame"]["pose"] for stage in content["stages"])
    )
    slowest = max(stage["ms_per_frame"] for stage in content["stages"])
    assert content["cascade_ms_per_frame"] > slowest > 0
    assert content["threads"] >= 1 and content["precision"] in ("bf16", "float32")
