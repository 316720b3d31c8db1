"""One stage's network, top to bottom as in the paper's figure."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from torch import Tensor, nn

from calibnet.geometry import MiscalibrationRange
from calibnet.network.aggregation import Aggregation
from calibnet.network.batch import NetworkInputs
from calibnet.network.config import NetworkConfig
from calibnet.network.cost_volume import CostVolume, matching_score
from calibnet.network.displacement import DisplacementDecoder, DisplacementField
from calibnet.network.features import FeatureExtractor
from calibnet.network.heads import HEADS
from calibnet.network.layers import channels_last
from calibnet.network.pose import Pose


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

    def __init__(self, config: NetworkConfig, range_: MiscalibrationRange) -> None:
        super().__init__()
        self.config, self.range = config, range_
        self.features = FeatureExtractor(config)
        self.cost_volumes = nn.ModuleList(CostVolume(config) for _ in config.volume_scales)
        self.aggregation = Aggregation(config)
        self.displacement = DisplacementDecoder(config)
        self.pose: nn.Module = HEADS.load(config.head)(config, range_)
        channels_last(self)

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
