"""Stages from the files of a set of weights, ready to run."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import torch

from calibnet.cascade.stage import Stage
from calibnet.errors import WeightsError
from calibnet.geometry import RANGES, MiscalibrationRange, is_finest
from calibnet.network.convolution import pack
from calibnet.runtime.precision import fastest
from calibnet.weights import load_network
from calibnet.weights.manifest import Manifest

_kept: dict[tuple[object, ...], Stage] | None = None
"""Stages that are loaded already, after `keep_weights`; None where every cascade loads its own."""


@dataclass(frozen=True)
class SkippedStage:
    """A stage that will not run, and why."""

    number: int
    range: MiscalibrationRange
    reason: str


def load_stage(number: int, manifest: Manifest, folder: Path) -> Stage | None:
    """The stage of a set of weights, ready to run; None where the set has none.

    Args:
        number: 1 (coarsest) to 5 (finest).
        manifest: of the set.
        folder: where its files lie.

    Raises:
        WeightsError: the file cannot be used, or holds another stage.
    """
    range_ = RANGES[number - 1]
    path = folder / manifest.file(range_)
    if not os.path.lexists(path):
        return None
    if _kept is None:
        return _loaded(number, manifest, path)
    key = (
        number,
        path.absolute(),
        path.stat().st_mtime_ns,
        repr(manifest.settings(range_)),
        manifest.match_error_limit_px,
    )
    if key not in _kept:
        _kept[key] = _loaded(number, manifest, path)
    return _kept[key]


def keep_weights() -> None:
    """From now on load each stage once in this process; for workers that calibrate one drive after the other."""
    global _kept
    _kept = {} if _kept is None else _kept


def _loaded(number: int, manifest: Manifest, path: Path) -> Stage:
    range_ = RANGES[number - 1]
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    network = load_network(path).to(device)
    if network.range != range_:
        raise WeightsError(f"{path} holds the weights of range {network.range}; give it its own name back.")
    pack(network, fastest(device))
    # the coarser stages' matches are coarse anyway, and the next stage looks again: only the finest one judges
    limit = manifest.match_error_limit_px if is_finest(range_) else math.inf
    return Stage(number, range_, network, manifest.settings(range_), limit)


def load_stages(
    numbers: Iterable[int], preset: str, manifest: Manifest, folder: Path
) -> tuple[list[Stage], list[SkippedStage]]:
    """Those stages of a set that have weights, and those that have none; raises as `load_stage` does."""
    loaded, skipped = list[Stage](), list[SkippedStage]()
    for number in numbers:
        range_ = RANGES[number - 1]
        if stage := load_stage(number, manifest, folder):
            loaded.append(stage)
            continue
        reason = (
            f"Stage {number} ({range_.label}) of preset {preset} has no weights: "
            f"train it with `calib-inspect train --preset {preset} --range {range_}`."
        )
        skipped.append(SkippedStage(number, range_, reason))
    return loaded, skipped
