"""Table 3 of the paper, measured: the cost of each module of the network, and its effect (`measure_ablation`)."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from statistics import median
from typing import Any

import torch

from calibnet.cascade.cascade import Cascade
from calibnet.cascade.stage import Stage
from calibnet.datasets import Frame
from calibnet.datasets import Sequence as FrameSequence
from calibnet.datasets.selection import by_rig
from calibnet.errors import CalibrationError, WeightsError
from calibnet.evaluation.counting import total
from calibnet.evaluation.metrics import Metrics
from calibnet.evaluation.runner import draw_miscalibration
from calibnet.geometry import RANGES, MiscalibrationRange, pose_error
from calibnet.methods.card import MethodCard
from calibnet.network.config import load_preset
from calibnet.network.convolution import pack
from calibnet.network.network import CalibrationNetwork
from calibnet.runtime.precision import fastest
from calibnet.training.ablations import ABLATIONS, ablated, ablation_folder
from calibnet.weights.files import read_record, weights_path

Observer = Callable[[str, int, int], None]
"""Called with a row, the number of its runs that are done, and their total."""


def measure_ablation(
    presets: Sequence[str],
    range_: MiscalibrationRange,
    weights: Path | None,
    sequences: Sequence[FrameSequence],
    repeats: int = 1,
    seed: int = 0,
    timed: int = 3,
    observer: Observer | None = None,
) -> Iterator[dict[str, Any]]:
    """Measure the rows of each preset: parameters, multiply-adds, latency of one look, and errors after one look.

    Args:
        presets: names of presets.
        range_: range of the miscalibrations and of the weights, one of the five.
        weights: folder of weights from ``calib-inspect train --ablation NAME``; None without weights.
        sequences: frames to measure errors on, by rig; latency is measured on the first frame.
        repeats: miscalibrations per frame.
        seed: seed of the miscalibrations.
        timed: number of looks whose median time is the latency; 0 for no latency.
        observer: called with the progress.

    Yields:
        A row for each ablation and rig, as soon as it is measured; without weights, one row with a
        sentence ``why``.

    Raises:
        DatasetError: a frame cannot be read.
        ConfigError: there is no such preset.
    """
    told = observer or (lambda row, done, total: None)
    frame = sequences[0][0] if sequences else None
    for preset in presets:
        for name in ABLATIONS:
            network = CalibrationNetwork(ablated(load_preset(preset), name), range_)
            stage, card, why = _trained(preset, name, range_, weights)
            parameters, multiply_adds = total(network)
            row: dict[str, Any] = {"preset": preset, "name": name, "parameters": parameters}
            row |= {"multiply_adds": multiply_adds, "latency_ms": None, "samples_trained": card.samples_trained}
            if frame is not None and timed:
                row["latency_ms"] = latency(stage or _untrained(network, range_), frame, timed)
            if stage is None or not sequences:
                yield row | {"why": why or "No frames were given for measuring errors."}
                continue
            for rig, of_rig in by_rig(sequences).items():
                errors = _errors(stage, of_rig, repeats, seed, f"{preset}, {name}, {rig}", told)
                yield row | {"rig": rig, "in_rig": card.knows(rig)} | errors


def _trained(
    preset: str, name: str, range_: MiscalibrationRange, weights: Path | None
) -> tuple[Stage | None, MethodCard, str]:
    """The stage of a row and its card, or the reason why there is none.

    Raises:
        WeightsError: a file of weights cannot be used, or has the network of another row.
    """
    train = f"`calib-inspect train --preset {preset} --ablation {name} --range {range_} --output"
    if weights is None:
        return None, MethodCard(), f"No folder of weights was given; {train} DIR` makes them."
    folder = ablation_folder(weights, name)
    path = weights_path(preset, range_, folder)
    if not path.exists():
        return None, MethodCard(), f"Weights {path} do not exist; {train} {weights}` makes them."
    stage = Cascade.load(preset, (RANGES.index(range_) + 1,), folder).stages[0]
    wanted, found = ablated(load_preset(preset), name), stage.network.config
    if any(getattr(wanted, switch) != getattr(found, switch) for switch in ABLATIONS.values() if switch):
        raise WeightsError(
            f"{path} has the network of another row of the ablation; {train} {weights}` makes the right one."
        )
    return stage, MethodCard.trained(0, 0, [read_record(path)]), ""


def _untrained(network: CalibrationNetwork, range_: MiscalibrationRange) -> Stage:
    """A row's network with random weights, for its latency alone."""
    pack(network.eval(), fastest(torch.device("cpu")))
    return Stage(RANGES.index(range_) + 1, range_, network)


def latency(stage: Stage, frame: Frame, timed: int) -> float:
    """Median milliseconds of one look at a frame, image features included, after one look that is not timed."""
    times = []
    for _ in range(1 + timed):
        began = time.perf_counter()
        stage.look(frame, stage.view(frame), frame.camera_from_lidar)
        times.append(1000 * (time.perf_counter() - began))
    return round(median(times[1:]), 2)


def _errors(
    stage: Stage, sequences: Sequence[FrameSequence], repeats: int, seed: int, row: str, told: Observer
) -> dict[str, Any]:
    """Errors after one look of a stage; a frame that cannot be calibrated counts with its initial error."""
    errors, failed, done = [], 0, 0
    total = repeats * sum(map(len, sequences))
    told(row, 0, total)
    for sequence in sequences:
        for frame in sequence:
            view, reference = stage.view(frame), frame.camera_from_lidar
            for repeat in range(repeats):
                after = initial = draw_miscalibration(stage.range, seed, frame.index, repeat) @ reference
                try:
                    after = stage.look(frame, view, initial).after
                except CalibrationError:
                    failed += 1
                errors.append(pose_error(after, reference))
                done += 1
                told(row, done, total)
    return {"runs": len(errors), "failed": failed, **Metrics.of(errors).as_dict()}
