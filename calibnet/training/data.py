"""Training data: sequences named by ``DATASET:ROOT[:SEQUENCE]``, the synthetic world, and the share of each."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calibnet.datasets import Sequence, dataset_names
from calibnet.datasets.discovery import find_sequences
from calibnet.errors import ConfigError, DatasetError
from calibnet.training.listed import LIST, open_list
from calibnet.training.options import TrainingOptions
from calibnet.training.synthetic_pool import SyntheticPool
from calibnet.verdict import ACCEPTED


@dataclass(frozen=True)
class Source:
    """Where training frames come from.

    Attributes:
        sequence: the frames.
        weight: how often a frame of this source is drawn, relative to the other sources.
        synthetic: whether the frames are synthetic. Their rigs vary most; they are read from disk each time, as they
            are far too many to keep in memory like the real ones.
    """

    sequence: Sequence
    weight: float
    synthetic: bool = False


def training_sources(options: TrainingOptions) -> tuple[list[Source], list[Sequence]]:
    """The sources of training samples, and the validation sequences, which training never draws from.

    The weight of a real sequence is proportional to the square root of its length: a single frame of a rare sensor
    counts more than the hundredth frame of one street. All real sequences together have ``1 - options.synthetic``.

    Raises:
        ConfigError: there is nothing to train on.
    """
    validation = validation_sequences(options)
    held_out = {sequence.name for sequence in validation}
    real = [sequence for spec in options.data for sequence in open_data(spec) if sequence.name not in held_out]
    sources: list[Source] = []
    if real and options.synthetic < 1:
        roots = np.sqrt([len(sequence) for sequence in real])
        weights = (1 - options.synthetic) * roots / roots.sum()
        sources = [Source(sequence, float(weight)) for sequence, weight in zip(real, weights, strict=True)]
    if options.synthetic > 0:
        cache = Path(options.scene_cache) if options.scene_cache else None
        pool = SyntheticPool(options.scenes, options.seed, cache)
        sources.append(Source(pool, options.synthetic, synthetic=True))
    if not sources:
        raise ConfigError("There is no training data; give --data, or a --synthetic share above 0.")
    return sources, validation


def validation_sequences(options: TrainingOptions) -> list[Sequence]:
    """The held-out frames, which training never draws from."""
    return [sequence for spec in options.validate for sequence in open_data(spec)]


def open_data(spec: str) -> list[Sequence]:
    """All sequences, of all cameras, that a text ``DATASET:ROOT[:SEQUENCE]`` names.

    ``kitti-raw:DIR`` is every drive under DIR, ``kitti-raw:DIR:2011_09_26/0048`` one of them,
    ``kitti-object:DIR:train`` a split, ``folder:DIR`` a folder of your own or a folder of such folders;
    ``list:fleet.parquet`` the accepted drives of a fleet, ``list:fleet.parquet:cannot tell`` those of another verdict.

    Raises:
        ConfigError: the text is not of this form.
        DatasetError: there is nothing to read there.
    """
    dataset, _, rest = spec.partition(":")
    root_text, _, name = rest.partition(":")
    if dataset == LIST and root_text:
        listed = list(open_list(Path(root_text), name))
        if not listed:
            raise DatasetError(f"{root_text} has no drive that is {name or ACCEPTED}; give a list that has some.")
        return listed
    if dataset not in dataset_names() or not root_text:
        raise ConfigError(
            f"Data {spec!r} is not of the form DATASET:FOLDER[:SEQUENCE] with DATASET one of "
            f"{', '.join(dataset_names())}."
        )
    root = Path(root_text)
    if not root.is_dir():
        raise DatasetError(f"Folder {root} of {spec!r} does not exist; check the path.")
    found = list(find_sequences(dataset, root, name))
    if not found:
        raise DatasetError(
            f"No sequence of dataset {dataset} was found for {spec!r}; check the folder and the sequence's name."
        )
    return found
