"""Kills at random moments of recording, indexing, reporting, exporting, training, of a fleet, a rig and of `live`.

    python -m tests.kills [--times 5] [--seed 0] [--signal KILL] [KIND ...]

A few of each are in the tests (`tests/hostile/test_kills.py`); many are for the hand.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from tests.support.folder import write_folder

WITH_TESTS = os.environ | {"PYTHONPATH": str(Path(__file__).parents[1])}
"""For processes in another folder, which have the installed packages but not these tests."""
RECORD = """
import sys
from pathlib import Path
from inspector.record.contents import Contents, Detail
from inspector.record.observation import Layout
from inspector.record.outputs import Outputs
from inspector.record.recording import Recording, RunDescription
from tests.inspector.record.long_run import at, observations
made = observations(small=True)
outputs = Outputs(Path(sys.argv[1]))
outputs.check()
layout = Layout.of(made[0], Contents.of(Detail.OVERVIEW))
recording = Recording(outputs.open(), RunDescription("killed", {"seed": 0}), layout)
for index in range(int(sys.argv[2])):
    recording.log(at(made[index % len(made)], index))
    print(index, flush=True)
print("indexing", flush=True)
recording.close()
outputs.complete()
"""
COMMAND = (
    "import sys; print('begun', flush=True); from inspector.cli.main import main; sys.argv[0] = 'calib-inspect'; main()"
)

FAKED = """
import sys
from calibnet.cascade.cascade import Cascade
from inspector.cli.errors import run
from inspector.cli.main import cli
from tests.support.fakes import FakeCascade
Cascade.load = staticmethod(lambda *_, **__: FakeCascade((3, 4, 5)))
print("begun", flush=True)
sys.exit(run(cli, sys.argv[1:]))
"""
"""A command whose cascade costs nothing, beside three cars and a rig of two of them."""
RIG = FAKED.replace("tests.support.fakes import FakeCascade", "tests.inspector.cli.test_rig import RigCascade").replace(
    "FakeCascade((3, 4, 5))", "RigCascade()"
)
TRAIN = """
import sys
from inspector.cli.errors import run
from inspector.cli.main import cli
from tests.kills_training import tiny_world
print("begun", flush=True)
with tiny_world():
    sys.exit(run(cli, sys.argv[1:]))
"""
CARS = ("car-0", "car-1", "car-2")

TRAINING = (
    "train --preset tiny --range 5/0.5 --samples 4000 --batch 4 --workers 0 --resume --output runs --save training.rrd"
)


@dataclass(frozen=True)
class Kind:
    """What is killed.

    Attributes:
        command: to run in a folder, which holds ``whole.rrd``.
        since: the line of its output after which it is killed.
        within: seconds after that.
        check: looks at what is left, given the lines that were said; raises ``AssertionError``.
    """

    command: list[str]
    since: str
    within: float
    check: Callable[[Path, list[str]], None]


def killed(kind: Kind, folder: Path, draw: random.Random, by: signal.Signals = signal.SIGKILL) -> bool:
    """Run and kill once; returns whether it was still running. What a signal asks to end ends in a minute."""
    process = subprocess.Popen(
        kind.command, cwd=folder, env=WITH_TESTS, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    assert process.stdout is not None
    said = []
    for line in process.stdout:
        said.append(line.strip())
        if said[-1] == kind.since:
            break
    time.sleep(draw.uniform(0, kind.within))
    running = process.poll() is None
    process.send_signal(by)
    try:
        said += process.communicate(timeout=60)[0].split()
    finally:
        process.kill()
    kind.check(folder, said)
    return running


def check_recording(folder: Path, said: list[str]) -> None:
    """Every frame that was said to be recorded is read."""
    from inspector.read.run import read_run

    logged = [int(line) for line in said if line.isdigit()]
    found = [frame.index for frame in read_run(folder / "run.rrd").frames]
    assert found[: len(logged)] == logged, f"{len(logged)} frames were recorded, {len(found)} are there"


def check_report(folder: Path, _: list[str]) -> None:
    """What is there of a report is whole."""
    report = folder / "report"
    if (report / "metrics.json").exists():
        json.loads((report / "metrics.json").read_text())
    if (report / "index.html").exists():
        assert (report / "index.html").read_text().rstrip().endswith("</html>")


def check_export(folder: Path, _: list[str]) -> None:
    """The export is the earlier one or the new one."""
    if (folder / "out.json").exists():
        json.loads((folder / "out.json").read_text())


def check_fleet(folder: Path, _: list[str]) -> None:
    """What the table has of a drive is whole, and the drives are as they were."""
    from inspector.fleet.table import TABLE, read_table
    from inspector.read.run import read_run

    if (folder / "fleet" / TABLE).exists():
        for row in read_table(folder / "fleet" / TABLE):
            assert row.verdict != "failed", row.reason
            assert read_run(folder / "fleet" / row.recording).frames
    check_cars(folder, _)


def check_cars(folder: Path, _: list[str]) -> None:
    """The cars' folders hold what they held."""
    for name in CARS:
        assert {path.name for path in (folder / name).iterdir()} == {"images", "clouds", "calibration.yaml"}


def check_rig(folder: Path, said: list[str]) -> None:
    """What is there of a rig is whole, and the cars are as they were."""
    from calibnet.datasets.calibration_files import read_calibration

    for file in (folder / "found").glob("*.yaml"):
        assert read_calibration(file).camera_from_lidar is not None
    if (folder / "rig.rrd").exists():
        assert (folder / "rig.rrd").read_bytes()[:3] in (b"RRF", b"")
    check_cars(folder, said)


def check_training(folder: Path, _: list[str]) -> None:
    """Weights and checkpoints are whole."""
    from safetensors.torch import load_file

    for file in (folder / "runs").glob("*.[sc][ah]*"):
        assert load_file(file)


KINDS = {
    "recording": Kind([sys.executable, "-c", RECORD, "run.rrd", "1000"], "2", 3.0, check_recording),
    "indexing": Kind([sys.executable, "-c", RECORD, "run.rrd", "25"], "indexing", 0.6, check_recording),
    "reporting": Kind(
        [sys.executable, "-c", COMMAND, "report", "whole.rrd", "--output", "report"], "begun", 12.0, check_report
    ),
    "exporting": Kind(
        [sys.executable, "-c", COMMAND, "export", "whole.rrd", "--format", "json", "--output", "out.json"],
        "begun",
        6.0,
        check_export,
    ),
    "fleet": Kind(
        [sys.executable, "-c", FAKED, "fleet", *CARS, "--output", "fleet", "--workers", "0"], "begun", 15.0, check_fleet
    ),
    "rig": Kind(
        [sys.executable, "-c", RIG, *f"rig {CARS[0]} {CARS[1]} --headless --save rig.rrd --output found".split()],
        "begun",
        15.0,
        check_rig,
    ),
    "training": Kind([sys.executable, "-c", TRAIN, *TRAINING.split()], "begun", 20.0, check_training),
    "live": Kind([sys.executable, "-c", FAKED, "live", "folder", CARS[0], "--no-open"], "begun", 15.0, check_cars),
}


def main() -> None:
    """Kill every kind so many times."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=", ".join(KINDS))
    parser.add_argument("--times", type=int, default=5)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--signal", choices=("KILL", "TERM", "INT"), default="KILL")
    asked = parser.parse_args()
    by = signal.Signals[f"SIG{asked.signal}"]
    draw = random.Random(asked.seed)
    with tempfile.TemporaryDirectory() as base:
        folder = Path(base)
        for name in CARS:
            write_folder(folder / name, 2)
        record = [sys.executable, "-c", RECORD, "whole.rrd", "3"]
        subprocess.run(record, cwd=folder, env=WITH_TESTS, check=True, capture_output=True)
        for name in asked.kinds or KINDS:
            running = sum(killed(KINDS[name], folder, draw, by) for _ in range(asked.times))
            left = sorted(path.name for path in folder.iterdir() if path.name.endswith(".partial"))
            sys.stdout.write(
                f"{name}: {asked.times} of {by.name}, {running} of them while it ran; nothing lost; left {left}\n"
            )
            sys.stdout.flush()


if __name__ == "__main__":
    main()
