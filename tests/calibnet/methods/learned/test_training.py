"""The networks of other papers train like ours: to weights with a record, which come back and calibrate."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from calibnet.cascade.stage import Stage
from calibnet.errors import ConfigError, WeightsError
from calibnet.geometry import RANGES
from calibnet.methods.learned.config import MethodConfig
from calibnet.methods.learned.networks import NETWORKS
from calibnet.methods.learned.weights import load_method_network, load_method_stage
from calibnet.training.ablations import ABLATIONS
from calibnet.training.build import build
from calibnet.training.optimizer import update_average
from calibnet.training.recipe import RECIPE
from calibnet.weights import load_network, read_record
from calibnet.weights.manifest import load_manifest
from tests.calibnet.training.conftest import tiny_world  # noqa: F401 - a fixture
from tests.calibnet.training.tiny_run import BATCH, Watcher, options, trainer_of
from tests.support.scene import Scenes, make_frame

SMALL = (64, 128)


@pytest.fixture
def small_inputs(monkeypatch: pytest.MonkeyPatch) -> None:
    """The networks take an eighth of the pixels."""
    defaults = MethodConfig.__init__.__defaults__
    assert defaults == (256, 512)
    monkeypatch.setattr(MethodConfig.__init__, "__defaults__", SMALL)
    monkeypatch.setattr(MethodConfig, "input_height", SMALL[0])
    monkeypatch.setattr(MethodConfig, "input_width", SMALL[1])


@pytest.mark.parametrize("name", NETWORKS.own)
def test_a_run_ends_with_weights_that_calibrate(
    name: str,
    small_inputs: None,
    tiny_world: Scenes,  # noqa: F811
    tmp_path: Path,
) -> None:
    watcher = Watcher()
    path = trainer_of(options(tmp_path, batches=2, preset=name, warm_up=None), watcher=watcher).run()
    assert path == tmp_path / f"{name}-5deg-0.5m.safetensors"
    record = read_record(path)
    assert record["samples"] == 2 * BATCH and record["options"]["preset"] == name
    assert watcher.figures and record["validation"] == watcher.figures[-1]._asdict()
    assert load_manifest(name, tmp_path).stages[0].range == RANGES[2]
    stage = load_method_stage(name, RANGES[2], tmp_path)
    assert stage is not None and not stage.network.training and stage.number == 3
    assert stage.settings.looks == NETWORKS.load(name).LOOKS
    frame = make_frame(5)
    trace = stage.correct(frame, stage.view(frame), frame.camera_from_lidar)
    np.testing.assert_allclose(trace.after, trace.correction @ trace.before)
    assert load_method_stage(name, RANGES[0], tmp_path) is None


def test_no_batch_trains_features_alone_and_no_residual_is_drawn(
    small_inputs: None,
    tiny_world: Scenes,  # noqa: F811
    tmp_path: Path,
) -> None:
    training = build(options(tmp_path, preset="regnet", warm_up=None), RECIPE)
    assert training.recipe.features.warm_up == 0 and training.recipe.features.every == 0
    assert not training.samples.draws.residuals and training.samples.draws.range == RANGES[2]
    assert all(training.samples.largest_shift(number) == 0 for number in range(20))


def test_uniform_draws_are_those_of_the_range(tiny_world: Scenes, tmp_path: Path) -> None:  # noqa: F811
    usual, uniform = (build(options(tmp_path, uniform=flag), RECIPE).samples.draws.range for flag in (False, True))
    assert usual.translation_m > uniform.translation_m and uniform == RANGES[2]


def test_an_ablation_is_trained_as_a_preset_without_a_module(
    tiny_world: Scenes,  # noqa: F811
    tmp_path: Path,
) -> None:
    for name, switch in ABLATIONS.items():
        stage = build(options(tmp_path, ablation=name), RECIPE).stage
        assert isinstance(stage, Stage)
        off = [other for other in ABLATIONS.values() if other and not getattr(stage.network.config, other)]
        assert off == ([switch] if switch else [])
    path = trainer_of(options(tmp_path, batches=2, warm_up=BATCH, ablation="aggregation")).run()
    assert not load_network(path).config.aggregation
    with pytest.raises(ConfigError, match="'nothing' is not a row of the ablation; choose from multi-scale-features"):
        build(options(tmp_path, ablation="nothing"), RECIPE)


def test_weights_of_others_are_refused_in_a_sentence(
    small_inputs: None,
    tiny_world: Scenes,  # noqa: F811
    tmp_path: Path,
) -> None:
    path = trainer_of(options(tmp_path, batches=1, preset="regnet", warm_up=None)).run()
    other = tmp_path / "lccnet-5deg-0.5m.safetensors"
    other.write_bytes(path.read_bytes())
    with pytest.raises(WeightsError, match=r"has the weights of regnet, 5/0\.5; restore its original name"):
        load_method_stage("lccnet", RANGES[2], tmp_path)
    ours = trainer_of(options(tmp_path, batches=2, warm_up=BATCH)).run()
    with pytest.raises(WeightsError, match="is not a network of regnet, calibnet, lccnet, calibformer"):
        load_method_network(ours)
    with pytest.raises(ConfigError, match="has the weights of regnet, not of calibnet"):
        build(options(tmp_path, preset="calibnet", initialize=str(path)), RECIPE)


def test_averaged_weights_follow_in_a_short_run(tiny_world: Scenes, tmp_path: Path) -> None:  # noqa: F811
    """After a hundred steps of one direction the average is in their last tenth, not at their start."""
    trainer = trainer_of(options(tmp_path))
    name, weight = next((name, p) for name, p in trainer.network.named_parameters() if p.requires_grad)
    average = dict(trainer.average.module.named_parameters())
    for step in range(100):
        with torch.no_grad():
            weight.fill_(float(step))
        update_average(trainer.average, trainer.network, step, RECIPE.optimizer)
    assert 80 < float(average[name].detach().flatten()[0]) < 99
