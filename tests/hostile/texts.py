"""KITTI's text files: calibrations, times and lists of frames."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from tests.hostile.inputs import Build, changed, listed, odometry, raw
from tests.hostile.rows import FINE, Row, instead_of

CALIB = "kitti-odometry/sequences/04/calib.txt"
TIMES = "kitti-odometry/sequences/04/times.txt"
STAMPS = "kitti-raw/2011_01_02/2011_01_02_drive_0007_sync/oxts/timestamps.txt"
CAMERAS = "kitti-raw/2011_01_02/calib_cam_to_cam.txt"
LIDAR = "kitti-raw/2011_01_02/calib_velo_to_cam.txt"
LIST = "kitti-object/ImageSets/val.txt"
OBJECT = "kitti-object/training/calib/000008.txt"
FILES: dict[str, tuple[Build, str]] = {
    "calib.txt": (odometry, CALIB),
    "times.txt": (odometry, TIMES),
    "timestamps.txt": (raw, STAMPS),
    "calib_cam_to_cam.txt": (raw, CAMERAS),
    "calib_velo_to_cam.txt": (raw, LIDAR),
    "list of frames": (listed, LIST),
    "calib of an object": (listed, OBJECT),
}
MAY_BE_EMPTY = {"times.txt", "timestamps.txt"}
MAY_BE_MISSING = {"times.txt", "timestamps.txt"}


def row_changed(key: str, change: Callable[[list[str]], list[str]]) -> Callable[[bytes], bytes]:
    """The numbers of one row changed."""

    def made(data: bytes) -> bytes:
        lines = []
        for line in data.decode().splitlines():
            name, colon, numbers = line.partition(":")
            lines.append(f"{name}: {' '.join(change(numbers.split()))}" if colon and name == key else line)
        return "\n".join(lines).encode() + b"\n"

    return made


CHANGES: dict[str, Callable[[list[str]], list[str]]] = {
    "a number less": lambda words: words[:-1],
    "a number more": lambda words: [*words, "1"],
    "a word": lambda words: ["word", *words[1:]],
    "NaN": lambda words: ["nan", *words[1:]],
    "infinity": lambda words: ["inf", *words[1:]],
    "1e400": lambda words: ["1e400", *words[1:]],
    "zeros": lambda words: ["0"] * len(words),
    "nothing": lambda _: [],
    "a number of 5000 digits": lambda words: ["9" * 5000, *words[1:]],
}
ROWS_OF = {
    "calib.txt": ("P2", "Tr"),
    "calib_cam_to_cam.txt": ("P_rect_02", "R_rect_00"),
    "calib_velo_to_cam.txt": ("R",),
    "calib of an object": ("R0_rect", "Tr_velo_to_cam"),
}
BAD_TIMES = {
    "infinity": "0.0\ninf\n0.2\n",
    "NaN": "0.0\nnan\n0.2\n",
    "1e400": "0.0\n1e400\n0.2\n",
    "1e300": "0.0\n1e300\n0.2\n",
    "a word": "0.0\nsoon\n0.2\n",
    "two": "0.0\n0.1\n",
    "binary": "0.0\n\0\1\2\n",
    "two a line": "0.0 0.1\n0.2\n0.3\n",
    "5000 digits": "0.0\n" + "9" * 5000 + "\n0.2\n",
    "sixteen million lines": "\n" * (16 << 20),
}
BAD_STAMPS = {
    "a word": "yesterday\n" * 3,
    "a date of the year 99999": "99999-01-02 10:00:00.000000000\n" * 3,
    "a thirteenth month": "2011-13-02 10:00:00.000000000\n" * 3,
    "numbers": "0.0\n0.1\n0.2\n",
}
LISTS = {
    "a frame that is not there": "000008\n000009\n",
    "names with escapes": "000008\n\x1b[2Jgone\n",
    "paths": "../../etc/passwd\n",
    "blank lines": "\n\n\n",
    "latin-1": "000008\n\udce9\n",
    "a million of one": "000042\n" * 1_000_000,
    "a name of a million characters": "9" * 1_000_000,
    "eight million of one": "1\n" * (8 << 20),
}


def rows() -> Iterator[Row]:
    """Of KITTI's text files."""
    for what, (build, place) in FILES.items():
        but = [kind for kinds, kind in ((MAY_BE_EMPTY, "empty"), (MAY_BE_MISSING, "missing")) if what in kinds]
        yield from instead_of(what, build, place, *but)
        if what in ROWS_OF:
            name = place.rpartition("/")[2]
            for key in ROWS_OF[what]:
                for change, made in CHANGES.items():
                    yield Row(
                        f"{what}: {key} with {change}", changed(build, place, row_changed(key, made)), words=(name,)
                    )
                twice = row_changed(key, lambda words: [*words[:-1], "7"])

                def doubled(data: bytes, twice: Callable[[bytes], bytes] = twice) -> bytes:
                    return data + twice(data)

                yield Row(f"{what}: {key} twice", changed(build, place, doubled), words=(name,))
    for what, content in BAD_TIMES.items():
        yield Row(f"times.txt: {what}", changed(odometry, TIMES, content), words=("times.txt",))
    for what, content in BAD_STAMPS.items():
        yield Row(f"timestamps.txt: {what}", changed(raw, STAMPS, content), words=("timestamps.txt",))
    for what, content in LISTS.items():
        yield Row(f"list of frames: {what}", changed(listed, LIST, content), words=("val.txt",))
    yield Row("a sequence that is whole", odometry, FINE, ("Saved",))
    yield Row("a drive that is whole", raw, FINE, ("Saved",))
    yield Row("a list that is whole", listed, FINE, ("Saved",))
