"""The result of watching a drive, in words and as JSON."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from calibnet.geometry.types import Floats
from calibnet.watch import SMALLEST_CM, SMALLEST_DEG, WINDOW, Change, Watch, Watched

NO_CHANGE, CHANGED, CANNOT_TELL = "no change", "changed", "cannot tell"
AXES = ("x", "y", "z", "pitch", "yaw", "roll")
"""Axes of an offset: moves along the camera's axes (right, down, ahead), and turns about them."""


def result_word(watched: Watched) -> str:
    """The result in a word: no change, changed or cannot tell."""
    if watched.watch is None or watched.reason:
        return CANNOT_TELL
    return CHANGED if watched.watch.changes else NO_CHANGE


def sentences(watched: Watched) -> Iterator[str]:
    """One sentence per change, and a last one with the result."""
    found = watched.watch
    for change in () if found is None else found.changes:
        yield change_sentence(change)
    skipped = len(watched.skipped)
    frames = f"{watched.used} frames" + (f", {skipped} skipped" if skipped else "")
    if found is None or watched.reason:
        yield f"Cannot tell. {watched.reason}"
    elif found.changes:
        count = len(found.changes)
        yield f"Changed: the mount moved {'once' if count == 1 else f'{count} times'} ({frames})."
    else:
        turn, shift = detectable_step(found)
        seen = f"A step of {turn:.2g}° or {shift:.0f} cm that lasts {WINDOW} frames would have been detected."
        yield f"No change ({frames}). {seen}"


def change_sentence(change: Change) -> str:
    """A sentence on a change."""
    size = f"{change.rotation_deg:.2f}° / {change.translation_cm:.0f} cm"
    turn, shift = most(change)
    shifted = f" and {shift}" if change.translation_cm >= SMALLEST_CM else ""
    axes = f"most of it {turn}{shifted}" if change.rotation_deg >= SMALLEST_DEG else f"most of it {shift}"
    sure = "confidence > 99.99 %" if change.confidence > 0.9999 else f"confidence {100 * change.confidence:.4g} %"
    if change.until is not None:
        return f"Frames {change.frame} to {change.until}: the mount drifts by {size} ({axes}; {sure})."
    return f"Frame {change.frame}: the mount moved by {size} ({axes}; {sure})."


def most(change: Change) -> tuple[str, str]:
    """The rotation and the translation of the axes in which a change is largest."""
    turn, shift = int(np.argmax(np.abs(change.offset[3:]))), int(np.argmax(np.abs(change.offset[:3])))
    return AXES[3 + turn], AXES[shift]


def detectable_step(found: Watch) -> tuple[float, float]:
    """Smallest step, in degrees and centimetres on the worst axis, that two windows of frames show at 4σ."""
    return float(np.degrees(4 * found.smallest[3:].max())), float(100 * 4 * found.smallest[:3].max())


def as_json(watched: Watched) -> dict[str, Any]:
    """The JSON object of a watched drive."""
    found = watched.watch
    changes = [] if found is None else [of_change(change) for change in found.changes]
    return {
        "result": result_word(watched),
        "reason": watched.reason,
        "changes": changes,
        "camera_from_lidar": None if watched.camera_from_lidar is None else watched.camera_from_lidar.tolist(),
        "windows": [] if found is None else list(of_windows(found)),
        "frames": {"used": watched.used, "skipped": [vars(bad) for bad in watched.skipped]},
    }


def of_change(change: Change) -> dict[str, Any]:
    """The JSON object of a change; a drift also has the frame at its end."""
    content: dict[str, Any] = {
        "frame": change.frame,
        "rotation_deg": change.rotation_deg,
        "translation_cm": change.translation_cm,
        "confidence": change.confidence,
        "offset": dict(zip(AXES, in_units(change.offset).tolist(), strict=True)),
    }
    return content if change.until is None else content | {"until": change.until}


def of_windows(found: Watch) -> Iterator[dict[str, Any]]:
    """The windowed estimate and its deviation at every frame, in centimetres and degrees."""
    for frame, mean, sigma in zip(found.frames, in_units(found.windowed), in_units(found.sigma), strict=True):
        named = {"estimate": dict(zip(AXES, mean.tolist(), strict=True))}
        yield {"frame": int(frame), **named, "sigma": dict(zip(AXES, sigma.tolist(), strict=True))}


def in_units(offsets: Floats) -> Floats:
    """Offsets ``[..., 6]`` in centimetres and degrees."""
    return np.asarray(offsets * np.array([100.0] * 3 + [np.degrees(1.0)] * 3))
