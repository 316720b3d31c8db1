"""Links that lead back, sockets, a file under two names, what unpacks to more than it says, odd names and times."""

from __future__ import annotations

import io
import os
import shutil
import socket
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from tests.hostile import pictures
from tests.hostile.inputs import CAR, Build, car, car_with
from tests.hostile.rows import BAD, FINE, Row

IMAGE, SCAN, CALIBRATION = "images/0000.png", "clouds/0000.bin", "calibration.yaml"


def then(act: Callable[[Path], object], *options: str) -> Build:
    """A car's folder, with something done to it."""

    def made(root: Path) -> list[str]:
        command = car(root)
        act(root / CAR)
        return [*command, *options]

    return made


def _links_that_lead_back(folder: Path) -> None:
    (folder / "images/back").symlink_to("..")
    (folder / "clouds/here").symlink_to(".")


def _a_folder_that_is_itself(folder: Path) -> None:
    shutil.rmtree(folder / "images")
    (folder / "images").symlink_to("images")


def _socket(name: str) -> Callable[[Path], None]:
    def act(folder: Path) -> None:
        (folder / name).unlink()
        short = os.open(folder / name.rpartition("/")[0], os.O_PATH)  # a socket's path has at most 107 characters
        with socket.socket(socket.AF_UNIX) as server:
            server.bind(f"/proc/self/fd/{short}/{Path(name).name}")
        os.close(short)

    return act


def _copied(name: str, other: str) -> Callable[[Path], object]:
    return lambda folder: shutil.copy(folder / name, folder / other)


def _renamed(name: bytes) -> Callable[[Path], None]:
    def act(folder: Path) -> None:
        for file in (IMAGE, SCAN):
            (folder / file).rename(folder / file.partition("/")[0] / os.fsdecode(name + file[-4:].encode()))

    return act


def _times(text: str) -> Callable[[Path], None]:
    def act(folder: Path) -> None:
        for name in ("images", "clouds"):
            (folder / name / "timestamps.txt").write_text(text)

    return act


def _bomb(states: int | None = None) -> bytes:
    """An archive of a few kilobytes with an array of 400 MB, whose entry states another size."""
    head, packed = io.BytesIO(), io.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": "<f4", "fortran_order": False, "shape": (25_000_000, 4)})
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("points.npy", head.getvalue() + bytes(400_000_000))
    data = bytearray(packed.getvalue())
    if states is not None:
        struct.pack_into("<I", data, data.index(b"PK\1\2") + 24, states)
    return bytes(data)


def _zipped(way: int) -> bytes:
    """Points in an archive, beside an entry whose name leads out of it."""
    points, packed = io.BytesIO(), io.BytesIO()
    np.save(points, np.random.default_rng(0).uniform(1, 20, (500, 4)).astype(np.float32))
    with zipfile.ZipFile(packed, "w", way) as file:
        file.writestr("../../escaped.npy", b"x")
        file.writestr("points.npy", points.getvalue())
    return packed.getvalue()


def _exif(entries: int, times: int) -> bytes:
    """Exif segments of a JPEG that turn it, with entries that it does not have."""
    entry = b"\x12\1\3\0\1\0\0\0\6\0\0\0"
    content = (b"Exif\0\0II*\0\x08\0\0\0" + struct.pack("<H", entries) + entry * 5000)[:65_000]
    return (b"\xff\xe1" + struct.pack(">H", len(content) + 2) + content) * times


def rows() -> Iterator[Row]:
    """Of a car's folder."""
    timed = ("--max-time-difference", "50")
    yield Row("folders that lead back to themselves", then(_links_that_lead_back), FINE)
    yield Row("a folder that is a link to itself", then(_a_folder_that_is_itself), BAD, ("car/images does not exist",))
    for name in (IMAGE, SCAN, CALIBRATION):
        yield Row(f"a socket as {name}", then(_socket(name)), BAD, (name, "cannot be read"))
    yield Row("a name twice, in capitals", then(_copied(IMAGE, "images/0000.PNG")), BAD, ("keep one of them",))
    yield Row("a name twice, as another kind", then(_copied(IMAGE, "images/0000.jpg")), BAD, ("keep one of them",))
    for what, name in {
        "that are no UTF-8": b"stra\xdfe",
        "that look like an option": b"--save",
        "of 250 digits": b"9" * 250,
        "of Arabic digits": "\u0661\u0662".encode(),
    }.items():
        yield Row(f"names {what}", then(_renamed(name)), FINE)
    for what, data in {"a bomb": _bomb(), "a bomb that says it is small": _bomb(4000)}.items():
        yield Row(f".npz: {what}", car_with(SCAN, ".npz", data), BAD, ("0000.npz",))
    yield Row(".npz: of LZMA, with a name that leads out", car_with(SCAN, ".npz", _zipped(zipfile.ZIP_LZMA)), FINE)
    jpeg, png, packed = pictures.WHOLE_JPEG, pictures.WHOLE_PNG, b"a\0\0" + zlib.compress(bytes(500_000_000), 9)
    for kind in (b"iCCP", b"zTXt"):
        bomb = png[:33] + pictures.chunk(kind, packed) + png[33:]
        yield Row(f".png: a {kind.decode()} of 500 MB", car_with(IMAGE, ".png", bomb), BAD, ("0000.png",))
    yield Row(".jpg: 10 MB of Exif", car_with(IMAGE, ".jpg", jpeg[:2] + _exif(65_535, 150) + jpeg[2:]), FINE)
    yield Row(".jpg: 50 MB behind it", car_with(IMAGE, ".jpg", jpeg + bytes(50_000_000)), FINE)
    for text in ("-5", "2016-12-31 23:59:60.5", "1.5\r", "0000.png 3.5\n"):
        yield Row(f"time {text!r}", then(_times(text), *timed), FINE if "png" not in text else BAD)
    for text in ("0000-01-01 00:00:00", "2026-02-30 00:00:00", "2026-01-01 00:00:61", "nan", "1\x002", "0x1p3"):
        yield Row(f"time {text!r}", then(_times(text), *timed), BAD, ("is not a time",))
    yield Row("eight million times", then(_times("1\n" * (8 << 20)), *timed), BAD, ("more than 1,000,000 lines",))
    yield Row("a --json that is an input under another name", _linked, BAD, ("is an input of this run",))


def _linked(root: Path) -> list[str]:
    car(root)
    os.link(root / CAR / CALIBRATION, root / "v.json")
    return ["verify", "folder", CAR, "--frames", "0", "--json", "v.json", "--overwrite"]
