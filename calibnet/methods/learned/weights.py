"""Loads the weights of other papers' methods from a folder with a manifest; the package ships none."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import torch
from safetensors.torch import load_file

from calibnet.errors import ConfigError, WeightsError
from calibnet.geometry import RANGES, MiscalibrationRange
from calibnet.methods.learned.config import MethodConfig
from calibnet.methods.learned.network import MethodNetwork
from calibnet.methods.learned.networks import NETWORKS, method_network
from calibnet.methods.learned.stage import MethodStage
from calibnet.runtime.schema import validated
from calibnet.weights.files import read_header, weights_path
from calibnet.weights.manifest import Manifest, StageSettings, load_manifest

REMEDY = "train it again with `calib-inspect train --method`"


def load_method_network(path: Path) -> MethodNetwork:
    """Load the network of a file of weights; it is in evaluation mode and single precision.

    Raises:
        WeightsError: the file is missing, cut short, of another kind or does not fit its own configuration.
    """
    header = read_header(path)
    if header.config.get("name") not in NETWORKS:
        raise WeightsError(f"{path} is not a network of {', '.join(NETWORKS.names())}; {REMEDY}.")
    config = validated(MethodConfig, header.config, f"The header of {path}", WeightsError, REMEDY)
    try:
        range_ = MiscalibrationRange.parse(header.range)
    except ConfigError as error:
        raise WeightsError(f"{path}: {error} Copy it again, or {REMEDY}.") from None
    if (config.input_height, config.input_width) != (MethodConfig.input_height, MethodConfig.input_width):
        raise WeightsError(f"{path} has another input size than the networks of this version; {REMEDY}.")
    with torch.device("meta"):  # which needs no memory
        promised = method_network(config, range_).state_dict()
    stored = load_file(path)
    if {name: t.shape for name, t in promised.items()} != {name: t.shape for name, t in stored.items()}:
        raise WeightsError(f"{path} does not fit the network of this version; {REMEDY}.")
    if not all(torch.isfinite(tensor).all() for tensor in stored.values() if tensor.is_floating_point()):
        raise WeightsError(f"{path} contains numbers that are not finite; copy it again, or {REMEDY}.")
    network = method_network(config, range_)
    network.load_state_dict(stored)
    return network.eval()


def method_settings(manifest: Manifest, range_: MiscalibrationRange) -> StageSettings:
    """Settings of a network, from the manifest or, if that has none for this range, from the paper."""
    if any(entry.range == range_ for entry in manifest.stages):
        return manifest.settings(range_)
    return replace(StageSettings(), looks=NETWORKS.load(manifest.preset).LOOKS)


def load_method_stage(name: str, range_: MiscalibrationRange, folder: Path) -> MethodStage | None:
    """The stage of a method and range, ready to run; None if the folder has no weights for it.

    Raises:
        WeightsError: the file cannot be used, or is of another method or range.
    """
    path = weights_path(name, range_, folder)
    if not os.path.lexists(path):
        return None
    network = load_method_network(path)
    if name != network.NAME or network.range != range_:
        raise WeightsError(f"{path} has the weights of {network.NAME}, {network.range}; restore its original name.")
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    settings = method_settings(load_manifest(name, folder), range_)
    return MethodStage(RANGES.index(range_) + 1 if range_ in RANGES else 0, range_, network.to(device), settings)


def missing(name: str, range_: MiscalibrationRange, folder: Path | None) -> WeightsError:
    """The error for a method that has not been trained, with the command that trains it."""
    where = f"no weights for {range_.label} in {folder}" if folder else "no weights in the package"
    return WeightsError(
        f"Method {name} has {where}; make them with `calib-inspect train --method {name} --range {range_} "
        f"--samples 10000 --packed DIR --output {folder or 'WEIGHTS'}` (or with --data instead of --packed) "
        f"and give their folder with --weights."
    )
