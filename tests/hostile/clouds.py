"""Scans whose headers lie, that are cut, or are none."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from typing import Any

import laspy
import numpy as np
import pyarrow as pa
from pyarrow import feather, parquet

from tests.hostile.inputs import Build, car, car_with
from tests.hostile.rows import FINE, Row, instead_of
from tests.support.clouds import npy, pcd, ply

POINTS = np.random.default_rng(3).uniform([2, -8, -2, 0], [30, 8, 2, 1], (400, 4)).astype(np.float32)
TEXT_PCD, BINARY, PACKED = (pcd(POINTS, form) for form in ("ascii", "binary", "binary_compressed"))
TEXT_PLY, BINARY_PLY = ply(POINTS, "ascii"), ply(POINTS)


def scan(suffix: str, content: bytes) -> Build:
    """A car's folder whose scan is this."""
    return car_with("clouds/0000.bin", suffix, content)


def line_changed(content: bytes, change: Callable[[bytes], bytes]) -> bytes:
    """A text cloud with its fiftieth line changed."""
    lines = content.split(b"\n")
    lines[50] = change(lines[50])
    return b"\n".join(lines)


def table(write: Callable[[Any, io.BytesIO], None]) -> bytes:
    """A file made for tables."""
    file = io.BytesIO()
    names = ("x", "y", "z", "intensity")
    write(pa.table(dict(zip(names, POINTS.T, strict=True))), file)
    return file.getvalue()


def las(compressed: bool = False) -> bytes:
    """A survey's file of twelve points."""
    data = laspy.LasData(laspy.LasHeader(point_format=0, version="1.2"))
    data.x, data.y, data.z = POINTS[:12, :3].T.astype(np.float64)
    file = io.BytesIO()
    data.write(file, do_compress=compressed)
    return file.getvalue()


LAS, LAZ = las(), las(compressed=True)
CSV = b"x,y,z,intensity\n" + b"\n".join(b",".join(str(value).encode() for value in row) for row in POINTS) + b"\n"
FEATHER, PARQUET = table(feather.write_feather), table(parquet.write_table)
OF_TABLES = {".feather": FEATHER, ".parquet": PARQUET}
FOREIGN = {
    ".pcd": {
        "a short line": line_changed(TEXT_PCD, lambda line: line.rsplit(b" ", 1)[0]),
        "a long line": line_changed(TEXT_PCD, lambda line: line + b" 7"),
        "a word": line_changed(TEXT_PCD, lambda line: b"word" + line[4:]),
        "a line less": line_changed(TEXT_PCD, lambda _: b""),
        "text cut": TEXT_PCD[: len(TEXT_PCD) // 2],
        "binary cut": BINARY[: len(BINARY) // 2],
        "a byte less": BINARY[:-1],
        "twice the points": BINARY + BINARY[-6400:],
        "compressed cut": PACKED[: len(PACKED) // 2],
        "compressed and damaged": PACKED[:900] + b"\xff" * 500 + PACKED[1400:],
        "DATA nonsense": BINARY.replace(b"DATA binary", b"DATA nonsense"),
        "DATA without a word": BINARY.replace(b"DATA binary", b"DATA"),
        "no DATA": BINARY[: BINARY.index(b"DATA")],
        "too many POINTS": pcd(POINTS, POINTS=4000, WIDTH=4000),
        "too many POINTS compressed": pcd(POINTS, "binary_compressed", POINTS=4000, WIDTH=4000),
        "a billion POINTS": pcd(POINTS, POINTS=10**9, WIDTH=10**9),
        "a billion POINTS of text": pcd(POINTS, "ascii", POINTS=10**9, WIDTH=10**9),
        "10^40 POINTS": pcd(POINTS, POINTS=10**40, WIDTH=10**40),
        "negative POINTS": pcd(POINTS, POINTS=-400, WIDTH=-400),
        "POINTS that are a word": pcd(POINTS, POINTS="many"),
        "WIDTH that disagrees": pcd(POINTS, WIDTH=399),
        "COUNT of zero": pcd(POINTS, COUNT="1 1 1 0"),
        "COUNT of a billion": pcd(POINTS, COUNT="1 1 1 1000000000"),
        "COUNT missing one": pcd(POINTS, COUNT="1 1 1"),
        "SIZE of zero": pcd(POINTS, SIZE="4 4 4 0"),
        "SIZE of three": pcd(POINTS, SIZE="4 4 4 3"),
        "TYPE unknown": pcd(POINTS, TYPE="F F F Q"),
        "no FIELDS": pcd(POINTS, FIELDS=None),
        "no x": pcd(POINTS, fields="a y z intensity"),
        "no header": b"\0" * 4000,
        "a header without an end": b"FIELDS x\n" * 100_000,
        "no points": pcd(POINTS[:0]),
    },
    ".ply": {
        "a word": line_changed(TEXT_PLY, lambda line: b"word" + line[4:]),
        "a short line": line_changed(TEXT_PLY, lambda line: line.rsplit(b" ", 1)[0]),
        "faces first": BINARY_PLY.replace(b"element vertex", b"element face 1\nproperty int a\nelement vertex"),
        "lists first": ply(POINTS[:50]).replace(
            b"element vertex", b"element face 50\nproperty list uchar int vertex_index\nelement vertex"
        ),
        "cut": BINARY_PLY[: len(BINARY_PLY) // 2],
        "text cut": TEXT_PLY[: len(TEXT_PLY) // 2],
        "a billion vertices": BINARY_PLY.replace(b"vertex 400", b"vertex 1000000000"),
        "a billion vertices of text": TEXT_PLY.replace(b"vertex 400", b"vertex 1000000000"),
        "negative vertices": BINARY_PLY.replace(b"vertex 400", b"vertex -400"),
        "vertices that are a word": BINARY_PLY.replace(b"vertex 400", b"vertex many"),
        "an unknown type": BINARY_PLY.replace(b"float x", b"quad x"),
        "a list in a vertex": BINARY_PLY.replace(b"property float x", b"property list uchar float x"),
        "an unknown format": BINARY_PLY.replace(b"binary_little_endian", b"binary_middle_endian"),
        "no format": BINARY_PLY.replace(b"format", b"farmat"),
        "no end of the header": BINARY_PLY.replace(b"end_header", b"xxx_header"),
        "no x": BINARY_PLY.replace(b"float x", b"float a"),
        "no ply": b"plx" + BINARY_PLY[3:],
        "no vertex": b"ply\nformat ascii 1.0\nend_header\n",
    },
    ".npy": {
        "cut": npy(POINTS)[:-100],
        "too long": npy(POINTS) + b"\0" * 100,
        "a huge shape": npy(POINTS).replace(b"(400, 4)", b"(4" + b"0" * 5 + b"4)"),
        "a shape of 10^18": npy(POINTS).replace(b"(400, 4), }", b"(10**18,4)}"),
        "a negative shape": npy(POINTS).replace(b"(400, 4)", b"(-40, 4)"),
        "objects": npy(POINTS).replace(b"'<f4'", b"'|O' "),
        "no literal": npy(POINTS).replace(b"{'descr'", b"{print()"),
        "nested": b"\x93NUMPY\x01\x00\xf0\xff" + b"(" * 65520,
        "a version of the future": npy(POINTS).replace(b"NUMPY\1", b"NUMPY\7"),
        "two columns": npy(POINTS[:, :2]),
        "four dimensions": npy(POINTS.reshape(4, 10, 10, 4)),
        "complex": npy(POINTS.astype(np.complex64)),
        "texts": npy(POINTS.astype("U12")),
        "times": npy(POINTS.astype("M8[s]")),
        "no points": npy(POINTS[:0]),
        "only NaN": npy(POINTS * np.nan),
        "a pickle": b"\x80\x04\x95\x05\x00\x00\x00\x00\x00\x00\x00\x8c\x01a\x94.",
        "a zip": b"PK\3\4" + b"\0" * 100,
    },
    ".bin": {
        "cut": POINTS.tobytes()[:-7],
        "text": b"1 2 3 4\n" * 30 + b"x",
        "only NaN": (POINTS * np.nan).tobytes(),
        "only infinity": (POINTS * np.inf).tobytes(),
        "far away": (POINTS * 1e30).tobytes(),
        "one byte": b"x",
    },
}
GOOD = {
    ".pcd": {
        "text": TEXT_PCD,
        "binary": BINARY,
        "compressed": PACKED,
        "in capitals": BINARY.replace(b"DATA binary", b"DATA BINARY"),
        "padding": pcd(np.hstack([POINTS[:, :3], POINTS, POINTS[:, :1]]), fields="x y z _ _ _ intensity _"),
    },
    ".ply": {"text": TEXT_PLY, "binary": BINARY_PLY, "big-endian": ply(POINTS, "binary_big_endian")},
    ".npy": {"float64": npy(POINTS.astype(np.float64)), "by column": npy(np.asfortranarray(POINTS))},
    ".csv": {"comma": CSV},
}


def rows() -> Iterator[Row]:
    """Of scans of every format."""
    for suffix, content in OF_TABLES.items():
        yield Row(f"scan {suffix} that is good", scan(suffix, content), FINE, ("Saved",))
        yield from instead_of(f"scan {suffix}", scan(suffix, content), f"car/clouds/0000{suffix}", "missing")
        for what, damaged in {
            "cut": content[: len(content) // 2],
            "its end cut": content[:-9],
            "its end damaged": content[:-30] + b"\xff" * 20 + content[-10:],
        }.items():
            yield Row(f"scan {suffix}: {what}", scan(suffix, damaged), words=(f"0000{suffix}",))
    yield from instead_of("scan .bin", car, "car/clouds/0000.bin", "missing")
    for suffix, content in ((".pcd", BINARY), (".ply", BINARY_PLY), (".npy", npy(POINTS))):
        place = f"car/clouds/0000{suffix}"
        yield from instead_of(f"scan {suffix}", scan(suffix, content), place, "missing")
    for suffix, contents in FOREIGN.items():
        for what, content in contents.items():
            yield Row(f"scan {suffix}: {what}", scan(suffix, content), words=(f"0000{suffix}",))
    for suffix, contents in GOOD.items():
        for what, content in contents.items():
            yield Row(f"scan {suffix} that is good: {what}", scan(suffix, content), FINE, ("Saved",))
