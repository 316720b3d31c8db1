"""The tables of `ablate`, as rows of text and as Markdown: cost and benefit of each module."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from calibnet.evaluation.published import PUBLISHED_ABLATION
from calibnet.geometry import MiscalibrationRange
from inspector.markdown import markdown_table
from inspector.report.bench_summary import NO_CORRECTION, known_and_other

COSTS = ("parameters", "multiply-adds", "latency", "samples")
ERRORS = ("rigs trained on", "other rigs", "the paper")
HEADS = ("without", *COSTS, *ERRORS)


def title(content: dict[str, Any]) -> str:
    """The title of the tables."""
    label = MiscalibrationRange.parse(content["range"]).label
    return f"Ablation: one pass, from {label}; the paper's figures in brackets"


def tables(content: dict[str, Any]) -> Iterator[tuple[str, list[str], list[list[str]]]]:
    """A table for each preset: its name, the headings of columns that are not empty, and its rows."""
    for preset in dict.fromkeys(row["preset"] for row in content["rows"]):
        rows = [row for row in content["rows"] if row["preset"] == preset]
        known = {row["rig"] for row in rows if row.get("in_rig")}
        lines = [
            _line([row for row in rows if row["name"] == name], known)
            for name in dict.fromkeys(row["name"] for row in rows)
        ]
        if any(line[5] or line[6] for line in lines):
            initial = known_and_other(content.get("initial", ()), known)
            lines.insert(0, [NO_CORRECTION, "", "", "", "", *initial, ""])
        used = [column for column in range(len(HEADS)) if any(line[column] for line in lines)]
        yield preset, [HEADS[k] for k in used], [[line[k] for k in used] for line in lines]


def _line(rows: list[dict[str, Any]], known: set[str]) -> list[str]:
    row = rows[0]
    published, took, samples = PUBLISHED_ABLATION[row["name"]], row["latency_ms"], row.get("samples_trained")
    return [
        "– (full)" if row["name"] == "full" else row["name"],
        f"{row['parameters'] / 1e6:.2f} M ({published.parameters_m:g})",
        f"{row['multiply_adds'] / 1e9:.2f} G ({published.flops_g:g})",
        "" if took is None else f"{took:.0f} ms ({published.latency_ms:g})",
        f"{samples:,}" if samples else "",
        *(["", ""] if "why" in row else known_and_other(rows, known)),
        f"{published.rotation_deg:g}° / {published.translation_cm:g} cm",
    ]


def untrained(content: dict[str, Any]) -> str:
    """A sentence on the rows without errors because their weights are missing; empty if there are none."""
    which = []
    for preset in dict.fromkeys(row["preset"] for row in content["rows"]):
        rows = [row for row in content["rows"] if row["preset"] == preset]
        missing = [row["name"] for row in rows if "why" in row and not row.get("samples_trained")]
        if missing:
            which.append(f"{preset} ({'all rows' if len(missing) == len(rows) else ', '.join(missing)})")
    if not which:
        return ""
    return f"Rows without errors, since they are not trained: {', '.join(which)}."


def as_markdown(content: dict[str, Any]) -> str:
    """The tables as Markdown, for documents."""
    parts = [f"# {title(content)}"]
    for preset, heads, lines in tables(content):
        parts += [f"## {preset}", "\n".join(markdown_table(heads, lines, heads[1:]))]
    of = ", ".join(f"{one['frames']} frames of {one['name']} ({one['rig']})" for one in content["sequences"])
    parts.append(
        f"Mean errors over {of or 'no frames'}, {content['repeats']} miscalibrations each, seed {content['seed']}; "
        f"multiply-adds at {content['input'][0]} x {content['input'][1]}; latency of one pass on "
        f"{content['processor']}, "
        f"{content['threads']} threads. Made by `calib-inspect ablate`."
    )
    return "\n\n".join([*parts, untrained(content)]).strip() + "\n"
