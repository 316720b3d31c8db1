from __future__ import annotations

import gc
import math
import multiprocessing
import os
import signal
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors.torch import load_file

from calibnet.datasets.images.files import resize_image
from calibnet.errors import CalibnetError, ConfigError, DatasetError, WeightsError
from calibnet.geometry import RANGES, miscalibration
from calibnet.network.efficientnet import load_weights
from calibnet.network.network import CalibrationNetwork
from calibnet.runtime.claim import BusyError, locked
from calibnet.training import build as build_module
from calibnet.training import trainer as trainer_module
from calibnet.training.losses import cosines_loss
from calibnet.training.recipe import RECIPE
from calibnet.training.samples import collate, make_sample
from calibnet.weights import load_network, read_record
from calibnet.weights.manifest import Manifest, load_manifest, manifest_path
from tests.calibnet.training.tiny_run import BATCH, Watcher, options, trainer_of
from tests.support.scene import Scenes, make_frame
from tests.support.tiny import TINY


def held_out_matching(network: CalibrationNetwork) -> float:
    """The features' loss on scenes that are not trained on."""
    generator = np.random.default_rng(5)
    large = [make_frame(seed) for seed in range(90, 96)]
    cameras = [frame.camera.fitted(TINY.input_height, TINY.input_width, 32) for frame in large]
    frames = [
        replace(frame, image=resize_image(frame.image, camera), camera=camera)
        for frame, camera in zip(large, cameras, strict=True)
    ]
    inputs, target = collate(
        [
            make_sample(
                frame,
                miscalibration(generator.uniform(-3, 3, 3), generator.uniform(-0.3, 0.3, 3)),
                TINY.scales,
                RECIPE.sample,
            )
            for frame in frames
        ]
    )
    with torch.no_grad():
        return float(cosines_loss(network.match(inputs), inputs, target, TINY, RECIPE.losses))


def test_training_teaches_the_features_to_match(tiny_world: Scenes, tmp_path: Path) -> None:
    trainer = trainer_of(options(tmp_path, batches=25, learning_rate=4e-3, warm_up=25 * BATCH))
    guessing = math.log(TINY.window**2)
    assert held_out_matching(trainer.network) > guessing
    trainer.run()
    assert held_out_matching(trainer.network) < guessing - 0.2


def test_two_runs_of_a_stage_do_not_write_one_folder(tiny_world: Scenes, tmp_path: Path) -> None:
    first, second = (trainer_of(options(tmp_path, batches=2)) for _ in range(2))
    with locked(first.checkpoint), pytest.raises(BusyError, match=r"checkpoint is being written by another run"):
        second.run()
    assert not list(tmp_path.iterdir()), "nothing of the second is written"
    first.run()


def test_a_run_ends_with_weights_a_record_and_figures(tiny_world: Scenes, tmp_path: Path) -> None:
    watcher = Watcher()
    path = trainer_of(options(tmp_path, batches=3, seed=7), watcher=watcher).run()
    assert path == tmp_path / "tiny-5deg-0.5m.safetensors"
    network = load_network(path)
    assert network.range == RANGES[2] and not network.training
    record = read_record(path)
    assert record["samples"] == 3 * BATCH and record["options"]["seed"] == 7
    assert watcher.figures and record["validation"] == watcher.figures[-1]._asdict()
    assert watcher.figures[-1].samples == 4 and watcher.figures[-1].initial_rotation_deg > 0.5


def interrupted(scenes: Scenes, folder: Path, at_read: int, **changes: Any) -> None:
    """Start a run that is told to stop while it reads frames."""
    scenes.reads = 0
    scenes.on_read = lambda reads: os.kill(os.getpid(), signal.SIGTERM) if reads == at_read else None
    with pytest.raises(KeyboardInterrupt):
        trainer_of(options(folder, **changes)).run()
    scenes.on_read = lambda reads: None


def test_a_resumed_run_ends_with_the_very_same_weights(tiny_world: Scenes, tmp_path: Path) -> None:
    whole = trainer_of(options(tmp_path / "whole", batches=4)).run()
    interrupted(tiny_world, tmp_path / "halves", at_read=BATCH + 2)  # in the second of four batches
    resumed = trainer_of(options(tmp_path / "halves", batches=4), resume=True)
    assert resumed.samples == 2 * BATCH
    tensors, expected = load_file(resumed.run()), load_file(whole)
    assert tensors.keys() == expected.keys()
    assert all(torch.equal(tensors[name], expected[name]) for name in expected)
    state, reference = (load_file(tmp_path / name / "tiny-5deg-0.5m.checkpoint") for name in ("halves", "whole"))
    assert state.keys() == reference.keys() and any(name.startswith("optimizer.") for name in state)
    assert all(torch.equal(state[name], reference[name]) for name in reference)


def test_signals_are_handled_as_before_after_a_run(tiny_world: Scenes, tmp_path: Path) -> None:
    before = signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGINT)
    interrupted(tiny_world, tmp_path, at_read=1)
    assert (signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGINT)) == before


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_to_the_whole_group_ends_a_run_in_order(
    tiny_world: Scenes, tmp_path: Path, number: signal.Signals
) -> None:
    def stop_all() -> None:
        while not (workers := multiprocessing.active_children()) or trainer.steps < 3:
            time.sleep(0.01)
        for process in (multiprocessing.current_process(), *workers):
            if process.pid:
                os.kill(process.pid, number)

    recipe = replace(RECIPE, pace=replace(RECIPE.pace, checkpoint_seconds=0.0))
    trainer = trainer_of(options(tmp_path, batches=10_000, workers=1), recipe)
    killer = threading.Thread(target=stop_all)
    killer.start()
    with pytest.raises(KeyboardInterrupt):
        trainer.run()
    killer.join()
    resumed = trainer_of(options(tmp_path, batches=10_000), resume=True)
    assert resumed.steps == trainer.steps, "workers wait for the step's end"


def test_an_earlier_run_is_not_overwritten_by_accident(tiny_world: Scenes, tmp_path: Path) -> None:
    trainer_of(options(tmp_path, batches=1)).run()
    with pytest.raises(ConfigError, match=r"tiny-5deg-0\.5m\.checkpoint.*--resume"):
        trainer_of(options(tmp_path))


@pytest.mark.parametrize("keep", [0, 5, 1000, -1])
def test_a_checkpoint_cut_short_is_one_sentence(tiny_world: Scenes, tmp_path: Path, keep: int) -> None:
    trainer_of(options(tmp_path, batches=1)).run()
    checkpoint = tmp_path / "tiny-5deg-0.5m.checkpoint"
    checkpoint.write_bytes(checkpoint.read_bytes()[:keep])
    with pytest.raises(WeightsError) as raised:
        trainer_of(options(tmp_path), resume=True)
    assert str(checkpoint) in str(raised.value) and "\n" not in str(raised.value)


def test_a_checkpoint_of_something_else_is_refused(tiny_world: Scenes, tmp_path: Path) -> None:
    path = trainer_of(options(tmp_path, batches=1)).run()
    checkpoint = tmp_path / "tiny-5deg-0.5m.checkpoint"
    original = checkpoint.read_bytes()
    checkpoint.write_bytes(path.read_bytes())
    with pytest.raises(WeightsError, match="not a training checkpoint"):
        trainer_of(options(tmp_path), resume=True)
    (tmp_path / "tiny-2deg-0.2m.checkpoint").write_bytes(original)
    with pytest.raises(ConfigError, match="another preset, range, head or ablation"):
        trainer_of(options(tmp_path, range="2/0.2"), resume=True)
    checkpoint.write_bytes(original)
    with pytest.raises(ConfigError, match="another preset, range, head or ablation"):
        trainer_of(options(tmp_path, head="regression"), resume=True)


def test_another_head_than_the_presets_starts_anew_on_what_is_before_it(tiny_world: Scenes, tmp_path: Path) -> None:
    first = trainer_of(options(tmp_path / "first", batches=2)).run()
    other = options(tmp_path / "second", batches=2, head="regression", initialize=str(first))
    trainer, before = trainer_of(other), load_file(first)
    start = trainer.network.state_dict()
    assert all(torch.equal(start[name], tensor) for name, tensor in before.items())
    new = start.keys() - before.keys()
    assert new and all(name.startswith("pose.") for name in new)
    path = trainer.run()
    assert load_network(path).config.head == "regression" and read_record(path)["options"]["head"] == "regression"
    back = trainer_of(options(tmp_path / "third", initialize=str(path)))
    assert back.network.config.head == "geometric"


def test_later_stages_keep_the_image_branch_of_the_first(tiny_world: Scenes, tmp_path: Path) -> None:
    first = trainer_of(options(tmp_path, batches=2)).run()
    second = trainer_of(options(tmp_path, batches=2, range="2/0.2", initialize=str(first))).run()
    before, after = load_file(first), load_file(second)
    shared = {name for name in before if name.startswith("features.image_")}
    assert shared and all(torch.equal(before[name], after[name]) for name in shared)
    assert any(not torch.equal(before[name], after[name]) for name in before.keys() - shared)


def test_the_first_pretrained_levels_stay_as_they_are(
    tiny_world: Scenes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pretrained = replace(TINY, image_encoder="efficientnet-lite0", widths=(8, 8, 16, 16, 24))
    monkeypatch.setattr(build_module, "load_preset", lambda name: pretrained)
    trained, original = load_file(trainer_of(options(tmp_path, batches=2)).run()), load_weights()
    for level, changes in enumerate([False, False, True, True]):
        names = [name for name in original if name.startswith(f"{level}.")]
        assert names
        same = [torch.equal(trained[f"features.image_trunk.encoder.{n}"], original[n].half().float()) for n in names]
        assert all(same) is not changes, level


@pytest.mark.parametrize("workers", [0, 1])
def test_a_broken_frame_is_one_sentence_also_from_another_process(
    tiny_world: Scenes, tmp_path: Path, workers: int
) -> None:
    def broken(reads: int) -> None:
        raise DatasetError("Scan 000003.bin is cut short; copy it again.")

    trainer = trainer_of(options(tmp_path, workers=workers))
    tiny_world.on_read = broken
    with pytest.raises(CalibnetError) as raised:
        trainer.run()
    assert str(raised.value) == "Scan 000003.bin is cut short; copy it again."


@pytest.mark.parametrize("failure", [DatasetError("Scan 000003.bin is cut short."), MemoryError("none left")])
def test_a_failed_run_leaves_no_worker_that_its_process_would_wait_for(
    tiny_world: Scenes, tmp_path: Path, failure: Exception
) -> None:
    def broken(reads: int) -> None:
        raise failure

    trainer = trainer_of(options(tmp_path, workers=1))
    tiny_world.on_read = broken
    gc.disable()  # nothing may depend on when it runs
    try:
        with pytest.raises(type(failure)) as raised:
            trainer.run()
        raised.value.__traceback__ = None
        del raised
        assert not multiprocessing.active_children()
    finally:
        gc.enable()


def test_a_loss_that_is_not_a_number_stops_the_run(tiny_world: Scenes, tmp_path: Path) -> None:
    trainer = trainer_of(options(tmp_path))
    with torch.no_grad():
        trainer.network.features.lidar_stem[0].weight.fill_(float("nan"))
    with pytest.raises(CalibnetError, match="--learning-rate"):
        trainer.run()


def watched_shares(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The shares of the pose's losses, batch by batch, as training asks for them."""
    shares: list[float] = []
    real = trainer_module.hybrid_loss

    def watched(*arguments: Any) -> Any:
        shares.append(arguments[5])
        return real(*arguments)

    monkeypatch.setattr(trainer_module, "hybrid_loss", watched)
    return shares


def test_without_the_hybrid_loss_the_pose_is_learned_from_the_start(
    tiny_world: Scenes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shares = watched_shares(monkeypatch)
    monkeypatch.setattr(build_module, "load_preset", lambda name: replace(TINY, hybrid_loss=False))
    trainer_of(options(tmp_path, batches=3)).run()
    assert shares == [1.0, 1.0, 1.0]


def test_a_budget_that_ends_within_the_warm_up_writes_no_weights(tiny_world: Scenes, tmp_path: Path) -> None:
    short = replace(options(tmp_path), samples=None, minutes=1e-6, warm_up=1000)
    with pytest.raises(ConfigError, match=r"within the warm-up of 1000.*--resume"):
        trainer_of(short).run()
    assert not list(tmp_path.glob("*.safetensors"))
    assert list(tmp_path.glob("*.checkpoint"))


def test_the_manifest_is_locked_while_a_stage_is_written_into_it(
    tiny_world: Scenes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two stages that end at once would each write the manifest that they read, without the other."""
    path, seen = manifest_path("tiny", tmp_path / "runs"), []
    of_this_stage = trainer_module.manifest_with

    def during(*arguments: Any) -> Manifest:
        with pytest.raises(BusyError), locked(path):
            pass
        seen.append(path)
        return of_this_stage(*arguments)

    monkeypatch.setattr(trainer_module, "manifest_with", during)
    trainer_of(options(tmp_path / "runs")).run()
    assert seen == [path] and path.is_file()
    with locked(path):
        pass


def test_the_weights_stand_in_the_folder_s_manifest(tiny_world: Scenes, tmp_path: Path) -> None:
    watcher, folder = Watcher(), tmp_path / "mine"
    path = trainer_of(options(folder, batches=3, data=["folder:/somewhere/rigs"]), watcher=watcher).run()
    (entry,) = load_manifest("tiny", folder).stages
    assert (entry.range, entry.file, entry.run) == (RANGES[2], path.name, "mine")
    assert entry.recipe == "from random weights; 12 samples of folder:rigs, 40% synthetic scenes"
    assert entry.validation == watcher.figures[-1]._asdict()


def test_the_learning_rate_rises_and_falls_with_the_budget(tiny_world: Scenes, tmp_path: Path) -> None:
    trainer, rates = trainer_of(options(tmp_path, batches=5, learning_rate=2e-3)), []
    step = trainer._step

    def watched(*batch: Any) -> Any:
        losses = step(*batch)
        rates.append(trainer.optimizer.param_groups[0]["lr"])
        return losses

    trainer._step = watched  # type: ignore[method-assign]
    trainer.run()
    cosine = [0.5 * (1 + math.cos(math.pi * share)) for share in (0.0, 0.2, 0.4, 0.6, 0.8)]
    expected = [2e-3 * (0.02 + 0.98 * part) for part in cosine]
    expected[0] *= 1e-3 / 0.03
    assert rates == pytest.approx(expected)


def test_the_pose_s_losses_fade_in_after_the_warm_up(
    tiny_world: Scenes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shares = watched_shares(monkeypatch)
    recipe = replace(RECIPE, features=replace(RECIPE.features, pose_ramp=2 * BATCH, every=0))
    trainer_of(options(tmp_path, batches=6, warm_up=BATCH), recipe).run()
    assert shares == [0.0, 0.5, 1.0, 1.0, 1.0]
