"""Endless batches for the loop: which samples, from which processes, at which precision."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import AbstractContextManager
from typing import Any

import torch
from lightning_fabric.plugins.precision import MixedPrecision
from torch.utils.data import Sampler

from calibnet.errors import CalibnetError
from calibnet.network.batch import NetworkInputs
from calibnet.runtime.interruption import SIGNALS
from calibnet.runtime.precision import autocast
from calibnet.training.losses import Target

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


class FloatInputs(MixedPrecision):
    """bf16 autocast where it is faster; it leaves the inputs alone, as rounded points would be off by decimetres."""

    def __init__(self) -> None:
        super().__init__("bf16-mixed", device="cuda" if torch.cuda.is_available() else "cpu")

    def forward_context(self) -> AbstractContextManager[Any]:
        """Bf16 only where the hardware has it."""
        return autocast(torch.device(self.device))

    def convert_input(self, data: Any) -> Any:
        """Keep the inputs as they are."""
        return data


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
