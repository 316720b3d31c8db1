"""What a network of another paper is made of: its name and the size of its input."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True)
class MethodConfig:
    """What a weights file says of such a network.

    Attributes:
        name: of the method, see `calibnet.methods.learned.networks.NETWORKS`.
        input_height: rows of its input; scans are projected at a size of the same area and the frame's own aspect.
        input_width: columns.
    """

    name: str
    input_height: int = 256
    input_width: int = 512

    scales: ClassVar[tuple[int, ...]] = (8, 16, 32)
    """Strides of the cells whose points losses are about."""
    trains_features: ClassVar[bool] = False
    """Whether batches are made that train features alone; it is our network that needs them."""
    image_encoder: ClassVar[str] = "own"
    share_image_branch: ClassVar[bool] = False
