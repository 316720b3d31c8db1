"""A frame's image as input of the stages: resized and run through an image branch, once for all that share both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch

from calibnet.cascade.stage import Stage, View
from calibnet.datasets.frame import Frame
from calibnet.network.network import CalibrationNetwork
from calibnet.runtime.clock import Clock


class ImageViews:
    """A frame's image for the stages; stages with the same image size and image branch share one view.

    Its points are stored coordinate by coordinate, as every projection reads them.
    """

    def __init__(self, frame: Frame, clock: Clock) -> None:
        """Make views of ``frame``; ``clock`` is called with ``"resize"`` and ``"image_features"`` when each is done."""
        self.frame, self.clock = replace(frame, points=np.asfortranarray(frame.points)), clock
        self._views: dict[tuple[int, ...], View] = {}

    def of(self, stage: Stage, branch: int) -> View:
        """The view of a stage, whose image branch is that of the stage at position ``branch``; see `image_branches`."""
        seen = [self.frame.through(face) for face in self.frame.faces] or [self.frame]
        cameras = map(stage.camera, seen)
        key = branch, *(size for camera in cameras for size in (camera.width, camera.height))
        if key not in self._views:
            self.clock.skip()  # stages measure their own time
            of_this_size = (view for known, view in self._views.items() if known[1:] == key[1:])
            self._views[key] = stage.view(self.frame, self.clock, next(of_this_size, None))
        return self._views[key]


def image_branches(networks: Sequence[CalibrationNetwork]) -> list[int]:
    """For each network, the position of the first one whose image branch computes the same features."""
    branches: list[int] = []
    for position, network in enumerate(networks):
        known = (earlier for earlier in sorted(set(branches)) if _same_image_branch(networks[earlier], network))
        branches.append(next(known, position))
    return branches


def _same_image_branch(one: CalibrationNetwork, other: CalibrationNetwork) -> bool:
    """Whether two networks compute the same image features."""
    mine, theirs = (
        {name: tensor for name, tensor in network.features.state_dict().items() if name.startswith("image_")}
        for network in (one, other)
    )
    return (
        one.config.volume_scales == other.config.volume_scales
        and mine.keys() == theirs.keys()
        and all(torch.equal(tensor, theirs[name]) for name, tensor in mine.items())
    )
