"""Fingerprints that identify a set of weights."""

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
"""Number of hexadecimal digits of a fingerprint."""


def fingerprint(folder: Path, manifest: Manifest, range_: MiscalibrationRange) -> str:
    """A digest of everything that a stage's results depend on, its file and settings; empty without a file."""
    path = folder / manifest.file(range_)
    if not path.is_file():
        return ""
    settings = manifest.settings(range_)
    used = f"{settings.image_size:g} {settings.looks} {settings.gain:g}"
    return hashlib.sha256(f"{_digest(path, path.stat().st_mtime_ns)} {used}".encode()).hexdigest()[:LENGTH]


def fingerprints(preset: str, folder: Path, ranges: Iterable[MiscalibrationRange]) -> dict[MiscalibrationRange, str]:
    """Fingerprints of some stages of the weights in a folder.

    Raises:
        WeightsError: a stage has no weights there.
    """
    manifest = load_manifest(preset, folder)
    found = {range_: fingerprint(folder, manifest, range_) for range_ in ranges}
    if missing := ", ".join(range_.label for range_, mark in found.items() if not mark):
        raise WeightsError(f"There are no weights of {missing} in {folder}; train them with `calib-inspect train`.")
    return found


def digest_of_set(preset: str, folder: Path) -> str:
    """A digest of all that results of a set of weights depend on: manifest, fitted coefficients and files.

    Raises:
        WeightsError: there is no file of this preset.
    """
    files = sorted(path for path in folder.glob(f"{glob.escape(preset)}*") if path.suffix in (".toml", ".safetensors"))
    if not files:
        raise WeightsError(f"There are no weights of {preset} in {folder}; train them with `calib-inspect train`.")
    marks = [f"{path.name} {_digest(path, path.stat().st_mtime_ns)}" for path in files]
    return hashlib.sha256("\n".join(marks).encode()).hexdigest()[:LENGTH]


@lru_cache(maxsize=32)
def _digest(path: Path, changed: int) -> str:
    """Digest of a file's bytes, computed again if the file has changed."""
    with open_file(path) as file:
        return hashlib.sha256(file.read()).hexdigest()
