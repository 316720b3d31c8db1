"""Makes the runs that the verdict is fitted to, in several processes, and appends each to a file when it is made."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields
from multiprocessing import get_context, parent_process
from pathlib import Path
from signal import SIG_IGN, SIGINT, signal
from threading import Thread
from typing import Annotated, Any, Literal

from annotated_types import Interval

from calibnet.datasets.frame import Sequence
from calibnet.errors import ConfigError
from calibnet.evaluation.lens_fit import DriveLensStream, LensStream
from calibnet.evaluation.verdict_drives import DriveStream
from calibnet.evaluation.verdict_runs import RunStream, VerdictRun
from calibnet.judging.drive_lens import DriveLensPredictors
from calibnet.judging.drive_predictors import DrivePredictors
from calibnet.judging.lens_predictors import LensPredictors
from calibnet.judging.predictors import Predictors
from calibnet.runtime.reading import MEGABYTE, read_text
from calibnet.runtime.schema import validated
from calibnet.runtime.writing import check_output

PREDICTORS = (Predictors, LensPredictors, DrivePredictors, DriveLensPredictors)
"""The kinds of predictors that a run in a log may have."""
BATCH = 8
"""Runs per process in a batch; the time limit is checked between batches."""
LARGEST = 256 * MEGABYTE
"""Largest size of a log in bytes; a run takes 2 kB."""
Kind = Literal["frames", "lenses", "drives", "drive-lenses"]
STREAMS: dict[Kind, type[RunStream | DriveStream]] = {
    "frames": RunStream,
    "lenses": LensStream,
    "drives": DriveStream,
    "drive-lenses": DriveLensStream,
}
SYNTHETIC_SEED, SYNTHETIC_LENGTH = 901, 10
"""Seed of the first synthetic drive, and frames of each. Training uses other seeds."""


@dataclass(frozen=True)
class Source:
    """The cascade and the data of a stream of runs, in a form that can be passed to another process.

    Attributes:
        preset, weights, stages: the cascade.
        data: texts that `calibnet.training.data.open_data` reads.
        synthetic: number of synthetic drives to add.
        seed: seed of all random numbers.
        kind: runs on single frames or on drives, with any fault or with faults of the lens.
    """

    preset: str
    weights: Path
    stages: tuple[int, ...]
    data: tuple[str, ...]
    synthetic: int
    seed: int
    kind: Kind = "frames"

    def sequences(self) -> list[Sequence]:
        """Open all data.

        Raises:
            ConfigError: there is no data.
            DatasetError: some data cannot be found.
        """
        from calibnet.datasets.synthetic import SyntheticSequence
        from calibnet.training.data import open_data

        found = [sequence for spec in self.data for sequence in open_data(spec)]
        found += [SyntheticSequence(SYNTHETIC_SEED + number, SYNTHETIC_LENGTH) for number in range(self.synthetic)]
        if not found:
            raise ConfigError("There are no drives; give --data, or --synthetic-drives above 0.")
        return found

    def open(self) -> RunStream | DriveStream:
        """Load the cascade and open the stream; with one thread, as several processes share the cores."""
        import torch

        from calibnet.cascade import Cascade

        torch.set_num_threads(1)
        return STREAMS[self.kind](Cascade.load(self.preset, self.stages, self.weights), self.sequences(), self.seed)


@dataclass(frozen=True)
class _Line:
    key: str
    number: Annotated[int, Interval(ge=0)]
    run: VerdictRun | None


class RunLog:
    """A file of runs, one per line, with a key that says what they depend on; lines with other keys are ignored."""

    def __init__(self, path: Path, key: dict[str, Any]) -> None:
        """Read the file, if it exists.

        Args:
            path: path of the file.
            key: everything that the runs depend on, except their number.
        """
        self.path, self.key = path, json.dumps(key, sort_keys=True)
        self.known: dict[int, VerdictRun | None] = {}
        check_output(path, None)
        text = read_text(path, "Log of runs", LARGEST, remedy="remove it") if path.is_file() else ""
        for line in text.splitlines():
            try:
                entry = validated(_Line, json.loads(line), "It", ConfigError, "run it again")
                if entry.key == self.key:
                    self.known[entry.number] = None if entry.run is None else whole(entry.run)
            except (ValueError, KeyError, RecursionError, ConfigError):
                continue  # cut short when it was written, or of another version: it is run again

    def add(self, number: int, run: VerdictRun | None) -> None:
        """Add a run, and append it to the file at once."""
        self.known[number] = run
        entry = {"key": self.key, "number": number, "run": None if run is None else asdict(run)}
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(entry) + "\n")


def whole(run: VerdictRun) -> VerdictRun:
    """The run, if its predictors are the current ones and its error and information have their six axes.

    Raises:
        KeyError: it has others.
    """
    axes = [6] if run.information is None else [6, *map(len, run.information)]
    if len(run.offset) != 6 or axes not in ([6], [6] * 7):
        raise KeyError(f"run {run.number} has other axes")
    known = [{one.name for one in fields(kind)} for kind in PREDICTORS]
    if run.predictors is not None and run.predictors.keys() not in known:
        raise KeyError(f"run {run.number} was made with other predictors")
    return run


Runner = Callable[[Iterable[int]], Iterator[VerdictRun | None]]
"""Makes the runs with some numbers, in order."""


@contextmanager
def runner(source: Source, workers: int) -> Iterator[Runner]:
    """Make runs in this many processes, or in this one if 0."""
    if not workers:
        stream = source.open()
        yield lambda numbers: map(stream.run, numbers)
        return
    pool = ProcessPoolExecutor(workers, get_context("spawn"), _open, (source,))
    try:
        yield lambda numbers: pool.map(_run, numbers)
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def collect(
    log: RunLog,
    runs: int,
    run: Runner,
    workers: int = 0,
    go_on: Callable[[], bool] = lambda: True,
    observer: Callable[[int], None] = lambda done: None,
) -> list[VerdictRun]:
    """The first runs of a stream; those in the log are not repeated.

    Args:
        log: file that keeps the runs.
        runs: number of runs.
        run: makes them.
        workers: number of its processes.
        go_on: whether there is time for more.
        observer: called with the number of finished runs after each.
    """
    missing = [number for number in range(runs) if number not in log.known]
    done = runs - len(missing)
    observer(done)
    size = BATCH * max(workers, 1)
    for numbers in (missing[start : start + size] for start in range(0, len(missing), size)):
        if not go_on():
            break
        for number, made in zip(numbers, run(numbers), strict=True):
            log.add(number, made)
            done += 1
            observer(done)
    return [made for number in range(runs) if (made := log.known.get(number)) is not None]


_stream: RunStream | DriveStream | None = None


def _open(source: Source) -> None:
    """Open the stream in a worker, which ends when its parent process ends for any reason."""
    global _stream
    Thread(target=_end_with_parent, daemon=True).start()
    signal(SIGINT, SIG_IGN)  # only the parent reports Ctrl-C
    _stream = source.open()


def _end_with_parent() -> None:
    parent = parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


def _run(number: int) -> VerdictRun | None:
    assert _stream is not None
    return _stream.run(number)
