"""One stage's network, top to bottom as in the paper's figure; `calibnet.network` shows it with the shapes."""

from __future__ import annotations

from typing import NamedTuple

from torch import Tensor, nn

from calibnet.geometry import MiscalibrationRange
from calibnet.network.aggregation import Activations, Aggregation
from calibnet.network.batch import NetworkInputs
from calibnet.network.config import NetworkConfig
from calibnet.network.cost_volume import CostVolumes, cosine
from calibnet.network.displacement import DisplacementDecoder, DisplacementField
from calibnet.network.features import FeatureExtractor
from calibnet.network.heads import HEADS
from calibnet.network.layers import channels_last
from calibnet.network.pose import Pose


class NetworkOutput(NamedTuple):
    """The output of one stage for a batch.

    Attributes:
        pose: the correction.
        field: the displacement field it was read from.
        scores: per scale the cosine ``[B, D, h_s, w_s]`` of the features.
        logits: per scale the aggregated score ``[B, D, h_s, w_s]``, a softmax away from a probability.
        activations: only when asked for.
    """

    pose: Pose
    field: DisplacementField
    scores: list[Tensor]
    logits: list[Tensor]
    activations: Activations | None


class CalibrationNetwork(nn.Module):
    """Features, cost volumes, 3-D hourglass, displacement field, pose."""

    def __init__(self, config: NetworkConfig, range_: MiscalibrationRange) -> None:
        super().__init__()
        self.config, self.range = config, range_
        self.features = FeatureExtractor(config)
        self.cost_volumes = CostVolumes(config)
        self.aggregation = Aggregation(config)
        self.displacement = DisplacementDecoder(config)
        self.pose: nn.Module = HEADS.load(config.head)(config, range_)
        channels_last(self)

    def forward(
        self, inputs: NetworkInputs, image_features: list[Tensor] | None = None, keep_activations: bool = False
    ) -> NetworkOutput:
        """Estimate the correction of a batch.

        Args:
            inputs: see `NetworkInputs`.
            image_features: of an earlier call on the same image, to save the image branch.
            keep_activations: keep the volumes around the hourglass for the inspector.
        """
        features = self.features(inputs, image_features)
        volumes = self.cost_volumes(features)
        aggregated = self.aggregation(volumes, keep_activations)
        field = self.displacement(aggregated.logits, features.lidar[0], inputs.cells[0])
        pose = self.pose(field, inputs.cells[0], inputs.intrinsics)
        scores = [volume.score for volume in volumes]
        return NetworkOutput(pose, field, scores, aggregated.logits, aggregated.activations)

    def match(self, inputs: NetworkInputs) -> list[Tensor]:
        """Only the features and their cosines ``[B, D, h_s, w_s]``: a sixth of the work of `forward`."""
        features = self.features(inputs)
        return [cosine(lidar, image, self.config.radius) for lidar, image in zip(*features, strict=True)]

    @property
    def boxes(self) -> dict[str, nn.Module]:
        """The boxes of the figure in the order in which they run, by the names under which times are recorded."""
        return {
            "lidar_features": self.features,  # the image's features are computed before, once for all looks
            "cost_volumes": self.cost_volumes,
            "hourglass": self.aggregation,
            "displacement": self.displacement,
            "pose": self.pose,
        }
