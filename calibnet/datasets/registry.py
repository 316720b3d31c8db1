"""The datasets by name; those of other packages register as ``calib_inspect.datasets``.

A dataset is a class whose instances are a `Sequence`, called as ``Class(root, **options)``;
`calibnet.conformance.check_dataset` tests one. One of ours needs one line in `DATASETS`.
"""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any, cast

from calibnet.datasets.frame import Sequence
from calibnet.errors import ConfigError
from calibnet.runtime.plugins import Registry

DATASETS = Registry(
    "datasets",
    "dataset",
    {
        "kitti-odometry": "calibnet.datasets.kitti.odometry:KittiOdometry",
        "kitti-raw": "calibnet.datasets.kitti.raw:KittiRaw",
        "kitti-object": "calibnet.datasets.kitti.object:KittiObject",
        "kitti-tracking": "calibnet.datasets.kitti.tracking:KittiTracking",
        "kitti-360": "calibnet.datasets.kitti.kitti360:Kitti360",
        "nuscenes": "calibnet.datasets.nuscenes.scene:NuScenes",
        "folder": "calibnet.datasets.folder:Folder",
    },
)


def dataset_names() -> tuple[str, ...]:
    """The names that `open_sequence` knows."""
    return DATASETS.names()


def open_sequence(dataset: str, root: Path | str, **options: Any) -> Sequence:
    """Open a sequence of a dataset by name.

    Args:
        dataset: one of `dataset_names`.
        root: the dataset's folder, as its class describes it.
        **options: what its class takes besides, for instance ``sequence="04", camera=2``.

    Raises:
        ConfigError: there is no such dataset, its package is broken, or it takes no such option.
        DatasetError: the folder is missing, incomplete or inconsistent.
    """
    source = DATASETS.load(dataset)
    try:
        inspect.signature(source).bind(root, **options)
    except TypeError as error:
        signature = ", ".join(str(parameter) for parameter in inspect.signature(source).parameters)
        raise ConfigError(f"Dataset {dataset} takes ({signature}): {error}.") from None
    opened = source(Path(root), **options)
    lacks = [name for name in ("name", "rig", "__len__", "__getitem__", "__iter__") if not hasattr(opened, name)]
    if lacks:
        raise ConfigError(
            f"Dataset {dataset} is not a sequence, since it lacks {', '.join(lacks)}; update its package."
        )
    return cast(Sequence, opened)
