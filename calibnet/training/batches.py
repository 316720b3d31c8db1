"""Endless batches for the training loop: which samples they have, and which processes prepare them."""

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
    """Sample numbers batch by batch, from batch ``first`` on; each of several training processes takes its own."""

    def __init__(self, first: int, batch: int, rank: int, world: int) -> None:
        self.first, self.batch, self.rank, self.world = first, batch, rank, world

    @classmethod
    def of(cls, fabric: Fabric, first: int, batch: int) -> BatchNumbers:
        """The numbers of this process."""
        return cls(first, batch, fabric.global_rank, fabric.world_size)

    def __iter__(self) -> Iterator[list[int]]:
        number = self.first * self.world + self.rank
        while True:
            yield list(range(number * self.batch, (number + 1) * self.batch))
            number += self.world


def open_batches(
    fabric: Fabric, samples: TrainingSamples | DeviceSamples, first: int, batch: int, workers: int
) -> Iterator[Batch]:
    """All batches from number ``first`` on, on the fabric's device; ``workers`` processes prepare or draw them."""
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
    # workers with OpenCV threads for all cores each hinder one another; set after the fork, they would wait for ever
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
    """The next batch. An error in a worker arrives with its traceback as text; only its sentence is kept.

    The error's own traceback is a reference cycle that would keep the workers alive, and these the process.
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
    """Ignore signals, which may reach the whole process group: a worker ends after the main process."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
