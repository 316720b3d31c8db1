"""Counts how often results claim to be within the coarser tolerance, and how often that is wrong."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

from calibnet.geometry import PoseError
from calibnet.verdict import Tolerance


@dataclass(frozen=True)
class Claims:
    """Counts of results that claim to be within a tolerance, see `calibnet.verdict.Verdict.within`.

    Attributes:
        tolerance: the coarser tolerance of frames, or of drives.
        results: number of results.
        within: number that are within the tolerance.
        claimed: number that claim to be within it, or within the finer tolerance.
        wrong: number that claim so, but are not within the coarser tolerance.
    """

    tolerance: Tolerance
    results: int
    within: int
    claimed: int
    wrong: int

    @classmethod
    def of(cls, tolerance: Tolerance, results: Iterable[tuple[Tolerance | None, PoseError]]) -> Claims:
        """Count claims.

        Args:
            tolerance: the coarser tolerance.
            results: the tolerance that each result claims, or None, and its error.
        """
        found = [(claim, tolerance.holds(error)) for claim, error in results]
        claimed = [right for claim, right in found if claim is not None]
        return cls(tolerance, len(found), sum(right for _, right in found), len(claimed), claimed.count(False))

    def as_dict(self) -> dict[str, Any]:
        """The content of JSON files."""
        return asdict(self) | {"tolerance": self.tolerance._asdict()}

    def __str__(self) -> str:
        """The counts as a clause of a sentence."""
        right, others = self.claimed - self.wrong, self.results - self.within
        of_right = f"{right} of the {self.within} that are"
        return f"certain to be within {self.tolerance}: {of_right}, {self.wrong} of {others} others"
