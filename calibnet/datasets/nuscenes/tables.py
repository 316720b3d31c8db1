"""nuScenes's tables: JSON lists of flat records, read one by one since tables of the whole dataset take a gigabyte."""

from __future__ import annotations

import codecs
import json
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from calibnet.datasets.calibration_files import values
from calibnet.errors import DatasetError
from calibnet.geometry import transform
from calibnet.geometry.types import Intrinsics, Transform
from calibnet.runtime.reading import MEGABYTE, open_file

LARGEST_BYTES = 4096 * MEGABYTE
"""Largest size of a table."""
LARGEST_RECORD = MEGABYTE
BETWEEN = re.compile(r"\s*,?\s*")
"""Separator of two records."""
REMEDY = "get it from nuScenes's metadata"
LATEST = 1e16
"""Largest time in microseconds since 1970, in the year 2286."""
LIDAR = "LIDAR_TOP"
NEEDED = ("sample_data", "calibrated_sensor", "sensor", "ego_pose")
"""Required tables; ``sample`` and ``scene`` are needed to tell scenes apart."""
EVERYTHING = "all"
"""Name of the sequence if scenes cannot be told apart."""

Record = Mapping[str, Any]


class Sensor(NamedTuple):
    """One calibration of a sensor: ``car_from_sensor`` 4x4, and the 3x3 matrix of a camera."""

    channel: str
    car_from_sensor: Transform
    matrix: Intrinsics | None


@dataclass(frozen=True)
class Taken:
    """An image or a sweep.

    Attributes:
        file: path of its file.
        seconds: time at which it was taken.
        sensor: token of the sensor's calibration.
        pose: token of the car's pose at that time.
        size: width and height of an image; zeros for a sweep.
    """

    file: Path
    seconds: float
    sensor: str
    pose: str
    size: tuple[int, int]


class Pair(NamedTuple):
    """The image and the sweep of a sample."""

    image: Taken
    sweep: Taken


def find_tables(root: Path, version: str = "") -> Path:
    """The folder of the tables in a root, or the root itself.

    Args:
        root: root folder of nuScenes.
        version: name of the folder; the only one by default.

    Raises:
        DatasetError: there is none, several, or one lacks a table.
    """
    if version:
        found = [root / version]
    else:
        found = sorted({path.parent for path in [*root.glob("sample_data.json"), *root.glob("*/sample_data.json")]})
    if len(found) > 1:
        names = ", ".join(path.name for path in found)
        raise DatasetError(f"{root} has tables of several versions ({names}); choose one with --version.")
    if not found:
        raise DatasetError(f"{root} has no tables; unpack nuScenes's metadata there, for instance v1.0-mini/*.json.")
    for name in NEEDED:
        if not (found[0] / f"{name}.json").exists():
            raise DatasetError(f"Table {found[0] / name}.json does not exist; {REMEDY}.")
    return found[0]


def chosen_scene(tables: Path, asked: str) -> tuple[str, frozenset[str] | None]:
    """Name of a scene, and the tokens of its samples; None for all.

    Args:
        tables: folder of the tables.
        asked: the scene's name or number; the first one if empty.

    Raises:
        DatasetError: there is no such scene, or scenes cannot be told apart.
    """
    if not all((tables / f"{name}.json").exists() for name in ("scene", "sample")):
        if asked in ("", EVERYTHING):
            return EVERYTHING, None
        raise DatasetError(
            f"{tables} has no scene.json and sample.json, which are needed to tell scenes apart; {REMEDY}."
        )
    scenes = {
        text(one, "name", tables, "scene"): text(one, "token", tables, "scene") for one in records(tables, "scene")
    }
    name = asked or next(iter(scenes), "")
    name = name if not name.isdecimal() else f"scene-{name.zfill(4)}"
    if name not in scenes:
        first = ", ".join(list(scenes)[:10]) + (" and more" if len(scenes) > 10 else "")
        raise DatasetError(f"{tables} has no scene {name!r}; scenes there: {first or 'none'}.")
    samples = frozenset(
        text(one, "token", tables, "sample")
        for one in records(tables, "sample")
        if one.get("scene_token") == scenes[name]
    )
    return name, samples


def scene_names(tables: Path) -> list[str]:
    """The names of the scenes, in order; a single empty name if they cannot be told apart."""
    if not all((tables / f"{name}.json").exists() for name in ("scene", "sample")):
        return [""]
    return [text(one, "name", tables, "scene") for one in records(tables, "scene")]


def read_sensors(tables: Path) -> dict[str, Sensor]:
    """The calibrations of all sensors, by token."""
    channels = {
        text(one, "token", tables, "sensor"): text(one, "channel", tables, "sensor")
        for one in records(tables, "sensor")
    }
    path, found = tables / "calibrated_sensor.json", {}
    for one in records(tables, "calibrated_sensor"):
        token = text(one, "token", tables, "calibrated_sensor")
        channel = channels.get(text(one, "sensor_token", tables, "calibrated_sensor"))
        if channel is None:
            raise DatasetError(f"{path}: {token} refers to a sensor that sensor.json does not have; {REMEDY}.")
        intrinsic = one.get("camera_intrinsic")
        matrix = values.numbers(intrinsic, f"{token}.camera_intrinsic", path, (3, 3)) if intrinsic else None
        found[token] = Sensor(channel, pose(one, path), matrix)
    return found


def read_pairs(
    tables: Path, root: Path, sensors: Mapping[str, Sensor], camera: str, samples: Collection[str] | None
) -> list[Pair]:
    """The keyframes of a camera with those of the LiDAR, in temporal order.

    Args:
        tables: folder of the tables.
        root: folder to which paths of files are relative.
        sensors: sensors by token.
        camera: channel of the camera.
        samples: tokens of the wanted samples; None for all.
    """
    images, sweeps = dict[str, Taken](), dict[str, Taken]()
    of_channel = {camera: images, LIDAR: sweeps}
    for one in records(tables, "sample_data"):
        sensor = sensors.get(str(one.get("calibrated_sensor_token")))
        if not one.get("is_key_frame") or sensor is None or sensor.channel not in of_channel:
            continue
        sample = text(one, "sample_token", tables, "sample_data")
        if samples is None or sample in samples:
            of_channel[sensor.channel].setdefault(sample, _taken(one, tables, root))
    both = [Pair(image, sweeps[sample]) for sample, image in images.items() if sample in sweeps]
    return sorted(both, key=lambda pair: pair.image.seconds)


def read_poses(tables: Path, tokens: Collection[str]) -> dict[str, Transform]:
    """``world_from_car`` by token.

    Raises:
        DatasetError: one of them is missing.
    """
    path = tables / "ego_pose.json"
    wanted = set(tokens)
    poses = ((text(one, "token", tables, "ego_pose"), one) for one in records(tables, "ego_pose"))
    found = {token: pose(one, path) for token, one in poses if token in wanted}
    if missing := wanted - found.keys():
        raise DatasetError(f"{path} lacks {len(missing)} of {len(wanted)} poses, {min(missing)} among them; {REMEDY}.")
    return found


def pose(record: Record, path: Path) -> Transform:
    """The transform 4x4 of ``translation`` and ``rotation`` (w x y z)."""
    token = str(record.get("token"))
    turn = values.quaternion(record.get("rotation"), "wxyz", path, f"{token}.rotation")
    return transform(turn, values.numbers(record.get("translation"), f"{token}.translation", path, (3,)))


def records(tables: Path, table: str) -> Iterator[Record]:
    """The records of a table, one in memory at a time.

    Raises:
        DatasetError: the file is missing, damaged, or not a list of records.
    """
    path = tables / f"{table}.json"
    decoder, decode = json.JSONDecoder(), codecs.getincrementaldecoder("utf-8")()
    damaged = DatasetError(f"Table {path} is damaged or not a list of records; {REMEDY}.")
    buffer, at, begun, ended = "", 0, False, False
    try:
        with open_file(path, LARGEST_BYTES) as file:
            while True:
                between = BETWEEN.match(buffer, at)
                at = between.end() if between else at
                if not begun and at < len(buffer):
                    if buffer[at] != "[":
                        raise damaged
                    begun, at = True, at + 1
                    continue
                if begun and buffer.startswith("]", at):
                    return
                try:
                    record, end = decoder.raw_decode(buffer, at) if at < len(buffer) else (None, 0)
                except ValueError:  # the rest of the record may be in the next bytes
                    record, end = None, 0
                if end:
                    if not isinstance(record, dict):
                        raise damaged
                    at = end
                    yield record
                    continue
                data = b"" if ended else file.read(MEGABYTE)
                if ended or len(buffer) - at > LARGEST_RECORD + MEGABYTE:
                    raise damaged
                ended = not data
                buffer, at = buffer[at:] + decode.decode(data, ended), 0
    except (OSError, UnicodeDecodeError, RecursionError) as error:
        raise DatasetError(f"Table {path} cannot be read ({error}); {REMEDY}.") from None


def text(record: Record, key: str, tables: Path, table: str) -> str:
    """A text value of a record.

    Raises:
        DatasetError: it is missing or not a text.
    """
    value = record.get(key)
    if not isinstance(value, str):
        raise DatasetError(f"Table {tables / table}.json has a record without {key}; {REMEDY}.")
    return value


def _taken(one: Record, tables: Path, root: Path) -> Taken:
    name = Path(text(one, "filename", tables, "sample_data"))
    if name.is_absolute() or ".." in name.parts:
        raise DatasetError(f"Table {tables / 'sample_data.json'} names {name}, which is outside {root}; {REMEDY}.")
    sides = [one.get(side) if isinstance(one.get(side), int) else 0 for side in ("width", "height")]
    time = one.get("timestamp")
    if isinstance(time, bool) or not isinstance(time, int | float) or not 0 <= time < LATEST:
        raise DatasetError(f"Table {tables / 'sample_data.json'} has an invalid timestamp; {REMEDY}.")
    return Taken(
        root / name,
        time * 1e-6,
        text(one, "calibrated_sensor_token", tables, "sample_data"),
        text(one, "ego_pose_token", tables, "sample_data"),
        (int(sides[0] or 0), int(sides[1] or 0)),
    )
