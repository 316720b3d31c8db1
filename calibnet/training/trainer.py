"""The training loop of one stage: a budget in time or samples, checkpoints, exact resuming, weights at the end."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import asdict
from pathlib import Path
from typing import cast

import torch
from torch.optim.swa_utils import AveragedModel

from calibnet.errors import CalibrationError, ConfigError
from calibnet.methods.learned.network import MethodLosses, MethodNetwork
from calibnet.network.batch import NetworkInputs
from calibnet.network.network import CalibrationNetwork
from calibnet.network.target import Target
from calibnet.runtime.claim import locked
from calibnet.runtime.interruption import StopRequest
from calibnet.runtime.writing import Kind, check_output, remove_partials
from calibnet.training.batches import Batch, next_batch, open_batches
from calibnet.training.build import Training
from calibnet.training.checkpoint import read_checkpoint, restore, save_checkpoint
from calibnet.training.losses import Losses, feature_losses, hybrid_loss
from calibnet.training.optimizer import make_optimizer, set_learning_rate, update_average
from calibnet.training.progress import Every, Means, Observer, Progress
from calibnet.training.record import manifest_with, training_record
from calibnet.training.trained import TrainedNetwork
from calibnet.training.validation import ValidationFigures
from calibnet.weights import save_network, weights_path
from calibnet.weights.manifest import manifest_path

MANIFEST_PATIENCE_S = 60.0
"""How long a run waits for others that write into the same manifest, which takes them milliseconds."""
STOPPING = "Stopping after this step; once more stops at once."


class Trainer:
    """Trains one stage within its budget; `run` ends with the weights on disk."""

    def __init__(self, training: Training, observer: Observer, resume: bool = False) -> None:
        """Put network and optimizer on the devices; with ``resume``, in the state of the checkpoint.

        Raises:
            ConfigError: there is a checkpoint but no ``resume``, or it is of another stage.
            WeightsError: the checkpoint cannot be read.
        """
        self.training, self.observer = training, observer
        self.options, self.recipe, self.fabric = training.options, training.recipe, training.fabric
        self.range, self.network = training.stage.range, training.stage.network
        self.folder = Path(self.options.output)
        self.average = AveragedModel(self.network)
        fused = self.fabric.device.type == "cuda" or None
        optimizer = make_optimizer(self.network, self.options.learning_rate, self.recipe.optimizer, fused)
        self.model, self.optimizer = self.fabric.setup(self.network, optimizer)
        if isinstance(self.network, CalibrationNetwork):
            self.model.mark_forward_method("match")
        self.average.to(self.fabric.device)
        self.steps, self.seconds = 0, 0.0
        self.total = torch.zeros((), device=self.fabric.device)
        check_output(
            weights_path(self.options.preset, self.range, self.folder), Kind.WEIGHTS
        )  # now, not after the work
        if resume and self.checkpoint.exists():
            self._resume()
        elif self.checkpoint.exists():
            raise ConfigError(
                f"{self.checkpoint} is there from an earlier run: add --resume, or remove it to start again."
            )

    @property
    def checkpoint(self) -> Path:
        """The file that a run is resumed from."""
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

    def run(self) -> Path:
        """Train until the budget is used; returns the path of the weights.

        Raises:
            KeyboardInterrupt: a signal ended the run; its checkpoint is written.
            BusyError: another process trains this stage into this folder.
            ConfigError: the budget ended within the warm-up, before any pose was trained.
            CalibrationError: the loss is not finite.
        """
        with locked(self.checkpoint) if self.fabric.is_global_zero else nullcontext():
            if self.fabric.is_global_zero:  # with the lock held, nobody else writes them
                remove_partials(self.checkpoint)
            return self._run()

    def _run(self) -> Path:
        options = self.options
        batches = open_batches(self.fabric, self.training.samples, self.steps, options.batch, options.workers)
        self.model.train()
        with StopRequest(STOPPING) as stop:
            try:
                finished = self._loop(batches, stop)
            except RuntimeError:
                if not stop.requested:
                    raise
                raise KeyboardInterrupt from None  # the signal ended a worker too; keep the last checkpoint
        self._save_checkpoint()
        if not finished:
            raise KeyboardInterrupt
        warm_up = self.recipe.features.warm_up
        if self.samples < warm_up:
            raise ConfigError(
                f"The budget ended after {self.samples} samples, within the warm-up of {warm_up}: no pose is "
                "trained yet, and no weights are written. Continue with --resume and more --minutes."
            )
        return self._save_weights(self._validate())

    def _loop(self, batches: Iterator[Batch], stop: StopRequest) -> bool:
        """Step until the budget is used (True) or a stop is requested (False)."""
        pace, started = self.recipe.pace, self.seconds - time.monotonic()
        report = Every(pace.report_seconds, self.seconds)
        checkpoint = Every(pace.checkpoint_seconds, self.seconds)
        validation = Every(pace.validation_seconds, self.seconds)
        reported, means, stopping = self.samples, Means(), False
        while self.share < 1.0 and not stopping:
            inputs, target = next_batch(batches)
            means.add(self._step(inputs, target))
            # all processes must take the same steps, at the same learning rate
            self.seconds, stopping = self.fabric.broadcast((started + time.monotonic(), stop.requested))
            if elapsed := report.due(self.seconds):
                self._require_finite()
                self.observer.progressed(self._progress((self.samples - reported) / elapsed, means.take()))
                reported = self.samples
            if checkpoint.due(self.seconds):
                self._save_checkpoint()
            if validation.due(self.seconds):
                self._validate()
        return not stopping

    def _step(self, inputs: NetworkInputs, target: Target) -> Losses | MethodLosses:
        recipe = self.recipe.optimizer
        set_learning_rate(self.optimizer.optimizer, self.options.learning_rate, self.share, recipe)
        losses = self._losses(inputs, target)
        self.optimizer.zero_grad(set_to_none=True)
        self.fabric.backward(losses.total)
        self.fabric.clip_gradients(self.model, self.optimizer, max_norm=recipe.gradient_norm, error_if_nonfinite=False)
        self.optimizer.step()
        update_average(self.average, self.network, self.steps, recipe)
        self.steps += 1
        self.total += losses.total.detach()
        return losses

    def _require_finite(self) -> None:
        """Stop a run whose loss is not finite; called now and then only, as it makes the host wait."""
        if not torch.isfinite(self.total):
            raise CalibrationError(
                f"The loss became {self.total.item()} within {self.samples} samples; resume from {self.checkpoint} "
                "with a lower --learning-rate."
            )

    def _losses(self, inputs: NetworkInputs, target: Target) -> Losses | MethodLosses:
        if isinstance(self.network, MethodNetwork):
            return self.network.losses(self.model(inputs), inputs, target)
        config, features, recipe = self.network.config, self.recipe.features, self.recipe.losses
        if target.of_features:
            return feature_losses(self.model.match(inputs), inputs, target, config, recipe)
        after = self.samples - features.warm_up
        pose_share = min(1.0, after / features.pose_ramp) if features.warm_up else 1.0
        return hybrid_loss(self.model(inputs), inputs, target, config, recipe, pose_share)

    def _progress(self, rate: float, losses: dict[str, float]) -> Progress:
        return Progress(self.samples, self.seconds / 60, self.share, rate, losses)

    def _validate(self) -> ValidationFigures | None:
        if self.training.validation is None:
            return None
        figures = self.training.validation(cast(TrainedNetwork, self.average.module))
        self.observer.validated(self._progress(0.0, {}), figures)
        return figures

    def _save_checkpoint(self) -> None:
        self._require_finite()
        if not self.recipe.pace.checkpoints:
            return
        state = {"steps": self.steps, "seconds": self.seconds, "options": asdict(self.options)}
        if self.fabric.is_global_zero:
            save_checkpoint(self.checkpoint, self.network, self.average, self.optimizer.optimizer, state)

    def _resume(self) -> None:
        tensors, state = read_checkpoint(self.checkpoint)
        theirs, ours = state.options, asdict(self.options)
        if any(theirs.get(key) != ours[key] for key in ("preset", "range", "head", "ablation")):
            raise ConfigError(
                f"{self.checkpoint} is of another preset, range, head or ablation; choose another --output folder."
            )
        restore(tensors, self.network, self.average, self.optimizer.optimizer)
        self.steps, self.seconds = state.steps, state.seconds

    def _save_weights(self, figures: ValidationFigures | None) -> Path:
        path = weights_path(self.options.preset, self.range, self.folder)
        if self.fabric.is_global_zero:
            record = training_record(self.training, self.samples, self.seconds / 60, figures)
            save_network(path, self.network, self.average.module.state_dict(), record)
            manifest = manifest_path(self.options.preset, self.folder)
            with locked(manifest, MANIFEST_PATIENCE_S):  # another stage's run may end at the same time
                manifest_with(self.training, path, self.samples, figures).write(manifest)
        return path
