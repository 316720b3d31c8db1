"""Endless batches for the loop: which samples, from which processes."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from typing import cast

import cv2
from lightning_fabric import Fabric
from torch.utils.data import DataLoader, Sampler

from calibnet.errors import CalibnetError
from calibnet.network.batch import NetworkInputs
from calibnet.runtime.interruption import SIGNALS
from calibnet.training.losses import Target
from calibnet.training.samples import TrainingSamples, collate

Batch = tuple[NetworkInputs, Target]


class BatchNumbers(Sampler[list[int]]):
    """Sample numbers batch by batch, from any batch on; every process of several takes its own."""

    def __init__(self, first: int, batch: int, rank: int, world: int) -> None:
        self.first, self.batch, self.rank, self.world = first, batch, rank, world

    def __iter__(self) -> Iterator[list[int]]:
        number = self.first * self.world + self.rank
        while True:
            yield list(range(number * self.batch, (number + 1) * self.batch))
            number += self.world


def open_batches(fabric: Fabric, samples: TrainingSamples, first: int, batch: int, workers: int) -> Iterator[Batch]:
    """All batches from number ``first`` on, prepared by so many other processes, on the fabric's device."""
    # workers that have OpenCV's threads for all cores each hinder one another; told after the fork, they wait for ever
    cv2.setNumThreads(1)
    loader = DataLoader(
        samples,
        batch_sampler=BatchNumbers(first, batch, fabric.global_rank, fabric.world_size),
        collate_fn=collate,
        num_workers=workers,
        worker_init_fn=leave_signals_to_main,
        prefetch_factor=4 if workers else None,
        pin_memory=fabric.device.type == "cuda",
    )
    return cast(Iterator[Batch], iter(fabric.setup_dataloaders(loader, use_distributed_sampler=False)))


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
