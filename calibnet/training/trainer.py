"""The training loop of one stage: Lightning Fabric, a time or sample budget, exact resume."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, cast

import torch
from lightning_fabric import Fabric
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn
from torch.utils.data import DataLoader

from calibnet.cascade.stage import Stage
from calibnet.errors import CalibrationError, ConfigError
from calibnet.geometry import RANGES, MiscalibrationRange
from calibnet.network.batch import NetworkInputs
from calibnet.network.config import load_preset
from calibnet.network.network import CalibrationNetwork
from calibnet.runtime.interruption import StopRequest
from calibnet.training.batches import Batch, BatchNumbers, FloatInputs, leave_signals_to_main, next_batch
from calibnet.training.checkpoint import read_checkpoint, restore, save_checkpoint
from calibnet.training.data import training_sources
from calibnet.training.losses import Losses, Target, feature_loss, hybrid_loss
from calibnet.training.options import TrainingOptions
from calibnet.training.progress import Means, Observer, Progress
from calibnet.training.record import training_record
from calibnet.training.residuals import residual_errors, stages_before
from calibnet.training.samples import TrainingSamples, collate
from calibnet.training.validation import Validation, ValidationFigures
from calibnet.weights import load_network, save_network, weights_path
from calibnet.weights.manifest import StageEntry, load_manifest, manifest_path

STOPPING = "Stopping after this step; once more stops at once."


class Trainer:
    """Trains one stage within its budget; `run` ends with the weights on disk."""

    REPORT_SECONDS, CHECKPOINT_SECONDS, VALIDATION_SECONDS = 5.0, 120.0, 600.0
    WARM_UP = 6000  # samples with which a run from scratch first trains the features alone, at a third of the cost
    RATE_RAMP, FINAL_RATE = 0.03, 0.02  # share of the budget in which the learning rate rises; what it falls to
    FROZEN_LEVELS = 2  # pretrained levels left as they are: they see edges on any camera, and cost most to train
    PRETRAINED_RATE = 0.3  # relative learning rate of what was learned on a million pictures
    RESIDUALS = 200  # errors of the stages before, measured when the run starts
    POSE_RAMP = 2000  # samples over which the pose's losses fade in after the warm-up

    def __init__(self, options: TrainingOptions, observer: Observer, resume: bool = False) -> None:
        """Prepare data, network and optimizer; with ``resume``, continue from the output folder."""
        if not (options.minutes or options.samples):
            raise ConfigError("Training needs a budget: give --minutes or --samples.")
        self.options, self.observer = options, observer
        torch.manual_seed(options.seed)
        # the warm-up leaves most of the network out, and later stages freeze the image branch
        strategy = "ddp_find_unused_parameters_true" if torch.cuda.device_count() > 1 else "auto"
        self.fabric = Fabric(accelerator="auto", devices="auto", strategy=strategy, plugins=[FloatInputs()])
        self.fabric.launch()
        self.range = MiscalibrationRange.parse(options.range)
        self.folder = Path(options.output)
        config = load_preset(options.preset)
        if options.head:
            config = replace(config, head=options.head)
        self.network = CalibrationNetwork(config, self.range)
        self.network.features.load_pretrained()
        for parameter in self.network.features.pretrained_levels()[: self.FROZEN_LEVELS].parameters():
            parameter.requires_grad_(False)
        start = load_network(Path(options.initialize)) if options.initialize else None
        if start is not None:
            self._start_from(start)
            if config.share_image_branch and not options.train_image_branch:
                for name, parameter in self.network.features.named_parameters():
                    parameter.requires_grad_(not name.startswith("image_"))
        sources, held_out = training_sources(
            options.data, options.validate, options.synthetic, options.scenes, options.seed,
            Path(options.scene_cache) if options.scene_cache else None,
        )  # fmt: skip
        self.warm_up = self.WARM_UP if options.initialize is None else 0
        if options.warm_up is not None:
            self.warm_up = options.warm_up
        if not config.hybrid_loss:
            self.warm_up = 0
        if options.samples:
            self.warm_up = min(self.warm_up, options.samples // 3)
        number = RANGES.index(self.range) + 1 if self.range in RANGES else 0
        self.manifest = load_manifest(options.preset, self.folder)
        settings = self.manifest.settings(self.range)
        self.stage = Stage(number, self.range, self.network, settings)
        zoom = settings.image_size
        area = config.input_height * config.input_width * min(zoom, 1.0) ** 2
        self.data = TrainingSamples(
            sources, self.range, config.volume_scales, area, options.batch, options.seed, self.warm_up, max(zoom, 1.0)
        )
        if not config.hybrid_loss:
            self.data.features_every = 0
        if options.after:
            self._draw_residuals(Path(options.after), start)
        self.average = AveragedModel(self.network, multi_avg_fn=get_ema_multi_avg_fn(0.995))
        optimizer = torch.optim.AdamW(self._parameters(), lr=options.learning_rate, weight_decay=1e-4)
        self.validation = Validation(held_out, self.stage, 4, options.seed) if held_out else None
        self.model, self.optimizer = self.fabric.setup(self.network, optimizer)
        self.model.mark_forward_method("match")
        self.average.to(self.fabric.device)
        self.steps, self.seconds = 0, 0.0
        if resume and self.checkpoint.exists():
            self._resume()
        elif self.checkpoint.exists():
            raise ConfigError(
                f"{self.checkpoint} is there from an earlier run: add --resume, or remove it to start again."
            )

    def _start_from(self, start: CalibrationNetwork) -> None:
        """Take over the weights of another stage; a head of another kind starts anew."""
        given = start.state_dict()
        if start.config.head != self.network.config.head:
            new = {name: tensor for name, tensor in self.network.state_dict().items() if name.startswith("pose.")}
            given = {name: tensor for name, tensor in given.items() if not name.startswith("pose.")} | new
        try:
            self.network.load_state_dict(given)
        except RuntimeError:  # lists every name and shape
            raise ConfigError(
                f"{self.options.initialize} holds another network than preset {self.options.preset}; "
                "start from weights of that preset."
            ) from None

    def _draw_residuals(self, folder: Path, start: CalibrationNetwork | None) -> None:
        """Let most miscalibrations be what the stages in ``folder`` leave, and what the start's own first look does.

        Not so the look of a neighbour of which this stage starts, nor of a stage that looks only once.
        """
        before = stages_before(self.options.preset, self.range, folder)
        again = None
        if start is not None and start.range == self.range and self.stage.settings.looks > 1:
            again = replace(self.stage, network=start.to(self.fabric.device))
        if before or again:
            self.data.residuals = residual_errors(before, self.data, self.range, self.RESIDUALS, again)
        if not before:
            self.data.residual_share = self.data.OWN_SHARE

    @property
    def checkpoint(self) -> Path:
        """The file a run is resumed from."""
        return weights_path(self.options.preset, self.range, self.folder).with_suffix(".checkpoint")

    @property
    def samples(self) -> int:
        """Samples seen so far, over all processes."""
        return self.steps * self.options.batch * self.fabric.world_size

    @property
    def share(self) -> float:
        """How much of the budget is used, 0..1."""
        if self.options.samples:
            return min(1.0, self.samples / self.options.samples)
        return min(1.0, self.seconds / (60 * (self.options.minutes or math.inf)))

    def _parameters(self) -> list[dict[str, Any]]:
        """What is trained, and at which relative learning rate."""
        pretrained = set(self.network.features.pretrained_levels().parameters())
        trained = [parameter for parameter in self.network.parameters() if parameter.requires_grad]
        groups = (
            {"params": [p for p in trained if p not in pretrained], "relative": 1.0},
            {"params": [p for p in trained if p in pretrained], "relative": self.PRETRAINED_RATE},
        )
        return [group for group in groups if group["params"]]

    def run(self) -> Path:
        """Train until the budget is used; returns the weights' path."""
        loader = DataLoader(
            self.data,
            batch_sampler=BatchNumbers(self.steps, self.options.batch, self.fabric.global_rank, self.fabric.world_size),
            collate_fn=collate,
            num_workers=self.options.workers,
            worker_init_fn=leave_signals_to_main,
            prefetch_factor=4 if self.options.workers else None,
        )
        batches = cast(Iterator[Batch], iter(self.fabric.setup_dataloaders(loader, use_distributed_sampler=False)))
        self.model.train()
        with StopRequest(STOPPING) as stop:
            try:
                finished = self._loop(batches, stop)
            except RuntimeError:
                if not stop.requested:
                    raise
                raise KeyboardInterrupt from None  # the signal ended a worker too: the last checkpoint has to do
        if not finished:
            self._save_checkpoint()
            raise KeyboardInterrupt
        self._save_checkpoint()
        if self.samples < self.warm_up:
            raise ConfigError(
                f"The budget ended after {self.samples} samples, within the warm-up of {self.warm_up}: no pose is "
                "trained yet, and no weights are written. Continue with --resume and more --minutes."
            )
        return self._save_weights(self._validate())

    def _loop(self, batches: Iterator[Batch], stop: StopRequest) -> bool:
        """Step until the budget is used (True) or a stop is requested (False)."""
        started = self.seconds - time.monotonic()
        reported = checkpointed = validated = self.seconds
        steps_reported, means, stopping = self.steps, Means(), False
        while self.share < 1.0 and not stopping:
            inputs, target = next_batch(batches)
            means.add(self._step(inputs, target))
            # all processes must take the same steps, at the same learning rate
            self.seconds, stopping = self.fabric.broadcast((started + time.monotonic(), stop.requested))
            if self.seconds - reported > self.REPORT_SECONDS:
                rate = (self.steps - steps_reported) * self.options.batch / (self.seconds - reported)
                self.observer.progressed(self._progress(rate, means.take()))
                reported, steps_reported = self.seconds, self.steps
            if self.seconds - checkpointed > self.CHECKPOINT_SECONDS:
                self._save_checkpoint()
                checkpointed = self.seconds
            if self.seconds - validated > self.VALIDATION_SECONDS:
                self._validate()
                validated = self.seconds
        return not stopping

    def _step(self, inputs: NetworkInputs, target: Target) -> Losses:
        rate = self.options.learning_rate * min(1.0, (self.share + 1e-3) / self.RATE_RAMP)
        cosine = 0.5 * (1 + math.cos(math.pi * self.share))
        for group in self.optimizer.param_groups:
            group["lr"] = group["relative"] * rate * (self.FINAL_RATE + (1 - self.FINAL_RATE) * cosine)
        losses = self._losses(inputs, target)
        if not torch.isfinite(losses.total):
            raise CalibrationError(
                f"The loss became {losses.total.item()} after {self.samples} samples; resume from {self.checkpoint} "
                "with a lower --learning-rate."
            )
        self.optimizer.zero_grad(set_to_none=True)
        self.fabric.backward(losses.total)
        self.fabric.clip_gradients(self.model, self.optimizer, max_norm=1.0)
        self.optimizer.step()
        self.average.update_parameters(self.network)
        self.steps += 1
        return losses

    def _losses(self, inputs: NetworkInputs, target: Target) -> Losses:
        config = self.network.config
        if target.of_features:
            return Losses.of_features(feature_loss(self.model.match(inputs), inputs, target, config))
        pose_share = min(1.0, (self.samples - self.warm_up) / self.POSE_RAMP) if self.warm_up else 1.0
        return hybrid_loss(self.model(inputs), inputs, target, config, pose_share)

    def _progress(self, rate: float, losses: dict[str, float]) -> Progress:
        return Progress(self.samples, self.seconds / 60, self.share, rate, losses)

    def _validate(self) -> ValidationFigures | None:
        if self.validation is None:
            return None
        figures = self.validation(cast(CalibrationNetwork, self.average.module))
        self.observer.validated(self._progress(0.0, {}), figures)
        return figures

    def _save_checkpoint(self) -> None:
        state = {"steps": self.steps, "seconds": self.seconds, "options": asdict(self.options)}
        if self.fabric.is_global_zero:
            save_checkpoint(self.checkpoint, self.network, self.average, self.optimizer.optimizer, state)

    def _resume(self) -> None:
        tensors, state = read_checkpoint(self.checkpoint)
        theirs, ours = state["options"], asdict(self.options)
        if any(theirs.get(key) != ours[key] for key in ("preset", "range", "head")):
            raise ConfigError(f"{self.checkpoint} is of another preset, range or head; choose another --output folder.")
        restore(tensors, self.network, self.average, self.optimizer.optimizer)
        self.steps, self.seconds = int(state["steps"]), float(state["seconds"])

    def _save_weights(self, figures: ValidationFigures | None) -> Path:
        record = training_record(self.options, self.samples, self.seconds / 60, self.fabric.device.type, figures)
        path = weights_path(self.options.preset, self.range, self.folder)
        if self.fabric.is_global_zero:
            save_network(path, self.network, self.average.module.state_dict(), record)
            validation = figures._asdict() if figures else {}
            entry = StageEntry(self.range, path.name, self.stage.settings, self.folder.name, "", validation)
            self.manifest.with_stage(entry).write(manifest_path(self.options.preset, self.folder))
        return path
