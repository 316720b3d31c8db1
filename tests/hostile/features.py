"""Bags, rigs, the tables of nuScenes and KITTI-360, LAS, masks, weights of other methods, tables of measurements."""

from __future__ import annotations

import functools
import json
import os
import shutil
import struct
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from tests.hostile import clouds, pictures, weights
from tests.hostile.inputs import CAR, RUN, Build, car, car_with, changed, put
from tests.hostile.rows import BAD, USAGE, Row, instead_of

TABLES = "nuscenes/v1.0-mini"
CAR_TO_CAMERA = "kitti-360/calibration/calib_cam_to_pose.txt"
INNER = {"ros1": "drive.bag", "sqlite3": "drive/drive.db3", "mcap": "drive/drive.mcap"}
"""The file of a bag that holds its messages."""


def nuscenes(root: Path) -> list[str]:
    """A scene of nuScenes."""
    put("nuscenes", root)
    return ["nuscenes", "scene-0103", "--root", "nuscenes", *RUN]


def kitti_360(root: Path) -> list[str]:
    """A drive of KITTI-360."""
    put("kitti-360", root)
    return ["kitti360", "3", "--camera", "1", "--root", "kitti-360", *RUN]


def in_every_record(key: str, value: Any) -> Callable[[bytes], bytes]:
    """A table of nuScenes with one value changed."""
    return lambda data: json.dumps([{**one, key: value} for one in json.loads(data)]).encode()


TOKENS: list[tuple[str, str]] = [
    ("ego_pose", "token"),
    ("sample", "token"),
    ("calibrated_sensor", "token"),
    ("calibrated_sensor", "rotation"),
    ("calibrated_sensor", "translation"),
    ("calibrated_sensor", "camera_intrinsic"),
    ("sample_data", "filename"),
    ("sample_data", "timestamp"),
    ("sensor", "channel"),
    ("scene", "name"),
]
VALUES: list[Any] = [[1], {"a": 1}, float("nan"), 7e300]
RECORDS = {
    "nested lists": b"[" * 200_000,
    "a nested record": b'[{"a":' + b"[" * 200_000,
    "a number of 100000 digits": b'[{"token":' + b"9" * 100_000 + b"}]",
    "no list": b"{}",
    "a text without an end": b'[{"a":"' + b"x" * 3_000_000,
    "only commas": b"[" + b"," * 100_000,
    "UTF-16": "[]".encode("utf-16"),
}


@functools.cache
def _bags() -> Path:
    """A bag of every kind, written once."""
    from tests.support.bags import write_bag
    from tests.support.fakes import make_frame

    made = Path(tempfile.mkdtemp(prefix="calib-inspect-hostile-"))
    for kind, inner in INNER.items():
        (made / kind).mkdir()
        write_bag(made / kind / inner.split("/")[0], kind, [make_frame(0)])
    return made


def bag(kind: str, *options: str) -> Build:
    """Calibrate what a bag holds."""

    def made(root: Path) -> list[str]:
        shutil.copytree(_bags() / kind, root, dirs_exist_ok=True)
        return ["bag", INNER[kind].split("/")[0], "--headless", "--detail", "overview", "--frames", "0", *options]

    return made


def rig(*options: str, change: Callable[[Path], object] = lambda _: None) -> Build:
    """Calibrate a rig of two cameras."""

    def made(root: Path) -> list[str]:
        for name in ("c0", "c1"):
            put(CAR, root, f"rig/cameras/{name}")
        shutil.move(root / "rig/cameras/c0/clouds", root / "rig/clouds")
        shutil.rmtree(root / "rig/cameras/c1/clouds")
        change(root / "rig")
        return ["rig", "rig", "--headless", *options]

    return made


RIGS: list[tuple[int, tuple[str, ...]]] = [
    (USAGE, ("--tolerance", "nan/1")),
    (USAGE, ("--tolerance", "1")),
    (USAGE, ("--tolerance=-1deg/1cm",)),
    (USAGE, ("--miscalibrate", "nan,0,0,0,0,0")),
    (USAGE, ("--stages", "9")),
    (USAGE, ("--output", "rig/clouds/0000.bin")),
    (BAD, ("--json", "rig/cameras/c0/calibration.yaml", "--overwrite")),
    (BAD, ("--save", "rig/clouds/0000.bin", "--overwrite")),
]


def las(**changes: Any) -> bytes:
    """A LAS file of which its header says what is not so."""
    said = {"points": len(clouds.POINTS), "start": 227, "length": 20, "kind": 0, "version": 2, "scale": 0.001} | changes
    head = bytearray(227)
    head[:4], head[24], head[25], head[104] = b"LASF", 1, said["version"], said["kind"]
    struct.pack_into("<HI", head, 94, 227, said["start"])
    struct.pack_into("<HI", head, 105, said["length"], said["points"])
    struct.pack_into("<3d", head, 131, *[said["scale"]] * 3)
    rows = (struct.pack("<3iH6x", *(int(1000 * side) for side in row[:3]), 9) for row in clouds.POINTS)
    return bytes(head) + b"".join(rows)


LAS = {
    "4 billion points": las(points=2**32 - 1),
    "rows that begin behind its end": las(start=2**31),
    "rows of no bytes": las(length=0),
    "rows of 65535 bytes": las(length=65535),
    "a scale of NaN": las(scale=float("nan")),
    "a scale of 0": las(scale=0.0),
    "packed, and is not": las(kind=128),
    "of a kind that is not known": las(kind=255),
    "version 1.9": las(version=9),
    "cut": las()[:3000],
    "cut in its header": las()[:120],
    "without points": las(points=0)[:227],
}


def with_car(*command: str, **files: bytes | None) -> Build:
    """A command beside a car's folder and some files, of which those without content are fifos."""

    def made(root: Path) -> list[str]:
        put(CAR, root)
        for name, content in files.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            os.mkfifo(root / name) if content is None else (root / name).write_bytes(content)
        return list(command)

    return made


METHODS = ("regnet", "calibnet", "lccnet", "calibformer")
MASKS: dict[str, bytes | None] = {
    "a fifo": None,
    "junk": b"junk",
    "of another size": pictures.encoded("PNG", pictures.Image.fromarray(pictures.PIXELS[:10, :10])),
    "30000 x 30000": pictures.png(30_000, 30_000, pictures.zlib.compress(bytes(1000))),
}
MEASURED = {
    "empty": b"",
    "a list": b"[]",
    "null": b"null",
    "nested": b"[" * 100_000,
    "junk": b"\xff",
    "a huge number": b'{"rows":' + b"9" * 9000 + b"}",
    "rows that are none": b'{"rows":[{"method":1}]}',
    "a row of NaN": b'{"rows":[NaN]}',
}


def rows() -> Iterator[Row]:
    """Of all of them."""
    for table, key in TOKENS:
        for value in VALUES:
            build = changed(nuscenes, f"{TABLES}/{table}.json", in_every_record(key, value))
            yield Row(f"nuscenes: {key} of {table} {value}", build)
    for what, content in RECORDS.items():
        yield Row(f"nuscenes: {what}", changed(nuscenes, f"{TABLES}/ego_pose.json", content), words=("ego_pose.json",))
    yield from instead_of("a table of nuscenes", nuscenes, f"{TABLES}/sensor.json", "40 GB")
    yield from instead_of("a calibration of KITTI-360", kitti_360, CAR_TO_CAMERA)
    for kind, inner in INNER.items():
        yield from instead_of(f"bag {kind}", bag(kind), inner, *(("40 GB",) if kind == "ros1" else ("40 GB", "noise")))
        for more in ((), ("--overwrite",)):
            yield Row(f"bag {kind} --save over itself {more}", bag(kind, "--save", inner, *more), BAD, (inner,))
        for cut in (10, 200, 4000):
            yield Row(f"bag {kind} cut to {cut}", changed(bag(kind), inner, lambda data, cut=cut: data[:cut]))
    for code, options in RIGS:
        yield Row(f"rig {' '.join(options)}", rig(*options), code)
    yield Row("rig without pictures", rig(change=lambda path: shutil.rmtree(path / "cameras/c1/images")))
    yield from instead_of("calibration of a rig's camera", rig(), "rig/cameras/c1/calibration.yaml")
    for what, content in LAS.items():
        yield Row(f"scan .las: {what}", car_with("clouds/0000.bin", ".las", content), words=("0000.las",))
    run = ["folder", CAR, *RUN]
    for method in METHODS:
        file = f"w/{method}-5deg-0.5m.safetensors"
        foreign = {"ours": (weights.PACKAGE / weights.STAGE).read_bytes(), "junk": b"x" * 100, "a fifo": None}
        for what, content in foreign.items():
            command = with_car(*run, "--method", method, "--weights", "w", **{file: content})
            yield Row(f"weights of {method}: {what}", command, words=(file,))
        yield Row(f"{method} without weights", with_car(*run, "--method", method, "--weights", "nowhere"))
    for what, content in MASKS.items():
        command = with_car(*run, "--method", "calib-anything", "--masks", "m", **{"m/0000/a.png": content})
        yield Row(f"a mask: {what}", command, words=("m/0000/a.png",))
    yield Row("masks of another method", with_car(*run, "--method", "edge-alignment", "--masks", "m"))
    for name in ("bench", "ablate"):
        for what, content in MEASURED.items():
            yield Row(f"{name} --from: {what}", with_car(name, "--from", "t.json", **{"t.json": content}))
        yield Row(f"{name} --from: a fifo", with_car(name, "--from", "t.json", **{"t.json": None}))
    for name in ("live", "watch", "verify"):
        yield Row(f"{name} of nothing", with_car(name, "folder", "nowhere"))
        guess = with_car(name, "folder", CAR, "--guess", "g.yaml", **{"g.yaml": None})
        yield Row(f"{name} --guess a fifo", guess, words=("g.yaml",))
        yield Row(f"{name} of no frame", with_car(name, "folder", CAR, "--frames", "99"))
    over = ("--json", f"{CAR}/calibration.yaml", "--overwrite")
    yield Row("verify --json over its input", lambda root: ["verify", *car(root)[:2], "--frames", "0", *over])
