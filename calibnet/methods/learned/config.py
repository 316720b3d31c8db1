"""The configuration of a network of another paper: its name and input size."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True)
class MethodConfig:
    """The configuration of such a network, as stored in a file of weights.

    Attributes:
        name: name of the method, see `calibnet.methods.learned.networks.NETWORKS`.
        input_height: height of the input; scans are projected at a size of this area with the frame's own aspect.
        input_width: width of the input.
    """

    name: str
    input_height: int = 256
    input_width: int = 512

    scales: ClassVar[tuple[int, ...]] = (8, 16, 32)
    """Strides of the cells whose points the losses use."""
    trains_features: ClassVar[bool] = False
    """Whether some batches train the features alone, as our network needs."""
    image_encoder: ClassVar[str] = "own"
    share_image_branch: ClassVar[bool] = False
