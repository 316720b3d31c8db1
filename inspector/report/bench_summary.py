"""The first table of `bench` for a range: one row per method, over its training rigs and over all others."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from inspector.report.bench_rows import KINDS, NOTHING, costs, refused, rows

ERRORS = ("rigs trained on", "other rigs", "refused")
IMAGES = ("grey image", "other image")
COSTS = ("a frame", "parameters")
NO_CORRECTION, NOT_RUN = "no correction", "not run"
LEGEND = (
    "Mean errors of rotation and translation. A refused run counts with its initial error; if the time limit was "
    "reached, the number of planned runs is in brackets. For methods without training, the columns have the same rigs "
    "as for the trained ones. Grey image, other image: errors when the image is made grey, or replaced by one of "
    "another drive. A method that then refuses, or does not reduce the error, uses the image; one that corrects as "
    "before reads its answer off the scan. Why a method was not run is said in the table by rig."
)


def summary(content: dict[str, Any], range_: str) -> tuple[list[str], list[list[str]]]:
    """Headings and rows of the table for a range."""
    of_range = [row for row in rows(content) if row.range == range_]
    known = {row.rig for row in of_range if row.known == "known"}
    heads = ["method", "of", *ERRORS, *IMAGES, *COSTS, "its paper"]
    body = []
    initial = [one for one in content.get("initial", ()) if one["range"] == range_]
    if initial:
        body.append([NO_CORRECTION, "frames", *known_and_other(initial, known), *[NOTHING] * (len(heads) - 4)])
    for name, entry in content["methods"].items():
        here = entry.get("costs_of", range_) == range_  # the number of networks depends on the range
        told = [costs(entry)[head] if here else NOTHING for head in COSTS]
        beside = [*_images(entry, range_), *told, _claim(entry)]
        own = [row for row in of_range if row.method == name]
        for of in dict.fromkeys(row.of for row in own):  # figures beside the errors, once
            figures = [row.figures for row in own if row.of == of]
            where = {row.rig for row in own if row.known == "known"} if entry["samples_trained"] else known
            body.append(
                [name, NOT_RUN if of == NOTHING else of, *known_and_other(figures, where), refused(figures), *beside]
            )
            beside = [NOTHING] * len(beside)
    used = [k for k in range(len(heads)) if k < 2 or any(line[k] != NOTHING for line in body)]
    return [heads[k] for k in used], [[line[k] for k in used] for line in body]


def _images(entry: dict[str, Any], range_: str) -> list[str]:
    audit = entry["audit"] if entry["audit"].get("range") == range_ else {}
    return [_altered(audit.get(name)) for name in ("grey", "swapped")]


def known_and_other(figures: Iterable[dict[str, Any]], known: set[str]) -> list[str]:
    """Mean errors over all runs on training rigs, and over all runs on other rigs."""
    parts: tuple[list[dict[str, Any]], ...] = [], []
    for one in figures:
        parts[one["rig"] not in known].append(one)
    return [_mean(part) for part in parts]


def _mean(figures: list[dict[str, Any]]) -> str:
    measured = [one for one in figures if all(one.get(kind) for kind in KINDS)]
    runs = sum(one["runs"] for one in measured)
    if not runs:
        return "refused" if any(one.get("runs") for one in figures) else NOTHING
    means = (sum(one["runs"] * one[kind]["mean"] for one in measured) / runs for kind in KINDS)
    return pair(*means)


def pair(degrees: float, centimetres: float) -> str:
    """Text of a cell with both errors."""
    return f"{degrees:.2f}° / {centimetres:.{0 if centimetres >= 10 else 1}f} cm"


def _altered(row: dict[str, Any] | None) -> str:
    if not row:
        return NOTHING
    if not row.get("refused"):
        return NOTHING if "why" in row else pair(*(row[kind]["mean"] for kind in KINDS))
    return "refused" if row["refused"] == row["runs"] else f"{row['refused'] / row['runs']:.0%} refused"


def _claim(entry: dict[str, Any]) -> str:
    if not entry["claims"]:
        return NOTHING
    first = entry["claims"][0]
    return f"{first['rotation_deg']:g}° / {first['translation_cm']:g} cm from {first['range']}"
