from __future__ import annotations

import json

import pytest
import torch
from torch import nn

from calibnet.evaluation import reference
from calibnet.evaluation.benchmark import BATCHES, WARM_UP, benchmark
from calibnet.geometry import RANGES
from calibnet.methods.learned.config import MethodConfig
from calibnet.methods.learned.networks import method_network
from calibnet.methods.learned.resnet import BasicBlock
from calibnet.network.convolution import Conv2d
from tests.calibnet.cascade.test_cascade import cascade
from tests.support.scene import make_frame


def test_the_reference_says_the_same_with_its_norms_folded() -> None:
    torch.manual_seed(0)
    block = BasicBlock(4, 8, 2)
    for norm in (layer for layer in block.modules() if isinstance(layer, nn.BatchNorm2d)):
        nn.init.uniform_(norm.weight), nn.init.uniform_(norm.bias)
        nn.init.uniform_(norm.running_mean), nn.init.uniform_(norm.running_var, 0.5, 2.0)
    block, x = block.eval(), torch.randn(1, 4, 12, 16)
    with torch.no_grad():
        expected = block(x)
        reference.fold(block)
        assert not any(isinstance(layer, nn.BatchNorm2d) for layer in block.modules())
        assert sum(isinstance(layer, Conv2d) for layer in block.modules()) == 3
        torch.testing.assert_close(block(x), expected)


def test_the_reference_is_the_cascade_of_the_field() -> None:
    network = method_network(MethodConfig(reference.NAME), RANGES[0])
    assert network.CASCADED and len(RANGES) == reference.STAGES


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
    assert content["ratio"] == pytest.approx(content["cascade_ms_per_frame"] / (5 * content["reference_ms_per_stage"]))
    assert content["threads"] >= 1 and content["precision"] in ("bf16", "float32")
