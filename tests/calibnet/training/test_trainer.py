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

from calibnet.datasets.images import resize_image
from calibnet.errors import CalibnetError, ConfigError, DatasetError, WeightsError
from calibnet.geometry import RANGES, MiscalibrationRange, miscalibration
from calibnet.network.efficientnet import load_weights
from calibnet.network.network import CalibrationNetwork
from calibnet.training import trainer as trainer_module
from calibnet.training.losses import feature_loss
from calibnet.training.options import TrainingOptions
from calibnet.training.progress import Progress
from calibnet.training.samples import Source, TrainingSamples, collate, make_sample
from calibnet.training.trainer import Trainer
from calibnet.training.validation import ValidationFigures
from calibnet.weights import load_network, read_record, save_network
from calibnet.weights.manifest import Manifest, StageEntry, StageSettings, manifest_path
from tests.support.scene import Scenes, make_frame
from tests.support.tiny import TINY

BATCH = 4


class Watcher:
    """Keeps what it is told."""

    def __init__(self) -> None:
        self.progress: list[Progress] = []
        self.figures: list[ValidationFigures] = []

    def progressed(self, progress: Progress) -> None:
        self.progress.append(progress)

    def validated(self, progress: Progress, figures: ValidationFigures) -> None:
        self.figures.append(figures)


@pytest.fixture
def tiny_world(monkeypatch: pytest.MonkeyPatch) -> Scenes:
    """The trainer on a tiny network and a few made scenes."""
    scenes = Scenes()
    monkeypatch.setattr(trainer_module, "load_preset", lambda name: TINY)
    monkeypatch.setattr(trainer_module, "training_sources", lambda *_: ([Source(scenes, 1.0)], [Scenes(1)]))
    torch.set_num_threads(1)
    return scenes


def options(folder: Path, batches: int = 4, **changes: Any) -> TrainingOptions:
    values: dict[str, Any] = {"preset": "tiny", "range": "5/0.5", "output": str(folder), "workers": 0, "batch": BATCH}
    values |= {"warm_up": 2 * BATCH}
    return TrainingOptions(**values | {"samples": batches * BATCH} | changes)


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
                frame, miscalibration(generator.uniform(-3, 3, 3), generator.uniform(-0.3, 0.3, 3)), TINY.scales
            )
            for frame in frames
        ]
    )
    with torch.no_grad():
        return float(feature_loss(network.match(inputs), inputs, target, TINY))


def test_training_teaches_the_features_to_match(tiny_world: Scenes, tmp_path: Path) -> None:
    trainer = Trainer(options(tmp_path, batches=25, learning_rate=4e-3, warm_up=25 * BATCH), Watcher())
    guessing = math.log(TINY.window**2)
    assert held_out_matching(trainer.network) > guessing
    trainer.run()
    assert held_out_matching(trainer.network) < guessing - 0.2


def test_a_run_ends_with_weights_a_record_and_figures(tiny_world: Scenes, tmp_path: Path) -> None:
    watcher = Watcher()
    path = Trainer(options(tmp_path, batches=3, seed=7), watcher).run()
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
        Trainer(options(folder, **changes), Watcher()).run()
    scenes.on_read = lambda reads: None


def test_a_resumed_run_ends_with_the_very_same_weights(tiny_world: Scenes, tmp_path: Path) -> None:
    whole = Trainer(options(tmp_path / "whole", batches=4), Watcher()).run()
    interrupted(tiny_world, tmp_path / "halves", at_read=BATCH + 2)  # in the second of four batches
    resumed = Trainer(options(tmp_path / "halves", batches=4), Watcher(), resume=True)
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
    tiny_world: Scenes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: signal.Signals
) -> None:
    def stop_all() -> None:
        while not (workers := multiprocessing.active_children()) or trainer.steps < 3:
            time.sleep(0.01)
        for process in (multiprocessing.current_process(), *workers):
            if process.pid:
                os.kill(process.pid, number)

    monkeypatch.setattr(Trainer, "CHECKPOINT_SECONDS", 0.0)
    trainer = Trainer(options(tmp_path, batches=10_000, workers=1), Watcher())
    killer = threading.Thread(target=stop_all)
    killer.start()
    with pytest.raises(KeyboardInterrupt):
        trainer.run()
    killer.join()
    resumed = Trainer(options(tmp_path, batches=10_000), Watcher(), resume=True)
    assert resumed.steps == trainer.steps, "workers wait for the step's end"


def test_an_earlier_run_is_not_overwritten_by_accident(tiny_world: Scenes, tmp_path: Path) -> None:
    Trainer(options(tmp_path, batches=1), Watcher()).run()
    with pytest.raises(ConfigError, match=r"tiny-5deg-0\.5m\.checkpoint.*--resume"):
        Trainer(options(tmp_path), Watcher())


@pytest.mark.parametrize("keep", [0, 5, 1000, -1])
def test_a_checkpoint_cut_short_is_one_sentence(tiny_world: Scenes, tmp_path: Path, keep: int) -> None:
    Trainer(options(tmp_path, batches=1), Watcher()).run()
    checkpoint = tmp_path / "tiny-5deg-0.5m.checkpoint"
    checkpoint.write_bytes(checkpoint.read_bytes()[:keep])
    with pytest.raises(WeightsError) as raised:
        Trainer(options(tmp_path), Watcher(), resume=True)
    assert str(checkpoint) in str(raised.value) and "\n" not in str(raised.value)


def test_a_checkpoint_of_something_else_is_refused(tiny_world: Scenes, tmp_path: Path) -> None:
    path = Trainer(options(tmp_path, batches=1), Watcher()).run()
    checkpoint = tmp_path / "tiny-5deg-0.5m.checkpoint"
    original = checkpoint.read_bytes()
    checkpoint.write_bytes(path.read_bytes())
    with pytest.raises(WeightsError, match="not a training checkpoint"):
        Trainer(options(tmp_path), Watcher(), resume=True)
    (tmp_path / "tiny-2deg-0.2m.checkpoint").write_bytes(original)
    with pytest.raises(ConfigError, match="another preset, range or head"):
        Trainer(options(tmp_path, range="2/0.2"), Watcher(), resume=True)
    checkpoint.write_bytes(original)
    with pytest.raises(ConfigError, match="another preset, range or head"):
        Trainer(options(tmp_path, head="regression"), Watcher(), resume=True)


def test_another_head_than_the_presets_starts_anew_on_what_is_before_it(tiny_world: Scenes, tmp_path: Path) -> None:
    first = Trainer(options(tmp_path / "first", batches=2), Watcher()).run()
    other = options(tmp_path / "second", batches=2, head="regression", initialize=str(first))
    trainer, before = Trainer(other, Watcher()), load_file(first)
    start = trainer.network.state_dict()
    assert all(torch.equal(start[name], tensor) for name, tensor in before.items())
    new = start.keys() - before.keys()
    assert new and all(name.startswith("pose.") for name in new)
    path = trainer.run()
    assert load_network(path).config.head == "regression" and read_record(path)["options"]["head"] == "regression"
    back = Trainer(options(tmp_path / "third", initialize=str(path)), Watcher())
    assert back.network.config.head == "geometric"


def test_weights_of_another_network_are_no_start(
    tiny_world: Scenes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = Trainer(options(tmp_path / "first", batches=2), Watcher()).run()
    monkeypatch.setattr(trainer_module, "load_preset", lambda name: replace(TINY, context_channels=24))
    with pytest.raises(ConfigError, match=f"{first}.*another network than preset tiny") as raised:
        Trainer(options(tmp_path / "second", initialize=str(first)), Watcher())
    assert "\n" not in str(raised.value)


def test_later_stages_keep_the_image_branch_of_the_first(tiny_world: Scenes, tmp_path: Path) -> None:
    first = Trainer(options(tmp_path, batches=2), Watcher()).run()
    second = Trainer(options(tmp_path, batches=2, range="2/0.2", initialize=str(first)), Watcher()).run()
    before, after = load_file(first), load_file(second)
    shared = {name for name in before if name.startswith("features.image_")}
    assert shared and all(torch.equal(before[name], after[name]) for name in shared)
    assert any(not torch.equal(before[name], after[name]) for name in before.keys() - shared)


def test_only_a_stage_that_starts_from_itself_and_looks_again_is_shown_what_its_first_look_leaves(
    tiny_world: Scenes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def residuals(looks: int, initialize: str) -> tuple[int, float]:
        start = tmp_path / f"{looks}.safetensors"
        network = CalibrationNetwork(TINY, MiscalibrationRange.parse(initialize))
        save_network(start, network, network.state_dict(), {})
        entry = StageEntry(MiscalibrationRange(5, 0.5), start.name, StageSettings(looks=looks))
        Manifest("tiny").with_stage(entry).write(manifest_path("tiny", tmp_path / "out"))
        nothing_before = str(tmp_path / "empty")
        trainer = Trainer(options(tmp_path / "out", initialize=str(start), after=nothing_before), Watcher())
        return len(trainer.data.residuals), trainer.data.residual_share

    (tmp_path / "out").mkdir()
    monkeypatch.setattr(Trainer, "RESIDUALS", 5)
    found, share = residuals(2, "5/0.5")
    assert found > 0 and share == TrainingSamples.OWN_SHARE, "the range itself stays the larger part"
    assert residuals(1, "5/0.5")[0] == 0
    assert residuals(2, "10/1")[0] == 0


def test_the_first_pretrained_levels_stay_as_they_are(
    tiny_world: Scenes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pretrained = replace(TINY, image_encoder="efficientnet-lite0", widths=(8, 8, 16, 16, 24))
    monkeypatch.setattr(trainer_module, "load_preset", lambda name: pretrained)
    trained, original = load_file(Trainer(options(tmp_path, batches=2), Watcher()).run()), load_weights()
    for level, changes in enumerate([False, False, True, True]):
        names = [name for name in original if name.startswith(f"{level}.")]
        assert names
        same = [torch.equal(trained[f"features.image_trunk.encoder.{n}"], original[n].half().float()) for n in names]
        assert all(same) is not changes, level


def test_a_run_needs_a_budget(tiny_world: Scenes, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="--minutes or --samples"):
        Trainer(options(tmp_path, samples=None), Watcher())


@pytest.mark.parametrize("workers", [0, 1])
def test_a_broken_frame_is_one_sentence_also_from_another_process(
    tiny_world: Scenes, tmp_path: Path, workers: int
) -> None:
    def broken(reads: int) -> None:
        raise DatasetError("Scan 000003.bin is cut short; copy it again.")

    trainer = Trainer(options(tmp_path, workers=workers), Watcher())
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

    trainer = Trainer(options(tmp_path, workers=1), Watcher())
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
    trainer = Trainer(options(tmp_path), Watcher())
    with torch.no_grad():
        trainer.network.features.lidar_stem[0].weight.fill_(float("nan"))
    with pytest.raises(CalibnetError, match="--learning-rate"):
        trainer.run()


def test_without_the_hybrid_loss_the_pose_is_learned_from_the_start(
    tiny_world: Scenes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shares: list[float] = []
    real = trainer_module.hybrid_loss

    def watched(*arguments: Any) -> Any:
        shares.append(arguments[4] if len(arguments) > 4 else 1.0)
        return real(*arguments)

    monkeypatch.setattr(trainer_module, "load_preset", lambda name: replace(TINY, hybrid_loss=False))
    monkeypatch.setattr(trainer_module, "hybrid_loss", watched)
    Trainer(options(tmp_path, batches=3), Watcher()).run()
    assert shares == [1.0, 1.0, 1.0]


def test_a_budget_that_ends_within_the_warm_up_writes_no_weights(tiny_world: Scenes, tmp_path: Path) -> None:
    short = replace(options(tmp_path), samples=None, minutes=1e-6, warm_up=1000)
    with pytest.raises(ConfigError, match=r"within the warm-up of 1000.*--resume"):
        Trainer(short, Watcher()).run()
    assert not list(tmp_path.glob("*.safetensors"))
    assert list(tmp_path.glob("*.checkpoint"))
