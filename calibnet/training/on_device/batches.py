"""Makes batches from draws: the samples that `calibnet.training.samples` would make, a whole batch at once."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import torch
from torch import Tensor

from calibnet.network.batch import Cut, NetworkInputs
from calibnet.network.target import Target
from calibnet.training.on_device.draws import DrawnBatch, DrawnSamples
from calibnet.training.on_device.images import exposed, warped
from calibnet.training.on_device.scans import Cells, Scans, rescanned, see
from calibnet.training.on_device.store import FrameStore
from calibnet.training.samples import SampleNumbers

Batch = tuple[NetworkInputs, Target]
AT_ONCE = 16
"""Number of images warped together; in single precision and at their stored size they are large."""


class Whole(NamedTuple):
    """A batch before its empty rows are cropped, with the numbers that the host needs for that still on their way.

    Attributes:
        image: ``[B, 3, H, W]`` uint8.
        seen: the scans as the camera sees them.
        drawn: the draws of the batch, which have the rest.
        row: ``[2]`` on the host: topmost row of the coarsest scale with a point, and number of good samples.
        arrived: event after which ``row`` can be read; None if host and device are the same.
    """

    image: Tensor
    seen: Cells
    drawn: DrawnBatch
    row: Tensor
    arrived: torch.cuda.Event | None


class DeviceSamples(SampleNumbers):
    """An endless, random and repeatable stream of batches, made on the device of a `FrameStore`."""

    def __init__(self, samples: SampleNumbers, store: FrameStore) -> None:
        """Use the numbers and draws of ``samples``, and the frames of its sources in ``store``."""
        super().__init__(samples.frames, samples.draws, samples.scales)
        self.store = store
        self.drawn = DrawnSamples(samples, store.cameras, store.extrinsics, store.points.tolist(), store.first)
        self.generator = torch.Generator(store.device)

    def made(self, drawn: Iterator[DrawnBatch]) -> Iterator[Batch]:
        """Make the batches of ``drawn``, which are on the store's device.

        One batch is always made ahead: when the host reads the numbers it needs of a batch, the device has long
        computed them, and is at work on the training step before.

        Raises:
            DatasetError: no sample of a batch shows enough points.
        """
        ahead = self.make(next(drawn))
        while True:
            whole, ahead = ahead, self.make(next(drawn))
            yield self.finished(whole)

    def make(self, drawn: DrawnBatch) -> Whole:
        """Make a batch as far as the device can without the host."""
        store, generator = self.store, self.generator.manual_seed(drawn.seed)
        points = store.scans[drawn.frames, :, : drawn.most_points]
        there = torch.arange(drawn.most_points, device=store.device) < store.points[drawn.frames, None]
        x, y, z, intensity = points.unbind(1)
        scans = rescanned(Scans(x, y, z, intensity, there), drawn.scanners, generator)
        where = drawn.initial, drawn.reference, drawn.correction, drawn.intrinsics, drawn.shift
        seen = see(scans, *where, drawn.size, self.scales, self.recipe)
        count = 2 if drawn.most_shrunk <= 2 else 3
        some = zip(*(part.split(AT_ONCE) for part in (drawn.frames, drawn.to_image, drawn.shrinking)), strict=True)
        images = [warped(store.images[frames], to, shrinking, drawn.size, count) for frames, to, shrinking in some]
        image = exposed(torch.cat(images), drawn.exposures, generator)
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
        """Crop the rows that hold no point."""
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
    """Indices ``[B]`` of the samples to use: every good one, and a good one in place of each that is not."""
    first = torch.argsort(~good, stable=True)
    number = torch.arange(len(good), device=good.device)
    return torch.where(good, number, first[number % good.sum().clamp(min=1)])


def to_host(tensor: Tensor) -> tuple[Tensor, torch.cuda.Event | None]:
    """A copy on the host, and the event after which it can be read; this does not wait for it."""
    if tensor.device.type != "cuda":
        return tensor, None
    copy = torch.empty_like(tensor, device="cpu", pin_memory=True).copy_(tensor, non_blocking=True)
    event = torch.cuda.Event()
    event.record()
    return copy, event
