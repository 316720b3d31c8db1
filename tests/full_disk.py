"""Every command that writes, where the disk is full before it is done: what was there stays, and it says why it ended.

    python -m tests.full_disk [--times 5] [--seed 0] FOLDER [COMMAND ...]

FOLDER is on a small file system of its own, for instance after ``mount -t tmpfs -o size=64m tmpfs FOLDER``; all that is
in it goes. A command first runs with all the room, then with a random part of what it needed.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

from calibnet.weights.manifest import PACKAGE
from tests.hostile import inputs, recordings
from tests.hostile.rows import Row
from tests.hostile.table import prepared
from tests.hostile.tried import Outcome, try_row
from tests.support.bags import write_bag
from tests.support.fakes import make_frame
from tests.support.folder import write_folder

COMMANDS = {
    "folder": "folder car --frames 0 --headless --detail overview --save {out}/run.rrd --report {out}/report",
    "all": "folder car --frames 0 --headless --detail full --save {out}/run.rrd",
    "verify": "verify folder car --save {out}/v.rrd --report {out}/report --json {out}/v.json",
    "bag": "bag drive --headless --detail overview --save {out}/bag.rrd --report {out}/report",
    "watch": "watch folder car --save {out}/watch.rrd --json {out}/watch.json",
    "rig": "rig rig --headless --save {out}/rig.rrd --json {out}/rig.json --output {out}/found",
    "check": "check run.rrd --json {out}/check.json --junit {out}/check.xml",
    "report": "report run.rrd --output {out}/report",
    "viewer": "report run.rrd --output {out}/report --with-viewer",
    "compare": "compare run.rrd other.rrd --save {out}/both.rrd --headless --common-frames",
    "export": "export run.rrd --format json --force --output {out}/found.json",
    "animate": "pictures run.rrd --animate {out}/moving.webp",
    "fleet": "fleet car --output {out}/fleet --workers 0",
    "fleet-simulate": "fleet-simulate 1 --frames 1 --output {out}/drives",
    "pack-training": "pack-training --data folder:car --synthetic 0 --output {out}/parts",
    "train": "train --preset tiny --range 5/0.5 --samples 8 --batch 4 --workers 0 --resume --output {out}/runs"
    " --save {out}/training.rrd",
    "bench": "bench --threads 1 --method edge-alignment --data folder:car --range 5/0.5 --no-audit"
    " --json {out}/b.json --csv {out}/b.csv --html {out}/b.html --markdown {out}/b.md",
    "evaluate": "evaluate --dataset folder --root car --range 5/0.5 --no-classical --json {out}/e.json",
    "benchmark": f"benchmark --threads 1 --repeats 1 --stages 5 --weights {PACKAGE} --json {{out}}/benchmark.json",
    "ablate": "ablate --threads 1 --json {out}/ablate.json --markdown {out}/ablate.md",
    "info": "info --json {out}/info.json",
}
"""Every command that writes, to ``{out}``, the small file system."""


@contextlib.contextmanager
def quick(name: str) -> Iterator[None]:
    """A rig whose answer is known, a mount that moved, and training of a tiny one."""
    from calibnet.cascade.cascade import Cascade
    from calibnet.drive import watching
    from tests.inspector.cli.test_rig import RigCascade
    from tests.inspector.cli.test_watch import STEP
    from tests.kills_training import tiny_world

    load = staticmethod((lambda *_, **__: RigCascade()) if name == "rig" else Cascade.load)
    watched = (lambda *_: STEP) if name == "watch" else watching.watch_drive
    with (
        tiny_world(),
        mock.patch.object(Cascade, "load", load),  # type: ignore[attr-defined]
        mock.patch.object(watching, "watch_drive", watched),
    ):
        yield


def make_inputs(root: Path) -> None:
    """A car, a bag, a rig and two recordings."""
    recordings.whole("check")(root)
    inputs.put("car", root)
    write_bag(root / "drive", "mcap", [make_frame(0), make_frame(1)])
    for name in ("c0", "c1"):
        write_folder(root / "rig/cameras" / name, 2)
    shutil.move(root / "rig/cameras/c0/clouds", root / "rig/clouds")
    shutil.rmtree(root / "rig/cameras/c1/clouds")


def in_child(function: Callable[[], Any]) -> Any:
    """What a function returns, as JSON, from a process of its own; the name of the signal that ended it.

    Rerun is never used in this process: its threads do not outlive a fork.
    """
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        with contextlib.suppress(BaseException):
            os.write(writing, json.dumps(function(), default=vars).encode())
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading, "rb") as file:
        said = file.read()
    _, status = os.waitpid(child, 0)
    return json.loads(said) if said else f"ended by {signal.Signals(os.WTERMSIG(status) or 9).name}"


def tried(command: list[str], root: Path, reserve: int | None = None) -> Outcome | str:
    """Run it, with the usual reserve of disk space below which nothing is recorded, or another."""
    from inspector.record import flushing, outputs
    from tests.hostile import tried as limits

    def run() -> Outcome:
        with (
            mock.patch.object(outputs, "RESERVE_BYTES", outputs.RESERVE_BYTES if reserve is None else reserve),
            mock.patch.object(flushing, "FLUSH_TIMEOUT_S", 5.0),
            mock.patch.object(limits, "GIGABYTES", 6.0),  # for the real networks of `benchmark`
        ):
            outcome = try_row(Row("full disk", lambda _: command), root)
        return replace(outcome, said=outcome.said[-2000:])

    said = in_child(run)
    return said if isinstance(said, str) else Outcome(**said)


def whole(path: Path) -> bool:
    """Whether a file was written to its end; a recording may end anywhere."""
    content = path.read_bytes()
    if path.suffix == ".json":
        with contextlib.suppress(ValueError):
            return json.loads(content) is not None
        return False
    if path.suffix == ".rrd" and not content:
        return True
    begins, ends = {".rrd": (b"RRF", b""), ".html": (b"<", b">")}.get(path.suffix, (b"", b""))
    return not path.name.endswith(".partial") and content.startswith(begins) and content.rstrip().endswith(ends)


def contents(folder: Path) -> dict[str, bytes]:
    """Every file below a folder."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def emptied(folder: Path) -> None:
    """Nothing is left in it."""
    for path in folder.iterdir():
        shutil.rmtree(path) if path.is_dir() else path.unlink()


def lost(before: dict[str, bytes], out: Path) -> list[str]:
    """Files that were there, and are neither as they were nor new and whole; earlier recordings may lie aside."""
    after = contents(out)
    bad = [name for name in after if name != "ballast" and not whole(out / name)]
    for name, content in before.items():
        if name not in after:
            bad.append(f"{name} is gone")
        elif name.endswith(".rrd") and content not in after.values() and not _is_read(out / name):
            bad.append(f"{name} is replaced by a cut one")
    return bad


def _is_read(path: Path) -> bool:
    from inspector.read.run import read_run

    return in_child(lambda: bool(read_run(path).frames)) is True


def judged(outcome: Outcome | str, complete: bool) -> str:
    """What is wrong with how a command ended; nothing where all is well."""
    if isinstance(outcome, str):
        return outcome
    if outcome.ended != "exit" or outcome.code == 70 or "Traceback" in outcome.said:
        return f"{outcome.ended} {outcome.code}"
    if outcome.lost:
        return f"lost {outcome.lost}"
    return "" if complete or any(word in outcome.said for word in ("No space", "disk")) else "does not say why"


def try_command(name: str, root: Path, out: Path, times: int, draw: random.Random, say: Callable[[str], object]) -> int:
    """Run one command with room and then without; returns how often it ended as it should."""
    command = COMMANDS[name].format(out=out).split()
    emptied(out)
    free = shutil.disk_usage(out).free
    first = tried(command, root)
    needs = free - shutil.disk_usage(out).free
    if isinstance(first, str) or first.code not in (0, 1, 4):
        say(f"{name}: not tried: {first}\n")
        return 0
    earlier = out.with_name(f"{out.name}-earlier")
    shutil.rmtree(earlier, ignore_errors=True)
    shutil.copytree(out, earlier)
    right = 0
    for number in range(times):
        emptied(out)
        if number % 2 and name != "fleet-simulate":  # which only makes new folders
            shutil.copytree(earlier, out, dirs_exist_ok=True)
        before = contents(out)
        room = 0 if number == 0 else int(draw.random() * needs) // 4096 * 4096
        with (out / "ballast").open("wb") as file:
            os.posix_fallocate(file.fileno(), 0, max(4096, shutil.disk_usage(out).free - room))
        outcome = tried(command, root, draw.choice((None, 0)))
        complete = contents(earlier).keys() <= contents(out).keys()
        wrong = [judged(outcome, complete), *lost(before, out)]
        if any(wrong):
            text = outcome if isinstance(outcome, str) else outcome.said[-600:]
            say(
                f"{name}, room {room} of {needs}, earlier {bool(number % 2)}: {[w for w in wrong if w]}\n    {text!r}\n"
            )
        else:
            right += 1
    return right


def main() -> None:
    """Try every command so many times."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("commands", nargs="*", metavar="COMMAND", help=", ".join(COMMANDS))
    parser.add_argument("--times", type=int, default=5)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    out = asked.folder.resolve()
    assert out.stat().st_dev != out.parent.stat().st_dev, f"{out} is on the file system of all else"
    draw = random.Random(asked.seed)
    recording = Path(in_child(lambda: str(recordings.prepare())))
    with (
        tempfile.TemporaryDirectory() as base,
        mock.patch.object(recordings, "prepare", lambda: recording),
        prepared(),
    ):
        make_inputs(Path(base))
        for name in asked.commands or COMMANDS:
            with quick(name):
                right = try_command(name, Path(base), out, asked.times, draw, sys.stdout.write)
            sys.stdout.write(f"{name}: {right} of {asked.times} as they should\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main()
