"""Lists of drives, and tables of a fleet, that are not what they should be."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from tests.hostile.rows import FINE, Row, dangling, endless, fifo, folder, giant, loop

LIST, TABLE = "DRIVES.csv", "fleet.parquet"
LISTS = {
    "nothing": (b"", "lists no drives"),
    "no text": (b"path\n\xff\xfe\n", "not a text file"),
    "a null in a name": (b"path,car\nx,a\0b\n", ""),
    "a drive of the fleet's own folder": (b"path,options\nx,--report elsewhere\n", "set by the fleet"),
    "an option that writes": (b"path,options\nx,--save=elsewhere.rrd\n", "set by the fleet"),
    "an option that there is not": (b"path,options\nx,--shell\n", "row 1"),
    "an option as a path": (b"path,dataset,sequence\nx,kitti-raw,2011_09_26 --help\n", "row 1"),
    "a sequence of KITTI-360 that there is not": (b"path,dataset,sequence\nx,kitti-360,9x\n", ""),
    "a sequence of KITTI-360 that is a path": (b"path,dataset,sequence\nx,kitti-360,../../0003\n", "row 1"),
    "an option as a scene of nuScenes": (b"path,dataset,sequence\nx,nuscenes,--help\n", "row 1"),
    "nuScenes that is not there": (b"path,dataset\nx,nuscenes\n", ""),
    "frames of several mounts": (b"path,dataset,sequence\nx,kitti-object,val\n", "row 1"),
    "two drives of one name": (b"path,car,drive\nx,a,b\ny,a,b\n", "row 2"),
    "a bucket of a kind that there is not": (b"path\nnonsense://x\n", ""),
    "a date that there is not": (b"path,date\nx,2026-02-31\n", "row 1"),
    "more fields than names": (b"path,car\nx,a,b,c\n", "row 1"),
    "a column that there is not": (b"path,colour\nx,red\n", "row 1"),
    "a quotation without an end": (b'path,car\n"x,a\n', "row 1"),
    "a line of a million commas": (b"path\n" + b"," * 1_000_000 + b"\n", "row 1"),
    "names that are escapes": (b"path,car\nx,\x1b[2J\n", ""),
    "a field that is too long": (b"path,car\nx," + b"a" * 5000 + b"\n", "row 1"),
}


def rows() -> Iterator[Row]:
    """Every list, and every table."""
    for what, (data, words) in LISTS.items():

        def write(root: Path, data: bytes = data) -> list[str]:
            (root / LIST).write_bytes(data)
            return _fleet()

        code = FINE if not words else 3
        yield Row(f"list of drives: {what}", write, code, (words,) if words else (), ("out",))
    for memory in ("-5 potatoes", "0", "4", "1e9GB"):
        yield Row(
            f"fleet --memory {memory}", lambda _, memory=memory: ["fleet", ".", "--output", "o", "--memory", memory], 2
        )
    for make in (fifo, endless, dangling, loop, folder, giant):
        yield Row(f"list of drives: {make.__name__}", partial(_at, make, LIST, _fleet()), 3, (LIST,), ("out",))
        yield Row(f"table of a fleet: {make.__name__}", partial(_at, make, TABLE, ["fleet-report", "."]), 3, (TABLE,))


def _fleet() -> list[str]:
    return ["fleet", LIST, "--output", "out", "--workers", "0"]


def _at(make: Callable[[Path], None], name: str, command: list[str], root: Path) -> list[str]:
    make(root / name)
    return command
