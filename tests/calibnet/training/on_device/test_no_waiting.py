"""Neither making a batch nor a step on it reads a number from the device: a GPU would wait for the host, and it for it.

Tensors of the device ``meta`` have shapes and no numbers, so that whatever reads one fails.
"""

from __future__ import annotations

import contextlib
from dataclasses import replace
from typing import Any, Self

import pytest
import torch

from calibnet.geometry import RANGES
from calibnet.network.network import CalibrationNetwork
from calibnet.training.losses import feature_losses, hybrid_loss
from calibnet.training.on_device import batches as batches_module
from calibnet.training.progress import Means
from calibnet.training.recipe import RECIPE
from tests.calibnet.training.on_device.test_batches import streams
from tests.support.scene import Scenes
from tests.support.tiny import TINY

META = torch.device("meta")


class Unseeded(torch.Generator):
    """Stands in for a generator, which this device has none of."""

    def manual_seed(self, seed: int) -> Self:
        return None  # type: ignore[return-value]


def without_numbers(value: Any) -> Any:
    """The same shapes on the device without numbers."""
    if isinstance(value, torch.Tensor):
        return value.to(META)
    return type(value)(*map(without_numbers, value)) if hasattr(value, "_fields") else value


def test_that_a_number_cannot_be_read_there() -> None:
    with pytest.raises((RuntimeError, NotImplementedError)):
        bool(torch.zeros(1, device=META).any())


def test_the_host_never_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch, "autocast", lambda *_, **__: contextlib.nullcontext())
    monkeypatch.setattr(batches_module, "to_host", lambda tensor: (torch.tensor([1, 4]), None))
    _, samples = streams(Scenes(), RECIPE)
    drawn = samples.drawn.collate([samples.drawn[number] for number in range(4)])
    store = samples.store
    scans, points = store.scans.to(META), store.points.to(META)
    samples.store = replace(store, images=store.images.to(META), scans=scans, points=points)
    samples.generator = Unseeded()
    inputs, target = samples.finished(samples.make(without_numbers(drawn)))
    assert {part.device for part in (inputs.image, inputs.lidar, *inputs.cells, *target.visible)} == {META}

    network = CalibrationNetwork(replace(TINY, head="geometric"), RANGES[2]).to(META).train()
    config, means = network.config, Means()
    for losses in (
        hybrid_loss(network(inputs), inputs, target, config, RECIPE.losses),
        feature_losses(network.match(inputs), inputs, target, config, RECIPE.losses),
    ):
        losses.total.backward()
        means.add(losses)
    assert all(p.grad is not None for p in network.features.lidar_trunk.parameters())
