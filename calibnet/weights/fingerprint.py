"""Telling one set of weights from another."""

from __future__ import annotations

import glob
import hashlib
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path

from calibnet.errors import WeightsError
from calibnet.geometry import MiscalibrationRange
from calibnet.runtime.reading import open_file
from calibnet.weights.manifest import Manifest, load_manifest

LENGTH = 16
"""Hexadecimal digits: enough to tell sets apart, short enough to read."""


def fingerprint(folder: Path, manifest: Manifest, range_: MiscalibrationRange) -> str:
    """What a stage's answers depend on, as a few digits: its file and how it is used; empty without a file."""
    path = folder / manifest.file(range_)
    if not path.is_file():
        return ""
    settings = manifest.settings(range_)
    used = f"{settings.image_size:g} {settings.looks} {settings.gain:g}"
    return hashlib.sha256(f"{_digest(path, path.stat().st_mtime_ns)} {used}".encode()).hexdigest()[:LENGTH]


def fingerprints(preset: str, folder: Path, ranges: Iterable[MiscalibrationRange]) -> dict[MiscalibrationRange, str]:
    """Those of some stages of the weights in a folder.

    Raises:
        WeightsError: a stage has no weights there.
    """
    manifest = load_manifest(preset, folder)
    found = {range_: fingerprint(folder, manifest, range_) for range_ in ranges}
    if missing := ", ".join(range_.label for range_, mark in found.items() if not mark):
        raise WeightsError(f"There are no weights of {missing} in {folder}; train them with `calib-inspect train`.")
    return found


def digest_of_set(preset: str, folder: Path) -> str:
    """What every answer of a set of weights depends on: its manifest, what is fitted to it, and all its files.

    Raises:
        WeightsError: there is no file of that preset.
    """
    files = sorted(path for path in folder.glob(f"{glob.escape(preset)}*") if path.suffix in (".toml", ".safetensors"))
    if not files:
        raise WeightsError(f"There are no weights of {preset} in {folder}; train them with `calib-inspect train`.")
    marks = [f"{path.name} {_digest(path, path.stat().st_mtime_ns)}" for path in files]
    return hashlib.sha256("\n".join(marks).encode()).hexdigest()[:LENGTH]


@lru_cache(maxsize=32)
def _digest(path: Path, changed: int) -> str:
    """Digest of a file's bytes; read again when the file has changed."""
    with open_file(path) as file:
        return hashlib.sha256(file.read()).hexdigest()
