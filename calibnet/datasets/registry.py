"""The datasets by name. A new one is a class that satisfies `Sequence` and one line in `DATASETS`."""

from __future__ import annotations

import inspect
from importlib import import_module
from pathlib import Path
from typing import Any, cast

from calibnet.datasets.frame import Sequence
from calibnet.errors import ConfigError

DATASETS: dict[str, str] = {
    "kitti-odometry": "calibnet.datasets.kitti_odometry:KittiOdometry",
    "kitti-raw": "calibnet.datasets.kitti_raw:KittiRaw",
    "kitti-object": "calibnet.datasets.kitti_object:KittiObject",
    "folder": "calibnet.datasets.folder:Folder",
}
"""Dataset name to ``module:Class``, called as ``Class(root, **options)`` and imported only then."""


def dataset_names() -> tuple[str, ...]:
    """The names that `open_sequence` knows."""
    return tuple(DATASETS)


def open_sequence(dataset: str, root: Path | str, **options: Any) -> Sequence:
    """Open a sequence of a dataset by name.

    Args:
        dataset: one of `dataset_names`.
        root: the dataset's folder, as its class describes it.
        **options: what its class takes besides, for instance ``sequence="04", camera=2``.

    Raises:
        ConfigError: there is no such dataset, or it takes no such option.
        DatasetError: the folder is missing, incomplete or inconsistent.
    """
    if dataset not in DATASETS:
        raise ConfigError(f"There is no dataset {dataset!r}; choose one of {', '.join(DATASETS)}.")
    module, _, name = DATASETS[dataset].partition(":")
    source = getattr(import_module(module), name)
    try:
        inspect.signature(source).bind(root, **options)
    except TypeError as error:
        signature = ", ".join(str(parameter) for parameter in inspect.signature(source).parameters)
        raise ConfigError(f"Dataset {dataset} takes ({signature}): {error}.") from None
    return cast(Sequence, source(Path(root), **options))
