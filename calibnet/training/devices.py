"""The devices a run uses, and the precision it computes in."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Any

import torch
from lightning_fabric import Fabric
from lightning_fabric.plugins.precision import MixedPrecision

from calibnet.runtime.precision import autocast


def launch() -> Fabric:
    """One process for each GPU, or one on the CPU."""
    # the warm-up does not use most of the network, and later stages freeze the image branch
    strategy = "ddp_find_unused_parameters_true" if torch.cuda.device_count() > 1 else "auto"
    fabric = Fabric(accelerator="auto", devices="auto", strategy=strategy, plugins=[FloatInputs()])
    fabric.launch()
    return fabric


class FloatInputs(MixedPrecision):
    """Autocast to bf16 where that is faster; inputs stay in float32, as rounded points would be off by decimetres."""

    def __init__(self) -> None:
        super().__init__("bf16-mixed", device="cuda" if torch.cuda.is_available() else "cpu")

    def forward_context(self) -> AbstractContextManager[Any]:
        """Autocast only where the hardware has bf16."""
        return autocast(torch.device(self.device))

    def convert_input(self, data: Any) -> Any:
        """Keep the inputs as they are."""
        return data
