"""Progress of a fleet on the terminal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from inspector.cli.output import make_console

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

    from inspector.fleet.table import Row


class FleetProgress:
    """A bar that counts drives and their verdicts, with a line for each that failed; in a log, a line for each."""

    def __init__(self, progress: Progress, task: TaskID) -> None:
        self._progress, self._task = progress, task
        self._counts: Counter[str] = Counter()

    def advance(self, row: Row) -> None:
        """Count a finished drive."""
        self._counts[row.verdict] += 1
        said = ", ".join(f"{count} {word}" for word, count in sorted(self._counts.items()))
        self._progress.update(self._task, advance=1, said=said)
        console, failed = self._progress.console, row.verdict == "failed"
        if failed:
            console.print(f"Failed: {row.name}: {row.reason}", style="yellow")
        elif not console.is_terminal:  # a bar that nobody sees grow tells a log nothing
            console.print(f"{row.name}: {row.verdict}")


@contextmanager
def fleet_progress(total: int) -> Iterator[FleetProgress]:
    """Show the bar while drives run; nothing if there are none."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("drives"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[said]}", markup=False))
    progress = Progress(*columns, TimeRemainingColumn(), TextColumn("left"), console=make_console(), disable=not total)
    with progress:
        yield FleetProgress(progress, progress.add_task("drives", total=total, said=""))
