"""Lists to train on, and tables of a fleet, that hold what no fleet has written."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from tests.hostile.inputs import put
from tests.hostile.rows import BAD, Make, Row, dangling, endless, fifo, folder, giant, loop

TRAIN = ["train", "--range", "5/0.5", "--samples", "8", "--synthetic", "0", "--workers", "0", "--output", "runs"]
LIST = "fleet.parquet"
DRIVE = {
    **dict.fromkeys(("sequence", "camera", "selection", "options"), ""),
    "car": "c",
    "drive": "d",
    "dataset": "folder",
    "path": "car",
    "verdict": "accepted",
}


def parquet(rows: list[dict[str, Any]] | dict[str, Any], **options: Any) -> bytes:
    """A table in Parquet."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.Table.from_pylist(rows) if isinstance(rows, list) else pa.table(rows)
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, **options)
    return bytes(sink.getvalue())


@functools.cache
def many(count: int) -> bytes:
    """A table of one drive again and again, in some kilobytes."""
    import pyarrow as pa

    return parquet({name: pa.repeat(pa.scalar(value), count) for name, value in DRIVE.items()}, compression="zstd")


LISTS: dict[str, Callable[[], bytes]] = {
    "no table": lambda: b"PAR1" + b"x" * 100 + b"PAR1",
    "no row": lambda: parquet({name: [] for name in DRIVE}),
    "no column": lambda: parquet({}),
    "numbers": lambda: parquet([DRIVE | {"car": 7}]),
    "nothing in a column": lambda: parquet([DRIVE | {"path": None}]),
    "lists": lambda: parquet([DRIVE | {"path": ["car"]}]),
    "a dataset that there is not": lambda: parquet([DRIVE | {"dataset": "lyft"}]),
    "a folder that there is not": lambda: parquet([DRIVE | {"path": "nowhere"}]),
    "a path with a null": lambda: parquet([DRIVE | {"path": "ca\0r"}]),
    "a path of 100000 characters": lambda: parquet([DRIVE | {"path": "a" * 100_000}]),
    "a bag": lambda: parquet([DRIVE | {"dataset": "bag"}]),
    "a bucket": lambda: parquet([DRIVE | {"path": "s3://mine/car"}]),
    "frames that are a word": lambda: parquet([DRIVE | {"selection": "all\x1b[2J"}]),
    "frames that are not there": lambda: parquet([DRIVE | {"selection": "900:"}]),
    "a sequence of KITTI that there is not": lambda: parquet(
        [DRIVE | {"dataset": "kitti-raw", "sequence": "nonsense"}]
    ),
    "a scene of nuScenes that there is not": lambda: parquet([DRIVE | {"dataset": "nuscenes", "sequence": "scene-1"}]),
    "a drive of KITTI-360 that is a path": lambda: parquet([DRIVE | {"dataset": "kitti-360", "sequence": "../../x"}]),
    "another verdict": lambda: parquet([DRIVE | {"verdict": "splendid"}]),
    "2 million drives": lambda: many(2_000_000),
}


def rows() -> Iterator[Row]:
    """Of all of them."""
    for what, content in LISTS.items():
        yield Row(f"train --data list: {what}", listed(content), BAD, (LIST,))
    for make in (fifo, endless, dangling, loop, folder, giant):
        yield Row(f"train --data list: {make.__name__}", placed(make), BAD, (LIST,))
    for what, content in LISTS.items():
        if what in ("no table", "numbers", "lists", "2 million drives"):

            def reported(root: Path, content: Callable[[], bytes] = content) -> list[str]:
                (root / LIST).write_bytes(content())
                return ["fleet-report", "."]

            yield Row(f"fleet-report of a table of {what}", reported, BAD, (LIST,))


def listed(content: Callable[[], bytes]) -> Make:
    """Train on what a list names."""

    def made(root: Path) -> list[str]:
        put("car", root)
        (root / LIST).write_bytes(content())
        return [*TRAIN, "--data", f"list:{LIST}"]

    return made


def placed(make: Callable[[Path], None]) -> Make:
    """Train on a list that is something else."""

    def made(root: Path) -> list[str]:
        make(root / LIST)
        return [*TRAIN, "--data", f"list:{LIST}"]

    return made
