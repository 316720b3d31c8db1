"""Kill -9 at random moments of a training run, resumed until it ends: it ends with the very same weights.

python -m tests.kills_training [--times 20] [--seed 0]
"""

from __future__ import annotations

import argparse
import contextlib
import os
import random
import signal
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from unittest import mock

import torch
from safetensors.torch import load_file

from calibnet.training import build
from calibnet.training.data import Source
from calibnet.training.recipe import RECIPE
from tests.calibnet.training.tiny_run import options, trainer_of
from tests.support.scene import Scenes
from tests.support.tiny import TINY

NAME = "tiny-5deg-0.5m"
RESTLESS = replace(RECIPE, pace=replace(RECIPE.pace, checkpoint_seconds=0.0))
"""With a checkpoint after every step, so that many kills meet one while it is written."""


@contextlib.contextmanager
def tiny_world() -> object:
    """Training builds a tiny network, on scenes that are read anew each time."""
    sources = [Source(Scenes(), 1.0, synthetic=True)]
    with (
        mock.patch.object(build, "load_preset", lambda _: TINY),
        mock.patch.object(build, "training_sources", lambda _: (sources, [Scenes(1)])),
    ):
        torch.set_num_threads(1)
        yield


def train(folder: Path, batches: int) -> None:
    """Go on with the run in a folder, or begin it."""
    trainer_of(options(folder, batches=batches), RESTLESS, resume=True).run()


def killed(folder: Path, batches: int, after: float) -> bool:
    """Train in a process that is killed after so many seconds; returns whether it had ended by then."""
    child = os.fork()
    if not child:
        code = 1
        with contextlib.suppress(BaseException):
            train(folder, batches)
            code = 0
        os._exit(code)
    deadline = time.monotonic() + after
    while time.monotonic() < deadline:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            assert status == 0, "a run could not go on with what a killed one had left"
            return True
        time.sleep(0.005)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return False


def same(folder: Path, whole: Path) -> None:
    """Weights and the state of the optimiser are equal, bit for bit, and nothing is left of those that were killed."""
    assert not list(folder.glob(".*.partial"))
    for suffix in (".safetensors", ".checkpoint"):
        found, expected = (load_file(path / f"{NAME}{suffix}") for path in (folder, whole))
        assert found.keys() == expected.keys()
        different = [name for name in expected if not torch.equal(found[name], expected[name])]
        assert not different, f"{len(different)} tensors of {suffix} differ"


def main() -> None:
    """Kill a run so many times, and compare what comes of it with one that was let alone."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    draw, batches = random.Random(asked.seed), 4 * asked.times
    with tempfile.TemporaryDirectory() as base, tiny_world():
        folder, whole = Path(base) / "killed", Path(base) / "whole"
        started = time.monotonic()
        train(whole, batches)
        length = time.monotonic() - started
        kills = 0
        while not killed(folder, batches, draw.uniform(0.2, 1.0) * 2 * length / asked.times):
            kills += 1
        same(folder, whole)
        sys.stdout.write(f"{kills} kills of {batches} steps: the same weights, bit for bit\n")


if __name__ == "__main__":
    main()
