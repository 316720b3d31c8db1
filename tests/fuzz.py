"""Fuzzing of every parser: coverage-guided by atheris where that is installed, else by random changes alone.

    python -m tests.fuzz [--seconds 5] [--corpus FOLDER] [--random [--seed 0]] [TARGET ...]

Each target is run in a process of its own, on whole inputs and what earlier runs found (`KEPT`); with ``--corpus`` what
it finds is kept. An input may end in an error of ours only; anything else, a crash, or more than `Target.longest_s` is
a finding, which is printed and kept as a file. `.ci/run` gives each target 5 seconds of the same random changes every
time, so that a finding there comes from what was changed in the code; new ones, for an hour each, are for the hand.
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
from functools import partial
from pathlib import Path
from types import FrameType, FunctionType
from typing import Any

import numpy as np

from calibnet.datasets.clouds.tables import LONGEST_WAIT
from calibnet.errors import CalibnetError
from tests.hostile import calibrations, clouds, pictures, weights
from tests.hostile.recordings import VERDICT
from tests.support.clouds import npy, npz, with_fields

os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")  # its own reserves addresses by the gigabyte
HANG_S, GIGABYTES = 10, 2.0
"""An input that takes longer by the clock, or grows the process by more, is a finding."""
UNPACKING_S = dict.fromkeys((".las", ".laz"), LONGEST_WAIT + HANG_S)
"""These are unpacked by a process of its own, whose processor time is bounded; on a busy machine it waits long."""
LARGEST = 1 << 16
"""Bytes of an input."""


@dataclass(frozen=True)
class Target:
    """A parser.

    Attributes:
        parse: takes any bytes; raises an error of ours, a ``ValueError`` of its own kind, or nothing.
        seeds: whole inputs.
        words: pieces of the format that are put in.
        longest_s: seconds by the clock after which an input is a finding.
    """

    parse: Callable[[bytes], object]
    seeds: tuple[bytes, ...]
    words: tuple[bytes, ...] = ()
    longest_s: int = HANG_S


def _scan(suffix: str, data: bytes) -> object:
    from calibnet.datasets.clouds.scans import read_scan

    return _as_file(f"scan{suffix}", data, read_scan)


def _image(data: bytes) -> object:
    from calibnet.datasets.images.files import read_image

    return _as_file("image.png", data, read_image)


def _calibration(data: bytes) -> object:
    from calibnet.datasets.folder import read_calibration_of

    return _as_file("calibration.yaml", data, lambda path: read_calibration_of(path.parent))


def _kitti(data: bytes) -> object:
    from calibnet.datasets.kitti.calibration import read_calibration_file

    return _as_file("calib.txt", data, partial(read_calibration_file, sizes={"P2": 12, "Tr": 12}))


def _times(data: bytes) -> object:
    from calibnet.datasets.kitti.calibration import read_times

    return _as_file("times.txt", data, partial(read_times, seconds=float))


def _weights(data: bytes) -> object:
    from calibnet.weights.files import read_header

    return _as_file("w.safetensors", data, read_header)


def _manifest(data: bytes) -> object:
    from calibnet.weights.manifest import load_manifest

    return _as_file("compact.toml", data, lambda path: load_manifest("compact", path.parent))


def _drives(data: bytes) -> object:
    from inspector.fleet.drives import find_drives

    return _as_file("d.csv", data, lambda path: find_drives([str(path)]))


def _fleet_table(data: bytes) -> object:
    from inspector.fleet.table import read_table

    return _as_file("fleet.parquet", data, read_table)


def _table_seed() -> bytes:
    from inspector.fleet.drives import Drive
    from inspector.fleet.table import row_of, table_bytes

    return table_bytes([row_of(Drive("a", "b", "folder", "/d"), verdict="accepted", camera_from_lidar=(1.0,) * 16)])


def _preset(data: bytes) -> object:
    from calibnet.network.config import parse_config
    from calibnet.runtime.reading import parse_toml

    return parse_config({"name": "fuzz", **parse_toml(data.decode("utf-8", "replace"))}, "It")


def _verdict(data: bytes) -> object:
    from inspector.read.understood import understood
    from inspector.read.verdict import read_verdict

    with understood(Path("run.rrd")):
        return read_verdict(data.decode("utf-8", "replace"), Path("run.rrd"))


def _yaml(data: bytes) -> object:
    from calibnet.runtime.reading import parse_yaml

    return parse_yaml(data.decode("utf-8", "replace"))


_MEMORY = Path("/dev/shm")
_FOLDER = tempfile.TemporaryDirectory(prefix="calib-inspect-fuzz-", dir=_MEMORY if _MEMORY.is_dir() else None)


def _as_file(name: str, data: bytes, read: Callable[[Path], object]) -> object:
    path = Path(_FOLDER.name) / name
    path.write_bytes(data)
    return read(path)


def _seeds_of_scans(suffix: str) -> tuple[bytes, ...]:
    kept = clouds.POINTS[:12]
    contents = {
        ".pcd": [clouds.pcd(kept, form) for form in ("ascii", "binary", "binary_compressed")],
        ".ply": [clouds.ply(kept, form) for form in ("ascii", "binary_little_endian")],
        ".npy": [clouds.npy(kept), npy(with_fields(kept)), npy(kept.reshape(2, 6, 4))],
        ".npz": [npz(kept), npz(kept[:, :3], intensity=kept[:, 3:], stamp=np.array(3.0))],
        ".las": [clouds.LAS],
        ".laz": [clouds.LAZ],  # unpacked by a process of its own, so that few are tried
        ".bin": [kept.tobytes(), np.tile(clouds.POINTS, (1, 1))[:200].tobytes()],
        ".feather": [clouds.FEATHER],
        ".parquet": [clouds.PARQUET],
        ".csv": [
            clouds.CSV[:500],
            clouds.CSV[16:500].replace(b",", b" "),
            b"//X;Y;Z\n1,5;2,5;3,5\n",
            b"x (mm),Y1 [mm],z_mm,i\n12\n1,2,3,4\n",
        ],
    }
    return tuple(contents[suffix])


def _small(form: str) -> bytes:
    return pictures.encoded(form, pictures.Image.fromarray(pictures.PIXELS[:16, :16]))


WORDS = tuple(
    b"FIELDS|SIZE|TYPE|COUNT|WIDTH|HEIGHT|POINTS|DATA|ascii|binary|binary_compressed|_|F|U|4294967296|-1|nan|inf|1e400|"
    b"element vertex|property float|property list uchar int|end_header|format|0|99999999999".split(b"|")
)


def _bag(kind: str, data: bytes) -> object:
    """A bag: the message of a cloud and everything else in it is read as `calib-inspect bag` reads it."""
    from calibnet.datasets.bag import Bag

    return _as_file(f"bag{kind}", data, lambda path: Bag([path])[0])


def _small_bag(kind: str) -> bytes:
    from tests.hostile.bags import small_bag

    return small_bag(kind)


def _small_foxglove() -> tuple[bytes, ...]:
    from tests.hostile.bags import small_foxglove

    return small_foxglove("json"), small_foxglove("protobuf")


def _stamps(data: bytes) -> object:
    from calibnet.datasets.pairing import times_of

    return _as_file("timestamps.txt", data, lambda path: times_of({"a": path.parent / "a", "b": path.parent / "b"}))


def _nuscenes_sensors(data: bytes) -> object:
    from calibnet.datasets.nuscenes.tables import read_sensors

    _as_file("sensor.json", b'[{"token": "s", "channel": "LIDAR_TOP"}]', Path.exists)
    return _as_file("calibrated_sensor.json", data, lambda path: read_sensors(path.parent))


SENSOR = (
    b'[{"token": "a", "sensor_token": "s", "translation": [1.0, 0.0, 2.0], "rotation": [1.0, 0.0, 0.0, 0.0], '
    b'"camera_intrinsic": [[9.0, 0.0, 4.0], [0.0, 9.0, 3.0], [0.0, 0.0, 1.0]]}]'
)


def _nuscenes(data: bytes) -> object:
    from calibnet.datasets.nuscenes.tables import records

    return _as_file("scene.json", data, lambda path: list(records(path.parent, "scene")))


def _small_floats() -> bytes:
    """A TIFF of floats."""
    import cv2

    encoded: bytes = cv2.imencode(".tiff", np.linspace(0, 1, 48, dtype=np.float32).reshape(6, 8))[1].tobytes()
    return encoded


TARGETS: dict[str, Target] = {
    **{
        f"scan{suffix}": Target(partial(_scan, suffix), _seeds_of_scans(suffix), WORDS, UNPACKING_S.get(suffix, HANG_S))
        for suffix in (".pcd", ".ply", ".npy", ".npz", ".bin", ".las", ".laz", ".feather", ".parquet", ".csv")
    },
    **{f"bag{kind}": Target(partial(_bag, kind), (_small_bag(kind),)) for kind in (".bag", ".db3", ".mcap")},
    "foxglove.mcap": Target(partial(_bag, ".mcap"), _small_foxglove()),
    "image": Target(_image, (*(_small(form) for form in ("PNG", "JPEG", "BMP", "TIFF", "WEBP")), _small_floats())),
    "calibration": Target(
        _calibration,
        (
            calibrations.text().encode(),
            calibrations.BOMB.encode(),
            b'{"width": 400, "height": 120}',
            b"%YAML:1.0\n---\n",
            b"mirror_parameters: {xi: 2}\nprojection_parameters: {gamma1: 1, gamma2: 1, u0: 1, v0: 1}\n",
            *(text.encode() for text in calibrations.OTHERS),
        ),
        (b"&a ", b"*a", b"!!int ", b"!!opencv-matrix", b"<<: ", b"camera_matrix: ", b".nan", b"2011-01-01", b"[[[["),
    ),
    "kitti calib": Target(_kitti, (b"P2: 1 0 0 0 0 1 0 0 0 0 1 0\nTr: 1 0 0 0 0 1 0 0 0 0 1 0\n",), WORDS),
    "nuscenes table": Target(_nuscenes, (b'[\n{\n"token": "a",\n"translation": [1.0, 2.0, 3.0]\n},\n{}\n]',), WORDS),
    "nuscenes sensors": Target(_nuscenes_sensors, (SENSOR,), WORDS),
    "stamps": Target(_stamps, (b"1532402927612460000\n1532402927712460000\n", b"2011-09-26 13:02:25.9\n0.5\n"), WORDS),
    "kitti times": Target(_times, (b"0.0\n0.104\n0.207\n",), WORDS),
    "weights": Target(_weights, (weights.file(lambda _: None)[: 1 << 15],)),
    "manifest": Target(
        _manifest, ((weights.PACKAGE / "compact.toml").read_bytes(),), (b"nan", b"inf", b"[[stages]]", b"looks = ")
    ),
    "drives": Target(_drives, (b"path,car,drive,date,dataset,options\nx,a,b,2026-01-01,folder,--seed 1\n",), WORDS),
    "fleet table": Target(_fleet_table, (_table_seed(),)),
    "preset": Target(
        _preset, ((weights.PACKAGE.parent / "network/presets/compact.toml").read_bytes(),), (b"nan", b"[", b"999999999")
    ),
    "verdict": Target(_verdict, (json.dumps(VERDICT).encode(),), (b"NaN", b"null", b"[", b"1e999", b'"causes"')),
    "yaml": Target(
        _yaml, (calibrations.text().encode(),), (b"&a ", b"*a", b"!!float ", b"? ", b"| \n", b"%YAML", b"{[")
    ),
}
COUNTED = "stat::number_of_executed_units:"
"""What libFuzzer writes before the number of inputs."""
KEPT = Path(__file__).parent / "corpus"
"""Inputs that reached something new, a folder a target."""
FOUND = Path(tempfile.gettempdir()) / "calib-inspect-findings"


def try_one(name: str, data: bytes) -> None:
    """Parse one input; whatever is no error of ours is raised."""
    try:
        TARGETS[name].parse(data[:LARGEST])
    except CalibnetError as error:
        assert str(error).endswith("."), f"no sentence: {error}"
        assert "\n" not in str(error), f"no one sentence: {error}"
    except ValueError:
        if name not in ("yaml", "preset", "verdict"):
            raise


def changed(data: bytes, words: tuple[bytes, ...], draw: random.Random, others: list[bytes]) -> bytes:
    """An input with a few random changes."""
    content = bytearray(data)
    for _ in range(1 + draw.randrange(4)):
        place = draw.randrange(len(content) + 1)
        kind = draw.randrange(6)
        if kind == 0 and content:
            content[min(place, len(content) - 1)] ^= 1 << draw.randrange(8)
        elif kind == 1:
            content[place : place + draw.randrange(1, 9)] = draw.randbytes(draw.randrange(9))
        elif kind == 2 and words:
            content[place : place + draw.randrange(9)] = draw.choice(words)
        elif kind == 3:
            del content[place : place + draw.randrange(1, 1 + max(1, len(content) // 4))]
        elif kind == 4:
            other = draw.choice(others)
            start = draw.randrange(len(other) + 1)
            content[place:place] = other[start : start + draw.randrange(200)]
        else:
            content[place:place] = content[place : place + draw.randrange(1, 50)] * draw.randrange(1, 20)
    return bytes(content[:LARGEST])


def fuzz(name: str, seconds: float, corpus: Path | None, guided: bool = True, seed: int | None = None) -> int:
    """Run one target in this process; returns the number of inputs, and raises at a finding.

    Args:
        name: of the target.
        seconds: how long.
        corpus: folder of inputs to begin with, beside what is kept; guided runs add to it.
        guided: by coverage, where atheris is installed.
        seed: of the random changes; None for others every time.
    """
    signal.signal(signal.SIGALRM, _hang)
    try_one(name, TARGETS[name].seeds[0])  # what is imported lazily counts for no input
    _limit_memory()
    if guided:
        try:
            import atheris
        except ImportError:
            guided = False
    if guided:
        return _guided(atheris, name, seconds, corpus)
    target, draw, pool = TARGETS[name], random.Random(seed), [*TARGETS[name].seeds, *kept(name)]
    if corpus is not None and corpus.is_dir():
        pool += [path.read_bytes() for path in sorted(corpus.iterdir())]
    count, end = 0, time.monotonic() + seconds
    while time.monotonic() < end:
        data = changed(draw.choice(pool), target.words, draw, pool)
        _watched(name, data)
        count += 1
        if draw.random() < 0.02 and len(pool) < 500:
            pool.append(data)
    return count


def kept(name: str) -> list[bytes]:
    """What earlier runs of a target found."""
    return [path.read_bytes() for path in sorted((KEPT / name.replace(" ", "-")).glob("*"))]


def _watched(name: str, data: bytes) -> None:
    signal.alarm(TARGETS[name].longest_s)
    try:
        try_one(name, data)
    except BaseException:
        FOUND.mkdir(exist_ok=True)
        file = FOUND / f"{name.replace(' ', '-')}-{abs(hash(data)):x}"
        file.write_bytes(data)
        sys.stderr.write(f"{name}: a finding, kept as {file}\n")
        raise
    finally:
        signal.alarm(0)


def _guided(atheris: Any, name: str, seconds: float, corpus: Path | None) -> int:
    """libFuzzer, guided by the coverage of our modules; it ends the process."""
    target, count = TARGETS[name], 0
    folder = corpus or Path(tempfile.mkdtemp(prefix="calib-inspect-corpus-"))
    folder.mkdir(parents=True, exist_ok=True)
    for number, seed in enumerate([*target.seeds, *kept(name)]):
        (folder / f"seed-{number}").write_bytes(seed)
    for seed in target.seeds:  # imports what the target imports lazily
        try_one(name, seed)
    for function in _functions(("calibnet.runtime", "calibnet.datasets", "calibnet.weights", "inspector.read")):
        atheris.instrument_func(function)

    def one(data: bytes) -> None:
        nonlocal count
        count += 1
        _watched(name, data)

    FOUND.mkdir(exist_ok=True)
    options = [f"-max_total_time={max(1, int(seconds))}", f"-max_len={LARGEST}", "-verbosity=0"]
    options += [f"-artifact_prefix={FOUND}/", "-rss_limit_mb=0"]
    if target.words:
        words = folder.with_name(f"{folder.name}-words")
        words.write_text("".join('"' + "".join(f"\\x{byte:02x}" for byte in word) + '"\n' for word in target.words))
        options.append(f"-dict={words}")
    atheris.Setup([sys.argv[0], *options, "-print_final_stats=1", str(folder)], one, enable_python_coverage=True)
    atheris.Fuzz()
    return count


def _functions(packages: tuple[str, ...]) -> list[FunctionType]:
    """Every function of the modules of some packages that are imported by now, as many are before atheris is."""
    found = []
    for module in [module for name, module in sys.modules.items() if name.startswith(packages)]:
        for one in list(vars(module).values()):
            for function in [one, *(vars(one).values() if isinstance(one, type) else ())]:
                plain = getattr(function, "__func__", getattr(function, "__wrapped__", function))
                if isinstance(plain, FunctionType) and plain.__module__ == module.__name__:
                    found.append(plain)
    return list(dict.fromkeys(found))


def _hang(_: int, __: FrameType | None) -> None:
    raise TimeoutError("too long")


def _limit_memory() -> None:
    import resource

    import psutil

    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    largest = psutil.Process().memory_info().vms + int(GIGABYTES * (1 << 30))
    resource.setrlimit(resource.RLIMIT_AS, (min(largest, soft) if soft > 0 else largest, hard))


def main() -> int:
    """Run the targets that are named, or all; returns the number of those with a finding."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=", ".join(TARGETS))
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--corpus", type=Path, help="Folder of corpora, one a target; made if need be.")
    parser.add_argument("--random", action="store_true", help="Random changes, all targets in this one process.")
    parser.add_argument("--seed", type=int, help="Of --random: the same changes every time.")
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    asked = parser.parse_args()
    total, failed = 0, []
    for name in asked.targets or TARGETS:
        count, found = 0, ""
        if asked.random or asked.here:
            try:
                corpus = asked.corpus and asked.corpus / name.replace(" ", "-")
                count = fuzz(name, asked.seconds, corpus, not asked.random, asked.seed)
            except BaseException as error:
                found = f"{type(error).__name__}: {error}"
        else:
            options = ["--seconds", str(asked.seconds), *(["--corpus", str(asked.corpus)] if asked.corpus else [])]
            command = [sys.executable, "-m", "tests.fuzz", name, "--here", *options]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            counts = [line.split()[-1] for line in done.stderr.splitlines() if line.startswith(COUNTED)]
            count = int(counts[-1]) if counts else 0
            found = (done.stdout + done.stderr)[-4000:] if done.returncode else ""
        total += count
        failed += [name] if found else []
        sys.stdout.write(f"{name}: {count} inputs\n{found and found + chr(10)}")
        sys.stdout.flush()
    sys.stdout.write(f"{total} inputs; findings: {', '.join(failed) or 'none'}.\n")
    return len(failed)


if __name__ == "__main__":
    sys.exit(main())
