"""One stage's network, top to bottom as in the paper's figure."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from calibnet.geometry import RANGES, MiscalibrationRange, PinholeCamera, bounds_of, orthonormal, scaled
from calibnet.network.aggregation import Aggregation
from calibnet.network.config import NetworkConfig
from calibnet.network.cost_volume import CostVolume, matching_score
from calibnet.network.displacement import DisplacementDecoder, DisplacementField
from calibnet.network.features import FeatureExtractor
from calibnet.network.inputs import input_camera
from calibnet.network.layers import channels_last
from calibnet.network.pose import HEADS, Pose


class NetworkInputs(NamedTuple):
    """A batch of frames under their initial extrinsics, at the network's input size.

    Attributes:
        image: ``[B, 3, H, W]`` RGB 0..255, any dtype.
        lidar: ``[B, 2, H', W]`` float32, sparse depth in metres (0 = empty) and intensity 0..1. Of the lowest
            ``H'`` rows, a multiple of the coarsest stride: those above them, which hold no point, may be left out.
        intrinsics: ``[B, 3, 3]`` float32.
        cells: per scale, fine to coarse, ``[B, 3, H'/s, W/s]`` float32: the nearest LiDAR point of
            each cell in the camera frame, zeros where there is none.
    """

    image: Tensor
    lidar: Tensor
    intrinsics: Tensor
    cells: list[Tensor]

    def to(self, device: torch.device) -> NetworkInputs:
        """The batch on another device."""
        cells = [part.to(device) for part in self.cells]
        return NetworkInputs(self.image.to(device), self.lidar.to(device), self.intrinsics.to(device), cells)


class Activations(NamedTuple):
    """The volumes around the hourglass, ``[B, C, D, h_s, w_s]`` per scale; kept only when asked for."""

    before: list[Tensor]
    after: list[Tensor]


class NetworkOutput(NamedTuple):
    """What one stage says of a batch.

    Attributes:
        pose: the correction.
        field: the displacement field it was read from.
        scores: per scale the raw matching score ``[B, D, h_s, w_s]``, a cosine.
        logits: per scale the aggregated score ``[B, D, h_s, w_s]``, a softmax away from a probability: what the
            raw score says, corrected by the hourglass.
        activations: only when asked for.
    """

    pose: Pose
    field: DisplacementField
    scores: list[Tensor]
    logits: list[Tensor]
    activations: Activations | None


def no_clock(part: str) -> None:
    """Time nothing."""


class CalibrationNetwork(nn.Module):
    """Features, cost volumes, 3-D hourglass, displacement field, pose."""

    def __init__(self, config: NetworkConfig, bounds: MiscalibrationRange) -> None:
        super().__init__()
        self.config, self.bounds = config, bounds
        self.features = FeatureExtractor(config)
        self.cost_volumes = nn.ModuleList(CostVolume(config) for _ in config.volume_scales)
        self.aggregation = Aggregation(config)
        self.displacement = DisplacementDecoder(config)
        self.pose = HEADS[config.head](config, bounds)
        channels_last(self)

    def input_camera(self, camera: PinholeCamera) -> PinholeCamera:
        """The camera of this stage's image of a frame."""
        config, zoom = self.config, self.config.zoom(self.bounds)
        return input_camera(camera, zoom * config.input_height, zoom * config.input_width, config.scales[-1])

    @property
    def rounds(self) -> int:
        """How often this stage runs at most, one look after the other."""
        return self.config.rounds_of(self.bounds)

    def is_settled(self, correction: NDArray[np.float64]) -> bool:
        """Whether the next stage can take over: what this look corrected (4x4) is within that one's range."""
        position = RANGES.index(self.bounds) if self.bounds in RANGES else len(RANGES)
        reach, found = RANGES[min(position + 1, len(RANGES) - 1)], bounds_of(correction)
        return found.rotation_deg <= reach.rotation_deg and found.translation_m <= reach.translation_m

    def correction(self, output: NetworkOutput) -> NDArray[np.float64]:
        """The 4x4 correction of the first frame of a batch, extended by the stage's gain."""
        estimate = output.pose.correction[0].double().cpu().numpy()
        if not np.isfinite(estimate).all():
            return estimate.astype(np.float64)
        return scaled(orthonormal(estimate), self.config.gain_of(self.bounds))

    def match(self, inputs: NetworkInputs) -> list[Tensor]:
        """Only the features and their raw matching scores ``[B, D, h_s, w_s]``: a sixth of the work of `forward`."""
        features = zip(self.features.lidar(inputs.lidar), self.features.image(inputs.image), strict=True)
        scores = [matching_score(lidar, image, self.config.radius) for lidar, image in features]
        return scores[: len(self.config.volume_scales)]

    def forward(
        self,
        inputs: NetworkInputs,
        image_features: list[Tensor] | None = None,
        keep_activations: bool = False,
        clock: Callable[[str], None] = no_clock,
    ) -> NetworkOutput:
        """Estimate the correction of a batch.

        Args:
            inputs: see `NetworkInputs`.
            image_features: of an earlier call on the same image, to save the image branch.
            keep_activations: keep the volumes around the hourglass for the inspector.
            clock: called with the name of each part when it is done.
        """
        if image_features is None:
            image_features = self.features.image(inputs.image)
            clock("image_features")
        lidar_features = self.features.lidar(inputs.lidar)
        clock("lidar_features")
        pairs = zip(self.cost_volumes, lidar_features, image_features, strict=True)
        volumes, scores = map(list, zip(*(build(lidar, image) for build, lidar, image in pairs), strict=True))
        clock("cost_volumes")
        before, after, logits = self.aggregation(volumes, scores, keep_activations)
        clock("hourglass")
        field = self.displacement(logits, lidar_features[0], inputs.cells[0])
        clock("displacement")
        pose = self.pose(field, inputs.cells[0], inputs.intrinsics)
        clock("pose")
        activations = Activations(channels_first(before), channels_first(after)) if keep_activations else None
        return NetworkOutput(pose, field, scores, logits, activations)


def channels_first(volumes: list[Tensor]) -> list[Tensor]:
    """Volumes ``[B, Dy, Dx, h, w, C]`` as ``[B, C, D, h, w]``."""
    return [volume.flatten(1, 2).movedim(-1, 1) for volume in volumes]
