"""A frame's image as the stages see it: resized and run through an image branch, once for all that share both."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import torch

from calibnet.cascade.stage import Stage, View
from calibnet.datasets.frame import Frame
from calibnet.network.network import CalibrationNetwork


def image_views(
    stages: Sequence[Stage], branches: Sequence[int], frame: Frame, clock: Callable[[str], None]
) -> list[View]:
    """Each stage's view of a frame; those that share image size and image branch have the same one.

    Args:
        stages: all on one device.
        branches: of each, see `image_branches`.
        frame: whose image.
        clock: called with ``"resize"`` and ``"image_features"`` when each is done.
    """
    views: dict[tuple[int, int, int], View] = {}
    keys = []
    for stage, branch in zip(stages, branches, strict=True):
        camera = stage.camera(frame)
        keys.append((branch, camera.width, camera.height))
        if keys[-1] not in views:
            views[keys[-1]] = stage.view(frame, clock)
    return [views[key] for key in keys]


def image_branches(networks: Sequence[CalibrationNetwork]) -> list[int]:
    """For each network the position of the first one whose image branch would compute the same features."""
    branches: list[int] = []
    for position, network in enumerate(networks):
        known = (earlier for earlier in sorted(set(branches)) if _same_image_branch(networks[earlier], network))
        branches.append(next(known, position))
    return branches


def _same_image_branch(one: CalibrationNetwork, other: CalibrationNetwork) -> bool:
    """Whether two stages would compute the same image features: then they are computed once."""
    mine, theirs = (
        {name: tensor for name, tensor in network.features.state_dict().items() if name.startswith("image_")}
        for network in (one, other)
    )
    return (
        one.config.volume_scales == other.config.volume_scales
        and mine.keys() == theirs.keys()
        and all(torch.equal(tensor, theirs[name]) for name, tensor in mine.items())
    )
