"""Opens what a training run needs: its data, its network, and the stage that the network will be."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch
from lightning_fabric import Fabric

from calibnet.cascade.stage import Stage
from calibnet.datasets import Sequence
from calibnet.errors import ConfigError
from calibnet.geometry import RANGES, MiscalibrationRange
from calibnet.methods.learned.config import MethodConfig
from calibnet.methods.learned.network import MethodNetwork
from calibnet.methods.learned.networks import NETWORKS, method_network
from calibnet.methods.learned.stage import MethodStage
from calibnet.methods.learned.weights import load_method_network, method_settings
from calibnet.network.config import load_preset
from calibnet.network.network import CalibrationNetwork
from calibnet.runtime.text import LONGEST, one_line
from calibnet.training.ablations import ablated
from calibnet.training.data import Source, training_sources, validation_sequences
from calibnet.training.devices import launch
from calibnet.training.draws import Draws
from calibnet.training.frames import TrainingFrames
from calibnet.training.on_device.batches import DeviceSamples
from calibnet.training.on_device.store import FrameStore
from calibnet.training.options import TrainingOptions
from calibnet.training.packed import packed_residuals, read_packed
from calibnet.training.recipe import RECIPE, OptimizerRecipe, Recipe
from calibnet.training.residuals import residual_errors, stages_before
from calibnet.training.samples import TrainingSamples
from calibnet.training.trained import TrainedNetwork, TrainedStage
from calibnet.training.validation import Validation
from calibnet.weights import load_network, read_record
from calibnet.weights.manifest import load_manifest


@dataclass(frozen=True)
class Training:
    """A training run that is ready to start.

    Attributes:
        options: the options as given.
        recipe: the recipe as it acts in this run, see `Recipe.of_run`.
        fabric: the devices, with all processes started.
        stage: the stage to train; its network is on the CPU, and parameters that are not trained need no gradient.
        samples: what it is trained on.
        validation: measures its errors on held-out frames, if there are any.
        inherited_licence: licence note of the weights that training starts from; empty without such weights.
    """

    options: TrainingOptions
    recipe: Recipe
    fabric: Fabric
    stage: TrainedStage
    samples: TrainingSamples | DeviceSamples
    validation: Validation | None
    inherited_licence: str = ""


def build(options: TrainingOptions, recipe: Recipe = RECIPE) -> Training:
    """Open data and network.

    Raises:
        ConfigError: options contradict each other, or do not fit the data or weights that they name.
        DatasetError: data cannot be read.
        WeightsError: the weights to start from cannot be read.
    """
    if not (options.minutes or options.samples):
        raise ConfigError("Training needs a budget: give --minutes or --samples.")
    torch.manual_seed(options.seed)
    fabric = launch()
    network = open_network(options, recipe.optimizer)
    start = initialize(network, options)
    stage = open_stage(network, options)
    recipe = recipe.of_run(options, network.config)
    sources, held_out = open_sources(options)
    frames = open_frames(sources, recipe, stage, options)
    draws = open_draws(options, recipe, frames, stage, start.to(fabric.device) if start else None)
    samples: TrainingSamples | DeviceSamples = TrainingSamples(frames, draws, network.config.scales)
    if options.on_device:
        samples = DeviceSamples(samples, FrameStore.load(sources, fabric.device))
    return Training(
        options,
        recipe,
        fabric,
        stage,
        samples,
        Validation(held_out, stage, recipe.pace.validation_draws, options.seed) if held_out else None,
        inherited_licence(options),
    )


def inherited_licence(options: TrainingOptions) -> str:
    """Licence note of the weights that a run starts from; read at its start, as the file may be gone at its end."""
    if not options.initialize:
        return ""
    said = read_record(Path(options.initialize)).get("licence_note")
    return one_line(said or "It is not recorded what these were trained on.", 10 * LONGEST)


def open_network(options: TrainingOptions, recipe: OptimizerRecipe) -> TrainedNetwork:
    """The network of a method or preset; a preset's pretrained levels get their weights, and the first are frozen."""
    if options.preset in NETWORKS:
        return method_network(MethodConfig(options.preset), MiscalibrationRange.parse(options.range))
    config = load_preset(options.preset)
    if options.head:
        config = replace(config, head=options.head)
    if options.image_encoder:
        changes: dict[str, Any] = {"image_encoder": options.image_encoder}
        config = replace(config, **changes)
    if options.ablation:
        config = ablated(config, options.ablation)
    network = CalibrationNetwork(config, MiscalibrationRange.parse(options.range))
    network.features.load_pretrained()
    for parameter in network.features.pretrained_levels()[: recipe.frozen_levels].parameters():
        parameter.requires_grad_(False)
    return network


def initialize(network: TrainedNetwork, options: TrainingOptions) -> TrainedNetwork | None:
    """Load the weights of ``options.initialize`` into the network; a head of another kind keeps its random weights.

    Returns:
        The network that the weights belong to; None without ``options.initialize``.
    """
    if not options.initialize:
        return None
    if isinstance(network, MethodNetwork):
        other = load_method_network(Path(options.initialize))
        if type(other) is not type(network):
            raise ConfigError(
                f"{options.initialize} has the weights of {other.NAME}, not of {network.NAME}; give weights of that "
                "network."
            )
        network.load_state_dict(other.state_dict())
        return other
    start = load_network(Path(options.initialize))
    given = start.state_dict()
    if start.config.head != network.config.head:
        new = {name: tensor for name, tensor in network.state_dict().items() if name.startswith("pose.")}
        given = {name: tensor for name, tensor in given.items() if not name.startswith("pose.")} | new
    try:
        network.load_state_dict(given)
    except RuntimeError:  # lists every name and shape
        raise ConfigError(
            f"{options.initialize} is not a network of preset {options.preset}; give weights of that preset."
        ) from None
    if network.config.share_image_branch and not options.train_image_branch:
        for name, parameter in network.features.named_parameters():
            parameter.requires_grad_(not name.startswith("image_"))
    return start


def open_stage(network: TrainedNetwork, options: TrainingOptions) -> TrainedStage:
    """The network as a stage, with the settings of the manifest in the output folder."""
    number = RANGES.index(network.range) + 1 if network.range in RANGES else 0
    manifest = load_manifest(options.preset, Path(options.output))
    if isinstance(network, MethodNetwork):
        return MethodStage(number, network.range, network, method_settings(manifest, network.range))
    return Stage(number, network.range, network, manifest.settings(network.range))


def open_sources(options: TrainingOptions) -> tuple[list[Source], list[Sequence]]:
    """The training data, packed or not, and the validation data."""
    if not options.packed:
        return training_sources(options)
    if options.data:
        raise ConfigError("Give either --packed or --data, not both.")
    return read_packed(Path(options.packed)), validation_sequences(options)


def open_frames(sources: list[Source], recipe: Recipe, stage: TrainedStage, options: TrainingOptions) -> TrainingFrames:
    """Whole images at the stage's input size, or crops as large as the preset's input where that is smaller."""
    config, size = stage.network.config, stage.settings.image_size
    seen = size if options.whole_images else min(size, 1.0)
    area = config.input_height * config.input_width * seen**2
    return TrainingFrames(sources, recipe, area, options.batch, options.seed, magnification=size / seen)


def open_draws(
    options: TrainingOptions, recipe: Recipe, frames: TrainingFrames, stage: TrainedStage, start: TrainedNetwork | None
) -> Draws:
    """The miscalibrations to train on; with ``options.after`` many are residuals of the stages in that folder.

    A stage that starts from its own weights and looks more than once is also given the residuals of its own first look.
    Starting from a neighbour's weights, these would be errors that the stage never sees.
    """
    if options.uniform or isinstance(stage, MethodStage):
        return Draws(stage.range, recipe.draws)
    drawn = recipe.draws.of(stage.range)
    if options.packed and (travelled := packed_residuals(Path(options.packed), stage.range)):
        return Draws(drawn.range, recipe.draws, travelled, drawn.residual_share)
    if not options.after:
        return Draws(drawn.range, recipe.draws)
    before = stages_before(options.preset, stage.range, Path(options.after))
    again = None
    if isinstance(start, CalibrationNetwork) and start.range == stage.range and stage.settings.looks > 1:
        again = replace(stage, network=start)
    residuals = residual_errors(before, frames, stage.range, recipe.draws, again) if before or again else []
    share = drawn.residual_share if before else recipe.draws.own_residual_share
    return Draws(drawn.range, recipe.draws, residuals, share)
