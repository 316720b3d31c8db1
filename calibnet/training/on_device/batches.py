"""Batches from draws: the samples that `calibnet.training.samples` would make, all of a batch at once."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import torch
from torch import Tensor

from calibnet.network.batch import Cut, NetworkInputs
from calibnet.network.target import Target
from calibnet.training.on_device.draws import DrawnBatch, DrawnSamples
from calibnet.training.on_device.pictures import exposed, warped
from calibnet.training.on_device.scans import Cells, Scans, rescanned, see
from calibnet.training.on_device.store import FrameStore
from calibnet.training.samples import SampleNumbers

Batch = tuple[NetworkInputs, Target]
AT_ONCE = 16
"""Pictures that are warped together: as they are stored and in single precision, they are large."""


class Whole(NamedTuple):
    """A batch whose empty rows are not cut yet, and what the host has to know for that, on its way there.

    Attributes:
        image: ``[B, 3, H, W]`` uint8.
        seen: of the scans.
        drawn: what the rest is in.
        row: the topmost row of the coarsest scale with a point, and how many samples are good; on the host.
        arrived: the event after which ``row`` is there; None where host and device are one.
    """

    image: Tensor
    seen: Cells
    drawn: DrawnBatch
    row: Tensor
    arrived: torch.cuda.Event | None


class DeviceSamples(SampleNumbers):
    """An endless, random and repeatable stream of batches, made on the device of a store."""

    def __init__(self, samples: SampleNumbers, store: FrameStore) -> None:
        """The samples whose numbers and draws are those of ``samples``, from frames of its sources in a store."""
        super().__init__(samples.frames, samples.draws, samples.scales)
        self.store = store
        self.drawn = DrawnSamples(samples, store.cameras, store.extrinsics, store.points.tolist(), store.first)
        self.generator = torch.Generator(store.device)

    def made(self, drawn: Iterator[DrawnBatch]) -> Iterator[Batch]:
        """Batches of draws, which lie on the store's device.

        One is always made ahead: when the host waits for what it has to know of a batch, the device has long passed
        it and works on the training step before.

        Raises:
            DatasetError: no sample of a batch shows enough points.
        """
        ahead = self.make(next(drawn))
        while True:
            whole, ahead = ahead, self.make(next(drawn))
            yield self.finished(whole)

    def make(self, drawn: DrawnBatch) -> Whole:
        """All that the device can do without the host."""
        store, generator = self.store, self.generator.manual_seed(drawn.seed)
        points = store.scans[drawn.frames, :, : drawn.most_points]
        there = torch.arange(drawn.most_points, device=store.device) < store.points[drawn.frames, None]
        x, y, z, intensity = points.unbind(1)
        scans = rescanned(Scans(x, y, z, intensity, there), drawn.scanners, generator)
        where = drawn.initial, drawn.reference, drawn.correction, drawn.intrinsics, drawn.shift
        seen = see(scans, *where, drawn.size, self.scales, self.recipe)
        count = 2 if drawn.most_shrunk <= 2 else 3
        some = zip(*(part.split(AT_ONCE) for part in (drawn.frames, drawn.to_picture, drawn.shrinking)), strict=True)
        pictures = [warped(store.pictures[frames], to, shrinking, drawn.size, count) for frames, to, shrinking in some]
        image = exposed(torch.cat(pictures), drawn.exposures, generator)
        good = seen.visible[0].flatten(1).sum(1) >= self.recipe.fewest_visible_cells
        chosen = good_ones(good)
        seen = Cells(seen.image[chosen], *([scale[chosen] for scale in of] for of in seen[1:]))
        drawn = drawn._replace(
            correction=drawn.correction[chosen], intrinsics=drawn.intrinsics[chosen], shift=drawn.shift[chosen]
        )
        occupied = (seen.cells[-1][:, 2] > 0).any(2).any(0)
        row, arrived = to_host(torch.stack([occupied.int().argmax(), good.sum()]))
        return Whole(image[chosen], seen, drawn, row, arrived)

    def finished(self, whole: Whole) -> Batch:
        """The batch without the rows that hold no point."""
        if whole.arrived is not None:
            whole.arrived.synchronize()
        rows, good = whole.row.tolist()
        if not good:
            raise self.too_few(f"frame {whole.drawn.frames[-1]} of those on the device")
        cells, drawn = whole.seen.cells, whole.drawn
        cut = Cut(rows, cells[-1].shape[-2])

        def lower(tensor: Tensor) -> Tensor:
            return tensor[..., cut.rows * (tensor.shape[-2] // cut.height) :, :].contiguous()

        inputs = NetworkInputs(whole.image, lower(whole.seen.image), drawn.intrinsics, [lower(of) for of in cells])
        visible = [lower(mask) for mask in whole.seen.visible]
        return inputs, Target(drawn.correction, drawn.shift, visible, drawn.of_features)


def good_ones(good: Tensor) -> Tensor:
    """Samples ``[B]`` to take, of ``[B]`` bool: the good ones, and instead of each other one one of these."""
    first = torch.argsort(~good, stable=True)
    number = torch.arange(len(good), device=good.device)
    return torch.where(good, number, first[number % good.sum().clamp(min=1)])


def to_host(tensor: Tensor) -> tuple[Tensor, torch.cuda.Event | None]:
    """A copy on the host, and the event after which it is there; nobody waits for it here."""
    if tensor.device.type != "cuda":
        return tensor, None
    copy = torch.empty_like(tensor, device="cpu", pin_memory=True).copy_(tensor, non_blocking=True)
    event = torch.cuda.Event()
    event.record()
    return copy, event
