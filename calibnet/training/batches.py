"""Endless batches for the loop: which samples, from which processes."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from typing import TypeVar, cast

import cv2
from lightning_fabric import Fabric
from torch.utils.data import DataLoader, Dataset, Sampler

from calibnet.errors import CalibnetError
from calibnet.network.batch import NetworkInputs
from calibnet.network.target import Target
from calibnet.runtime.interruption import SIGNALS
from calibnet.training.on_device.batches import DeviceSamples
from calibnet.training.samples import TrainingSamples, collate

Part = TypeVar("Part")
Whole = TypeVar("Whole")
Batch = tuple[NetworkInputs, Target]


class BatchNumbers(Sampler[list[int]]):
    """Sample numbers batch by batch, from any batch on; every process of several takes its own."""

    def __init__(self, first: int, batch: int, rank: int, world: int) -> None:
        self.first, self.batch, self.rank, self.world = first, batch, rank, world

    @classmethod
    def of(cls, fabric: Fabric, first: int, batch: int) -> BatchNumbers:
        """Those of this process."""
        return cls(first, batch, fabric.global_rank, fabric.world_size)

    def __iter__(self) -> Iterator[list[int]]:
        number = self.first * self.world + self.rank
        while True:
            yield list(range(number * self.batch, (number + 1) * self.batch))
            number += self.world


def open_batches(
    fabric: Fabric, samples: TrainingSamples | DeviceSamples, first: int, batch: int, workers: int
) -> Iterator[Batch]:
    """All batches from number ``first`` on, on the fabric's device; so many other processes prepare, or draw, them."""
    if isinstance(samples, DeviceSamples):
        drawn = samples.drawn
        return samples.made(_load(fabric, drawn, drawn.collate, BatchNumbers.of(fabric, first, batch), workers))
    return _load(fabric, samples, collate, BatchNumbers.of(fabric, first, batch), workers)


def _load(
    fabric: Fabric,
    samples: Dataset[Part],
    collate: Callable[[list[Part]], Whole],
    numbers: BatchNumbers,
    workers: int,
) -> Iterator[Whole]:
    """Collated samples, by their numbers, on the fabric's device."""
    # workers that have OpenCV's threads for all cores each hinder one another; told after the fork, they wait for ever
    cv2.setNumThreads(1)
    loader = DataLoader(
        samples,
        batch_sampler=numbers,
        collate_fn=collate,
        num_workers=workers,
        worker_init_fn=leave_signals_to_main,
        prefetch_factor=4 if workers else None,
        pin_memory=fabric.device.type == "cuda",
    )
    return cast(Iterator[Whole], iter(fabric.setup_dataloaders(loader, use_distributed_sampler=False)))


def next_batch(batches: Iterator[Batch]) -> Batch:
    """The next batch; an error from a worker comes with its traceback as text: keep the sentence.

    The error's own traceback, which goes round in a circle, would keep the workers, and these the process, alive.
    """
    try:
        return next(batches)
    except Exception as error:
        failure = error.with_traceback(None)
    if isinstance(failure, CalibnetError):
        kind = type(failure)
        raise kind(str(failure).rpartition(f"{kind.__name__}: ")[2].strip())
    raise failure


def leave_signals_to_main(worker: int) -> None:
    """A signal may reach the whole process group; a worker ends when the main process has finished its step."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
