"""Progress bars of a run."""

from __future__ import annotations

from collections.abc import Callable

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TimeRemainingColumn
from rich.text import Text

from calibnet.runtime.interruption import StopRequest
from calibnet.runtime.text import one_line


def drive_observer(progress: Progress, stop: StopRequest, name: str = "whole drive") -> Callable[[int, int], None]:
    """An observer that shows the progress of solving a drive, and ends it when a stop is requested."""
    task = progress.add_task(name, total=None)

    def advance(read: int, total: int) -> None:
        progress.update(task, completed=read, total=total)
        if stop.requested:
            raise KeyboardInterrupt

    return advance


class _Description(ProgressColumn):
    """The description as plain text; rich would read brackets in a name as markup."""

    def render(self, task: Task) -> Text:
        return Text(one_line(task.description))


class _FramesPerSecond(ProgressColumn):
    def render(self, task: Task) -> Text:
        return Text(
            "" if task.speed is None or task.total is None or "MB" in task.description else f"{task.speed:.1f} frames/s"
        )


class _Left(TimeRemainingColumn):
    def render(self, task: Task) -> Text:
        return Text("") if task.finished or task.total is None else super().render(task).append(" left")


class _Counted(MofNCompleteColumn):
    def render(self, task: Task) -> Text:
        return Text("") if task.total is None else super().render(task)


def frame_progress(console: Console, transient: bool = False) -> Progress:
    """A bar that counts frames; a transient one leaves nothing behind."""
    columns = (_Description(), BarColumn(), _Counted(), _FramesPerSecond(), _Left())
    return Progress(*columns, console=console, speed_estimate_period=10.0, transient=transient)
