"""Writes an accepted calibration to a new file, never to the one that was read."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calibnet.datasets.frame import Frame
from calibnet.geometry.types import Extrinsic
from calibnet.runtime.writing import check_output, write_whole
from calibnet.verdict import ACCEPTED, Verdict
from inspector.export.conformance import example
from inspector.export.exported import Exported
from inspector.export.registry import export_as, kind_of_export
from inspector.live.tries import Try
from inspector.verdicts import explained


@dataclass(frozen=True)
class Target:
    """File for an accepted calibration.

    Attributes:
        file: path of the file; one that was written here before is replaced.
        form: format, from `inspector.export.registry.FORMATS`.
    """

    file: Path
    form: str = "yaml"

    def check(self) -> None:
        """Check before the work that the file may be written.

        Raises:
            OutputError: it must not be written.
        """
        check_output(self.file, kind_of_export(export_as(self.form, example())))

    def write(self, frame: Frame, extrinsic: Extrinsic, origin: str, verdict: Verdict | None) -> str:
        """Write a calibration; returns a sentence that says so.

        Raises:
            OutputError: the file must not be replaced.
        """
        doubt = doubts(verdict)
        exported = Exported(
            extrinsic, frame.as_taken.camera, f"{origin}; {doubt}" if doubt else origin, verdict=verdict
        )
        text = export_as(self.form, exported)
        replaced = write_whole(self.file, text.encode(), kind_of_export(text))
        return f"{'Replaced' if replaced else 'Wrote'} {self.file.resolve()}."


def verdict_on(extrinsic: Extrinsic, tries: list[Try]) -> Verdict | None:
    """The newest verdict on exactly this extrinsic; None if it was set by hand."""
    for made in reversed(tries):
        if np.allclose(made.found, extrinsic, atol=1e-9):
            return made.verdict
    return None


def doubts(verdict: Verdict | None) -> str:
    """Reason to doubt a calibration before keeping it; empty if it is accepted."""
    if verdict is None:
        return "set by hand, without a verdict"
    return "" if verdict.word == ACCEPTED else f"{verdict.word}: {explained(verdict)}"
