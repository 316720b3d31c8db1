from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from calibnet.errors import ConfigError
from calibnet.geometry import RANGES, MiscalibrationRange
from calibnet.network.network import CalibrationNetwork
from calibnet.training import build as build_module
from calibnet.training.build import Training, build
from calibnet.training.recipe import RECIPE
from calibnet.weights import save_network
from calibnet.weights.manifest import Manifest, StageEntry, StageSettings, manifest_path
from tests.calibnet.training.tiny_run import options
from tests.support.scene import Scenes
from tests.support.tiny import TINY

FEW_RESIDUALS = replace(RECIPE, draws=replace(RECIPE.draws, residuals=5))


def saved(path: Path, range_: str, seed: int = 1) -> str:
    """A weights file with a random network for a range."""
    torch.manual_seed(seed)
    network = CalibrationNetwork(TINY, MiscalibrationRange.parse(range_))
    save_network(path, network, network.state_dict(), {})
    return str(path)


def settings_of_middle_stage(folder: Path, settings: StageSettings) -> None:
    folder.mkdir(exist_ok=True)
    entry = StageEntry(RANGES[2], "tiny-5deg-0.5m.safetensors", settings)
    Manifest("tiny").with_stage(entry).write(manifest_path("tiny", folder))


def test_a_run_needs_a_budget(tiny_world: Scenes, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="--minutes or --samples"):
        build(options(tmp_path, samples=None))


def test_a_stage_is_used_as_the_manifest_in_its_folder_says(tiny_world: Scenes, tmp_path: Path) -> None:
    settings_of_middle_stage(tmp_path, StageSettings(1.5, 2, 1.2))
    training = build(options(tmp_path))
    assert (training.stage.number, training.stage.settings) == (3, StageSettings(1.5, 2, 1.2))
    assert training.samples.frames.magnification == 1.5
    assert training.validation is not None and training.validation.stage == training.stage
    smaller = tmp_path / "smaller"
    settings_of_middle_stage(smaller, StageSettings(0.5))
    frames = build(options(smaller)).samples.frames
    assert frames.magnification == 1.0
    assert max(height * width for height, width in frames.sizes) < 0.5 * TINY.input_height * TINY.input_width


def test_a_stage_with_a_larger_image_trains_on_crops_or_on_whole_images(tiny_world: Scenes, tmp_path: Path) -> None:
    settings_of_middle_stage(tmp_path, StageSettings(2.0))
    crops = build(options(tmp_path)).samples.frames
    whole = build(options(tmp_path, whole_images=True)).samples.frames
    assert (crops.magnification, whole.magnification) == (2.0, 1.0)
    for (height, width), (larger, wider) in zip(crops.sizes, whole.sizes, strict=True):
        assert larger * wider > 2 * height * width  # four times, but sides are multiples of 32


def test_the_recipe_acts_as_the_run_wants_it(tiny_world: Scenes, tmp_path: Path) -> None:
    training = build(options(tmp_path, batches=30, warm_up=8))
    assert training.recipe.features.warm_up == training.samples.features.warm_up == 8
    assert RECIPE.features.warm_up == 6000


def test_the_same_seed_builds_the_same_network(tiny_world: Scenes, tmp_path: Path) -> None:
    one, same, other = (build(options(tmp_path, seed=seed)).stage.network.state_dict() for seed in (1, 1, 2))
    assert all(torch.equal(one[name], same[name]) for name in one)
    assert not all(torch.equal(one[name], other[name]) for name in one)


def test_weights_of_another_network_are_no_start(
    tiny_world: Scenes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    start = saved(tmp_path / "start.safetensors", "5/0.5")
    monkeypatch.setattr(build_module, "load_preset", lambda name: replace(TINY, context_channels=24))
    with pytest.raises(ConfigError, match=f"{start}.*not a network of preset tiny") as raised:
        build(options(tmp_path, initialize=start))
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(("train_image_branch", "frozen"), [(False, True), (True, False)])
def test_the_image_branch_of_an_initialised_stage_is_frozen_unless_it_is_to_be_trained(
    tiny_world: Scenes, tmp_path: Path, train_image_branch: bool, frozen: bool
) -> None:
    start = saved(tmp_path / "start.safetensors", "10/1")
    network = build(options(tmp_path, initialize=start, train_image_branch=train_image_branch)).stage.network
    image = {name: p.requires_grad for name, p in network.named_parameters() if name.startswith("features.image_")}
    assert set(image.values()) == {not frozen}
    others = [p.requires_grad for name, p in network.named_parameters() if name not in image]
    assert all(others)


@pytest.mark.parametrize("levels", [1, 3])
def test_the_recipe_says_how_many_pretrained_levels_are_frozen(
    tiny_world: Scenes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, levels: int
) -> None:
    pretrained = replace(TINY, image_encoder="efficientnet-lite0", widths=(8, 8, 16, 16, 24))
    monkeypatch.setattr(build_module, "load_preset", lambda name: pretrained)
    recipe = replace(RECIPE, optimizer=replace(RECIPE.optimizer, frozen_levels=levels))
    network = build(options(tmp_path), recipe).stage.network
    frozen = [
        not any(parameter.requires_grad for parameter in level.parameters())
        for level in network.features.pretrained_levels()
    ]
    assert frozen == [position < levels for position in range(4)]


def test_miscalibrations_are_mostly_what_the_stages_before_leave(tiny_world: Scenes, tmp_path: Path) -> None:
    saved(tmp_path / "tiny-20deg-1.5m.safetensors", "20/1.5")
    draws = build(options(tmp_path / "out", range="10/1", after=str(tmp_path)), FEW_RESIDUALS).samples.draws
    assert 0 < len(draws.residuals) <= 5 and draws.residual_share == 0.7
    assert draws.range == RANGES[1]
    without = build(options(tmp_path / "out", range="10/1"), FEW_RESIDUALS).samples.draws
    assert not without.residuals and without.draw(np.random.default_rng(0)) is not None


def test_only_a_stage_that_starts_from_itself_and_looks_again_is_shown_what_its_first_look_leaves(
    tiny_world: Scenes, tmp_path: Path
) -> None:
    def residuals(looks: int, initialize: str) -> Training:
        start = saved(tmp_path / f"{looks}.safetensors", initialize)
        settings_of_middle_stage(tmp_path / "out", StageSettings(looks=looks))
        nothing_before = str(tmp_path / "empty")
        return build(options(tmp_path / "out", initialize=start, after=nothing_before), FEW_RESIDUALS)

    draws = residuals(2, "5/0.5").samples.draws
    assert draws.residuals and draws.residual_share == 0.4, "the range itself stays the larger part"
    assert not residuals(1, "5/0.5").samples.draws.residuals
    assert not residuals(2, "10/1").samples.draws.residuals
