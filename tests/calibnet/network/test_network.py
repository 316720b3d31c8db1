from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from calibnet.evaluation.counting import count
from calibnet.geometry import RANGES
from calibnet.network.config import load_preset
from calibnet.network.fusion import refinement
from calibnet.network.network import CalibrationNetwork
from calibnet.network.target import Target
from calibnet.runtime.clock import after_each
from calibnet.training.losses import hybrid_loss
from calibnet.training.recipe import RECIPE
from tests.support.tiny import random_inputs, tiny_network


@pytest.mark.parametrize("head", ["geometric", "regression"])
def test_output_has_the_documented_shapes(head: str) -> None:
    network = tiny_network(head=head)
    parts: list[str] = []
    with torch.inference_mode():
        with after_each(network.boxes, parts.append):
            output = network(random_inputs(network.config, batch=2))
        network(random_inputs(network.config))
    assert parts == ["lidar_features", "cost_volumes", "hourglass", "displacement", "pose"]
    assert output.pose.correction.shape == (2, 4, 4)
    assert output.field.displacement.shape == output.field.log_scale.shape == (2, 2, 8, 16)
    sizes = [(2, 25, 8, 16), (2, 25, 4, 8), (2, 25, 2, 4)]
    assert [tuple(score.shape) for score in output.scores] == sizes
    assert [tuple(logits.shape) for logits in output.logits] == sizes


def test_activations_are_kept_only_when_asked_for() -> None:
    network = tiny_network()
    inputs = random_inputs(network.config)
    with torch.inference_mode():
        silent, telling = network(inputs), network(inputs, keep_activations=True)
    assert silent.activations is None
    assert telling.activations is not None
    assert [tuple(volume.shape) for volume in telling.activations.before] == [
        (1, 4, 25, 8, 16), (1, 6, 25, 4, 8), (1, 8, 25, 2, 4),
    ]  # fmt: skip
    for before, after in zip(*telling.activations, strict=True):
        assert before.shape == after.shape and not torch.equal(before, after)
    assert torch.equal(silent.pose.correction, telling.pose.correction)


def test_image_features_may_come_from_an_earlier_call() -> None:
    network = tiny_network()
    inputs = random_inputs(network.config)
    with torch.inference_mode():
        features = network.features.image(inputs.image)
        reused = network(inputs, image_features=features)
        fresh = network(inputs)
    assert torch.equal(reused.pose.correction, fresh.pose.correction)


def test_a_sample_does_not_depend_on_its_batch() -> None:
    network = tiny_network().train()
    inputs = random_inputs(network.config, batch=3)
    second = type(inputs)(*(part[1:2] for part in inputs[:3]), [cells[1:2] for cells in inputs.cells])
    with torch.no_grad():
        together, alone = network(inputs).pose.correction[1], network(second).pose.correction[0]
    torch.testing.assert_close(together, alone, atol=1e-4, rtol=1e-4)


def test_training_may_follow_inference_at_the_same_size() -> None:
    """As in a run whose first batch has the size of the validation frames: nothing kept in between may spoil it."""
    refinement.cache_clear()
    network = tiny_network()
    inputs = random_inputs(network.config, 64, 160)
    with torch.inference_mode():
        network(inputs)
    network(inputs).pose.correction.square().sum().backward()


def test_every_input_matters() -> None:
    network = tiny_network()
    inputs = random_inputs(network.config)
    with torch.inference_mode():
        reference = network(inputs).pose.correction
        for change in (
            inputs._replace(image=255 - inputs.image),
            inputs._replace(lidar=inputs.lidar * 0.5),
            inputs._replace(intrinsics=inputs.intrinsics * torch.tensor([1.3, 1.3, 1.0])[:, None]),
            inputs._replace(cells=[cells * 0.7 for cells in inputs.cells]),
        ):
            assert not torch.allclose(network(change).pose.correction, reference, atol=1e-7)


SMALL = (32, 64)
ABLATIONS = ["multi_scale_features", "multi_scale_volumes", "aggregation", "hierarchical_fusion", "hybrid_loss"]


def preset_network(preset: str, **changes: bool) -> CalibrationNetwork:
    torch.manual_seed(0)
    return CalibrationNetwork(replace(load_preset(preset), **changes), RANGES[2])


@pytest.mark.parametrize("preset", ["compact", "paper"])
def test_ablations_make_the_network_smaller_where_the_paper_says_so(preset: str) -> None:
    def cost(**changes: bool) -> tuple[int, int]:
        parts = count(preset_network(preset, **changes), *SMALL)
        return sum(part.parameters for part in parts), sum(part.multiply_adds for part in parts)

    full = cost()
    for switch in ABLATIONS:
        parameters, multiply_adds = cost(**{switch: False})
        if switch == "hybrid_loss":  # a matter of training alone
            assert (parameters, multiply_adds) == full
        else:
            # the fusing layers of compact's small hourglass are a hundredth of the network
            share = 1.0 if (preset, switch) == ("compact", "hierarchical_fusion") else 0.99
            assert parameters < share * full[0], switch
            assert multiply_adds < 0.99 * full[1], switch


@pytest.mark.parametrize("preset", ["compact", "paper"])
@pytest.mark.parametrize("switch", [None, *ABLATIONS])
def test_every_ablation_trains_every_parameter(preset: str, switch: str | None) -> None:
    network = preset_network(preset, **{switch: False} if switch else {})
    inputs = random_inputs(network.config, 32, 64)
    target = Target(torch.eye(4)[None], torch.zeros(1, 2), [cells[:, 2] > 0 for cells in inputs.cells])
    losses = hybrid_loss(network(inputs), inputs, target, network.config, RECIPE.losses)
    if switch == "hybrid_loss":
        assert losses.matching == losses.displacement == losses.points == 0
    else:
        assert losses.matching > 0
    losses.total.backward()
    for name, parameter in network.named_parameters():
        assert parameter.grad is not None, f"{name} is in the network but not in use"
        assert parameter.grad.isfinite().all(), name
