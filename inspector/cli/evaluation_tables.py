"""Tables that `evaluate` prints of rotation, translation and success, and sentences on verdicts and the audit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from calibnet.verdict import ACCEPTED, DRIVE_TOLERANCES, FRAME_TOLERANCES

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from calibnet.evaluation.battery import Battery
    from calibnet.evaluation.metrics import Metrics
    from calibnet.evaluation.runner import Evaluation


def print_evaluation(evaluation: Evaluation, console: Console) -> None:
    """Print the frames measured on, then tables of rotation, translation and success."""
    runs = len(evaluation.runs)
    console.print(
        f"{', '.join(evaluation.sequences)} ({evaluation.rig}): {evaluation.frames} frames x {evaluation.repeats} = "
        f"{runs} runs from {evaluation.range.label}, "
        f"seed {evaluation.seed}"
    )
    rows = [("initial", evaluation.initial)]
    rows += [(name, metrics) for name, metrics in evaluation.references.items() if metrics is not evaluation.initial]
    rows += [(f"stage {stage.number} ({stage.range})", stage.metrics) for stage in evaluation.stages]
    if evaluation.accepted is not None and evaluation.verdicts[ACCEPTED] < len(evaluation.runs):
        rows.append(("accepted runs", evaluation.accepted))
    if evaluation.drives_networks is not None:
        rows.append(("drive, networks", evaluation.drives_networks))
    if evaluation.drives is not None:
        rows.append(("drive", evaluation.drives))
    rows += [(f"audit: {name}", metrics) for name, metrics in evaluation.audit.items()]
    for title, key, decimals in (
        ("Rotation error, degrees", "rotation_deg", 3),
        ("Translation error, cm", "translation_cm", 2),
    ):
        console.print(error_table(title, [(name, metrics.as_dict()[key]) for name, metrics in rows], decimals))
    console.print(success_table(rows))
    if evaluation.audit:
        console.print(audit_sentence(evaluation))
    if sum(evaluation.verdicts.values()):
        console.print(verdict_sentence(evaluation))
    for line in coverage_sentences(evaluation):
        console.print(line)
    if evaluation.failed:
        console.print(
            f"{evaluation.failed} of {runs} runs could not be calibrated and count with their initial error.",
            style="yellow",
        )


def print_battery(battery: Battery, console: Console) -> None:
    """Print a row per fault and strength, and the rates of false and of right acceptance."""
    table = plain_table("Battery: verdicts on frames with a fault")
    for heading in ("runs", "accepted, right", "accepted, wrong", "rejected", "cannot tell", "cause right"):
        table.add_column(heading, justify="right")
    for row in battery.rows:
        counts = (row.runs, row.accepted_right, row.accepted_wrong, row.rejected, row.cannot_tell, row.cause_right)
        table.add_row(f"{row.corruption} {row.strength}".strip(), *map(str, counts))
    console.print(table)
    frame, drive = FRAME_TOLERANCES, DRIVE_TOLERANCES
    claims = f"certain to be within {frame[1]} ({drive[1]}) though not: {battery.false_claim_rate:.1%}"
    console.print(
        f"Accepted though not within {frame[0]} (drives, the rows of one and of two mounts: {drive[0]}): "
        f"{battery.false_accept_rate:.1%} of {len(battery.runs)} runs; {claims}. "
        f"Accepted of the frames without fault that end right: {battery.acceptance_of_good:.0%}."
    )


def coverage_sentences(evaluation: Evaluation) -> Iterator[str]:
    """How the stated covariances compare with the errors, and the verdicts on drives."""
    for of, coverage in (
        ("frames that are not rejected", evaluation.coverage),
        ("accepted frames", evaluation.coverage_accepted),
        ("drives that are not rejected", evaluation.drives_coverage),
    ):
        if coverage is not None:
            yield f"Stated covariances of {of}: {coverage}."
    if evaluation.drives_verdicts:
        words = ", ".join(f"{count} {word}" for word, count in evaluation.drives_verdicts.items())
        yield f"Drives: {words}; {evaluation.drives_claims}."


def audit_sentence(evaluation: Evaluation) -> str:
    """The share of the initial rotation error that is left with the true image and with others."""
    initial = evaluation.initial.rotation_deg.median
    left = {"the true image": evaluation.final, f"images of {evaluation.audit_images}": evaluation.audit["swapped"]}
    left |= {"a grey image": evaluation.audit["grey"], "half the rings": evaluation.audit["thinned"]}
    shares = ", ".join(f"{metrics.rotation_deg.median / initial:.0%} with {name}" for name, metrics in left.items())
    return f"Share of the initial rotation error (median) that is left: {shares}."


def verdict_sentence(evaluation: Evaluation) -> str:
    """The number of runs with each verdict, and how many of the audit's runs were rejected."""
    counts = ", ".join(f"{count} {word}" for word, count in evaluation.verdicts.items())
    with_audit = ", ".join(f"{count} with the audit's {name}" for name, count in evaluation.audit_rejected.items())
    said = f"Of {len(evaluation.runs)} runs: {counts}; {evaluation.claims}."
    return f"{said} Also rejected: {with_audit}." if with_audit else said


def error_table(title: str, rows: list[tuple[str, dict[str, float]]], decimals: int) -> Table:
    """A table with one row for each of ``rows``; columns per axis are mean absolute errors."""
    table = plain_table(title)
    largest = max(max(figures.values()) for _, figures in rows)
    decimals = min(decimals, max(0, 4 - len(f"{largest:.0f}")))  # wider numbers would not fit
    for heading in rows[0][1]:
        table.add_column(heading, justify="right")
    for name, figures in rows:
        table.add_row(name, *(f"{value:.{decimals}f}" for value in figures.values()))
    return table


def success_table(rows: list[tuple[str, Metrics]]) -> Table:
    """A table of the share of runs below both limits."""
    table = plain_table("Success rate")
    table.add_column("< 2° and < 5 cm", justify="right")
    table.add_column("< 1° and < 2.5 cm", justify="right")
    for name, metrics in rows:
        table.add_row(name, f"{metrics.success_2deg_5cm:.1%}", f"{metrics.success_1deg_2_5cm:.1%}")
    return table


def plain_table(title: str) -> Table:
    """An empty table for 80 columns, whose first column names the row."""
    from rich import box
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD)
    table.add_column("after", no_wrap=True)
    return table
