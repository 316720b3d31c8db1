"""Progress of a training run on the console, and several observers as one."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

    from calibnet.training.progress import Observer, Progress
    from calibnet.training.validation import ValidationFigures


class Observers:
    """An observer that passes everything on to several others."""

    def __init__(self, observers: list[Observer]) -> None:
        self.observers = observers

    def progressed(self, progress: Progress) -> None:
        """Tell all of them."""
        for observer in self.observers:
            observer.progressed(progress)

    def validated(self, progress: Progress, figures: ValidationFigures) -> None:
        """Tell all of them."""
        for observer in self.observers:
            observer.validated(progress, figures)


class ConsoleObserver:
    """Prints a line of losses every few seconds and a line of errors after each validation."""

    def __init__(self, console: Console) -> None:
        self.console = console

    def progressed(self, progress: Progress) -> None:
        """Print the running means."""
        losses = progress.losses
        pose = "warm-up, no pose yet"
        if math.isfinite(losses["rotation_deg"]):
            pose = f"rotation {losses['rotation_deg']:.2f}°  translation {losses['translation_cm']:.1f} cm"
        terms = "  ".join(f"{name} {losses[name]:.3f}" for name in losses if not name.endswith(("_deg", "_cm")))
        self.console.print(
            f"{progress.share:4.0%}  {progress.minutes:6.1f} min  {progress.samples:8,d} samples  "
            f"{progress.samples_per_second:5.1f}/s  {terms}  " + pose,
        )

    def validated(self, progress: Progress, figures: ValidationFigures) -> None:
        """Print the errors beside the initial ones."""
        self.console.print(
            f"validation after {progress.samples:,d} samples, {figures.samples} single looks, medians: "
            f"rotation {figures.initial_rotation_deg:.2f}° -> {figures.rotation_deg:.2f}° "
            f"(p95 {figures.rotation_p95_deg:.2f}°), "
            f"translation {figures.initial_translation_cm:.1f} -> {figures.translation_cm:.1f} cm",
            style="bold",
        )
