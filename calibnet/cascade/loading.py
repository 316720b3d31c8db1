"""Loads stages from the files of a set of weights."""

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
"""Loaded stages, after `keep_weights`; None if every cascade loads its own."""


@dataclass(frozen=True)
class SkippedStage:
    """A stage that will not run, and the reason."""

    number: int
    range: MiscalibrationRange
    reason: str


def load_stage(number: int, manifest: Manifest, folder: Path) -> Stage | None:
    """Load a stage of a set of weights; None if the set lacks it.

    Args:
        number: 1 (coarsest) to 5 (finest).
        manifest: manifest of the set.
        folder: folder of its files.

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
    """Load each stage only once in this process from now on, for workers that calibrate many drives."""
    global _kept
    _kept = {} if _kept is None else _kept


def _loaded(number: int, manifest: Manifest, path: Path) -> Stage:
    range_ = RANGES[number - 1]
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    network = load_network(path).to(device)
    if network.range != range_:
        raise WeightsError(f"{path} has the weights of range {network.range}; restore its original name.")
    pack(network, fastest(device))
    # only the finest stage judges: matches of coarser ones are coarse anyway, and the next stage looks again
    limit = manifest.match_error_limit_px if is_finest(range_) else math.inf
    return Stage(number, range_, network, manifest.settings(range_), limit)


def load_stages(
    numbers: Iterable[int], preset: str, manifest: Manifest, folder: Path
) -> tuple[list[Stage], list[SkippedStage]]:
    """Load stages of a set; returns those with weights and those without, and raises as `load_stage` does."""
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
