"""A frame's image as the stages see it: resized and run through an image branch, once for all that share both."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from calibnet.datasets.frame import Frame
from calibnet.datasets.images import resize_image
from calibnet.network.network import CalibrationNetwork


class View(NamedTuple):
    """A frame's image at the size some stages want: ``[1, 3, H, W]``, and what their image branch makes of it."""

    image: Tensor
    features: list[Tensor]


def image_views(
    networks: Sequence[CalibrationNetwork], branches: Sequence[int], frame: Frame, clock: Callable[[str], None]
) -> dict[tuple[int, int, int], View]:
    """A frame's image at every size that a stage wants, and its features: once for all stages that share them.

    Args:
        networks: of the stages, all on one device.
        branches: of each, see `image_branches`.
        frame: whose image.
        clock: called with ``"resize"`` and ``"image_features"`` when each is done.

    Returns:
        The views by image branch, width and height.
    """
    views: dict[tuple[int, int, int], View] = {}
    for network, branch in zip(networks, branches, strict=True):
        camera = network.input_camera(frame.camera)
        if (branch, camera.width, camera.height) in views:
            continue
        device = next(network.parameters()).device
        image = torch.from_numpy(resize_image(frame.image, camera)).permute(2, 0, 1)[None].to(device)
        clock("resize")
        views[branch, camera.width, camera.height] = View(image, network.features.image(image))
        clock("image_features")
    return views


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
