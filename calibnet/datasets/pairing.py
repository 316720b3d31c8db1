"""Pairs images and scans by name, or by nearest time."""

from __future__ import annotations

import datetime
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calibnet.errors import DatasetError
from calibnet.geometry.types import Floats
from calibnet.runtime.reading import read_lines
from calibnet.runtime.text import number_of

TIMES = "timestamps.txt"
"""File of times in a folder, with one line per file in the order of their names."""
MAX_TIME_DIFFERENCE_MS = 50.0
"""Default largest time between image and scan of a frame, half a turn of a scanner."""
WORTH_A_WARNING_MS = 20.0
"""Time between image and scan above which the user is warned, in which a car at 50 km/h moves 28 cm."""
CLOCK_DIGITS = {10: 1.0, 13: 1e-3, 16: 1e-6, 19: 1e-9}
"""Unit in seconds of a time since 1970, by its number of digits."""
TIME_IN_NAME = re.compile(
    r"(?:.*[^\d.])?(\d{13}|\d{16}|\d{19}|\d{10}[._]\d{3,9})|(\d{10,19}|\d{9,10}_\d+|\d{1,10}\.\d{3,})"
)
"""A time since 1970 as a file name or, for milliseconds and finer, at its end, as in nuScenes; or a clock's seconds."""
DATE = re.compile(
    r"(\d{4})[-_]?(\d\d)[-_]?(\d\d)[ T_-](\d\d)[:_-]?(\d\d)[:_-]?(\d\d)"
    r"(?:[.,](\d+)|[_-](\d{3}|\d{6}|\d{9}))?(Z|[+-]\d\d:?\d\d)?"
)
"""A date as a time or a file name, as in KITTI, ISO 8601 and ``20260301_140506_123``."""
NEWEST = 4e9
"""Largest time in seconds since 1970."""


@dataclass(frozen=True)
class Pair:
    """An image and a scan of one moment, or only one of them.

    Attributes:
        stem: file name of the image without suffix, or of the scan if there is no image.
        image: file of the image; None if missing.
        scan: file of the scan; None if missing.
        seconds: time of the image; None if unknown.
    """

    stem: str
    image: Path | None
    scan: Path | None
    seconds: float | None = None


@dataclass(frozen=True)
class Pairing:
    """The frames of a folder, and sentences for the user on the pairing."""

    pairs: list[Pair]
    notes: tuple[str, ...] = ()


def pair(images: Mapping[str, Path], scans: Mapping[str, Path], most_ms: float | None = None) -> Pairing:
    """Pair the images and scans of two folders, each sorted by name.

    They are paired by name if every name has a partner or times are unknown; a file without a partner is kept, and
    reported when it is read. If no name is in both folders and names in each differ only in a number (``frame_0001``,
    ``scan_0001``), they are paired by number. Otherwise they are paired by time, from `TIMES` or the names: each image
    with the nearest scan, and each scan once.

    Args:
        images: files by stem.
        scans: likewise.
        most_ms: largest time between image and scan in milliseconds; if given, pairs by time.

    Raises:
        DatasetError: nothing pairs, or times are requested but unknown.
    """
    image_times, scan_times = times_of(images), times_of(scans)
    by_time = image_times is not None and scan_times is not None
    if most_ms is not None and not by_time:
        lacking = next(iter((images if image_times is None else scans).values())).parent
        raise DatasetError(
            f"{lacking} has no times for pairing; write {lacking / TIMES} with one time per line, in seconds, or name "
            "the "
            "files by their times."
        )
    if most_ms is None and (images.keys() == scans.keys() or not by_time):
        if not images.keys() & scans.keys() and (numbered := _numbered(images, scans)) is not None:
            return numbered
        return _by_name(images, scans, image_times)
    assert image_times is not None and scan_times is not None
    return _by_time(images, scans, image_times, scan_times, MAX_TIME_DIFFERENCE_MS if most_ms is None else most_ms)


def _by_name(images: Mapping[str, Path], scans: Mapping[str, Path], times: Floats | None) -> Pairing:
    if not images.keys() & scans.keys():
        image_folder, scan_folder = (next(iter(files.values())).parent for files in (images, scans))
        raise DatasetError(
            f"{image_folder} ({len(images)} images, the first {next(iter(images))}) and {scan_folder} ({len(scans)} "
            f"scans, the first {next(iter(scans))}) have no name in common; give an image and its scan the same name, "
            "name them by "
            f"their times, or write their times to a {TIMES} in each folder."
        )
    seconds = dict(zip(images, times.tolist() if times is not None else [None] * len(images), strict=True))
    stems = [*images, *(stem for stem in scans if stem not in images)]
    pairs = [Pair(stem, images.get(stem), scans.get(stem), seconds.get(stem)) for stem in stems]
    lacking = [stem for stem in stems if stem not in images or stem not in scans]
    if not lacking:
        return Pairing(pairs)
    few = ", ".join(lacking[:3]) + (" and so on" if len(lacking) > 3 else "")
    return Pairing(pairs, (f"{len(lacking)} of {len(stems)} names have only an image or only a scan ({few}).",))


def _numbered(images: Mapping[str, Path], scans: Mapping[str, Path]) -> Pairing | None:
    """Pairs of the same number; None if names differ in more than that, or both folders have numbers of their own.

    If one folder counts from 0 and the other from 1, pairs would be wrong.
    """
    image_numbers, scan_numbers = numbers_in(images), numbers_in(scans)
    if image_numbers is None or scan_numbers is None:
        return None
    if not (image_numbers.keys() <= scan_numbers.keys() or scan_numbers.keys() <= image_numbers.keys()):
        return None
    image, scan = next((image_numbers[one], scan_numbers[one]) for one in image_numbers if one in scan_numbers)
    renamed = {image_numbers.get(number, stem): scans[stem] for number, stem in scan_numbers.items()}
    paired = _by_name(images, renamed, times_of(images))
    return Pairing(
        paired.pairs, (f"Paired by the number in their names, for instance {image} and {scan}.", *paired.notes)
    )


def numbers_in(stems: Iterable[str]) -> dict[int, str] | None:
    """Names by the last number in each; None if they differ in anything else, or a number is missing or repeated."""
    found = [(re.fullmatch(r"(.*?)(\d{1,18})(\D*)", stem), stem) for stem in stems]
    parts = {(match[1], match[3]) for match, _ in found if match is not None}
    numbers = {int(match[2]): stem for match, stem in found if match is not None}
    return numbers if len(parts) == 1 and len(numbers) == len(found) else None


def _by_time(
    images: Mapping[str, Path], scans: Mapping[str, Path], image_times: Floats, scan_times: Floats, most_ms: float
) -> Pairing:
    order = np.argsort(scan_times, kind="stable")
    names, files, times = list(scans), list(scans.values()), scan_times[order]
    nearest = np.clip(np.searchsorted(times, image_times), 1, max(1, len(times) - 1))
    if len(times) > 1:
        before_is_nearer = image_times - times[nearest - 1] <= times[np.minimum(nearest, len(times) - 1)] - image_times
        nearest = nearest - before_is_nearer
    else:
        nearest = np.zeros(len(image_times), np.int64)
    apart = np.abs(times[nearest] - image_times) * 1000
    best: dict[int, int] = {}
    for position in np.argsort(apart, kind="stable").tolist():
        if apart[position] <= most_ms:
            best.setdefault(int(nearest[position]), position)  # each scan goes to the nearest image
    stems = list(images)
    pairs = [
        Pair(stems[position], images[stems[position]], files[order[scan]], float(image_times[position]))
        for scan, position in sorted(best.items(), key=lambda one: image_times[one[1]])
    ]
    if not pairs:
        raise DatasetError(
            f"No image of {next(iter(images.values())).parent} has a scan within {most_ms:g} ms, the nearest is "
            f"{apart.min():.0f} ms away; check that both clocks agree, or give a larger --max-time-difference."
        )
    farthest = float(max(apart[position] for position in best.values()))
    note = f"Paired by time: {number_of(len(pairs), 'frame')}, image and scan up to {farthest:.0f} ms apart"
    left_images, left_scans = len(images) - len(pairs), len(names) - len(pairs)
    if left_images or left_scans:
        note += f"; {number_of(left_images, 'image')} and {number_of(left_scans, 'scan')} are left out"
    notes = [f"{note}."]
    if farthest > WORTH_A_WARNING_MS:
        notes.append(
            f"At 50 km/h, {farthest:.0f} ms are {farthest / 1000 * 50 / 3.6 * 100:.0f} cm, which limits the accuracy "
            "of frames taken "
            "while driving; those taken at a standstill are not affected."
        )
    return Pairing(pairs, tuple(notes))


def times_of(files: Mapping[str, Path]) -> Floats | None:
    """Times of files in seconds, from `TIMES` beside them or from their names; None without either.

    Raises:
        DatasetError: `TIMES` exists but does not match the files.
    """
    path = next(iter(files.values())).parent / TIMES
    if path.exists():
        lines = [line.strip() for line in read_lines(path, "Times")]
        words = [line for line in lines if line and not line.startswith("#")]
        words = _by_file(words, files) or words
        seconds = [_seconds(word) for word in words]
        if None in seconds:
            raise DatasetError(
                f"{path}: {words[seconds.index(None)][:40]!r} is not a time; write seconds, or nanoseconds since 1970, "
                "or "
                "2026-11-26 13:02:25.594."
            )
        if len(seconds) != len(files):
            raise DatasetError(f"{path} has {len(seconds)} times for {len(files)} files; write one per line.")
        return np.array(seconds, dtype=np.float64)
    seconds = [_in_name(stem) for stem in files]
    return None if None in seconds else np.array(seconds, dtype=np.float64)


def _by_file(lines: list[str], files: Mapping[str, Path]) -> list[str] | None:
    """The times of all files in order, from lines that name a file and its time, in either order; None for others."""
    names = {name: stem for stem, path in files.items() for name in (path.name, stem)}
    found: dict[str, str] = {}
    for line in lines:
        first, second = ([*re.split(r"[,;\s]+", line, maxsplit=1), ""])[:2]
        for name, time in ((first, second), (second, first)):
            if (stem := names.get(name.rpartition("/")[2])) is not None and _seconds(time) is not None:
                found.setdefault(stem, time)
                break
    return [found[stem] for stem in files] if found.keys() == files.keys() else None


def _in_name(stem: str) -> float | None:
    """The time that a file name is, or ends with."""
    date = re.sub(r"^\D+", "", stem)
    if (parts := DATE.fullmatch(date)) is not None and (parts[7] or parts[8]):
        return _of_date(date)
    match = TIME_IN_NAME.fullmatch(stem)
    return None if match is None else _seconds((match[1] or match[2]).replace("_", "."))


def _seconds(word: str) -> float | None:
    """Seconds of a time in any of the usual forms."""
    if re.fullmatch(r"\d+", word) and (unit := CLOCK_DIGITS.get(len(word))) is not None:
        return int(word) * unit if int(word) * unit < NEWEST else None
    if DATE.fullmatch(word) is not None:  # first, since Python reads 2026_03_01_14_05_06 as a number
        return _of_date(word)
    try:
        number = float(word)
    except ValueError:
        return None
    return number if np.isfinite(number) and abs(number) < NEWEST else None


def _of_date(word: str) -> float | None:
    """Seconds of a `DATE`, in UTC unless it says otherwise; a leap second counts as the one after it."""
    match = DATE.fullmatch(word)
    if match is None:
        return None
    year, month, day, hour, minute, second, fraction, further, zone = match.groups()
    leap = second == "60"
    text = f"{year}-{month}-{day}T{hour}:{minute}:{'59' if leap else second}{zone or '+00:00'}"
    try:
        whole = datetime.datetime.fromisoformat(text).timestamp()
    except ValueError:
        return None
    return whole + leap + float(f"0.{fraction or further or 0}")
