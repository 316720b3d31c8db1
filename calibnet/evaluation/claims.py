"""How often results claim to be within the coarser tolerance, and how often that is wrong."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

from calibnet.geometry import PoseError
from calibnet.verdict import Tolerance


@dataclass(frozen=True)
class Claims:
    """Results that are certain enough to be within a tolerance, see `calibnet.verdict.Verdict.within`.

    Attributes:
        tolerance: the coarser one of frames, or of drives.
        results: how many there are.
        within: how many of them are within it.
        claimed: how many claim to be within it, or within the finer one.
        wrong: how many of those are not.
    """

    tolerance: Tolerance
    results: int
    within: int
    claimed: int
    wrong: int

    @classmethod
    def of(cls, tolerance: Tolerance, results: Iterable[tuple[Tolerance | None, PoseError]]) -> Claims:
        """Count them.

        Args:
            tolerance: the coarser one.
            results: what each claims to be within, and its error.
        """
        found = [(claim, tolerance.holds(error)) for claim, error in results]
        claimed = [right for claim, right in found if claim is not None]
        return cls(tolerance, len(found), sum(right for _, right in found), len(claimed), claimed.count(False))

    def as_dict(self) -> dict[str, Any]:
        """The form that JSON files hold."""
        return asdict(self) | {"tolerance": self.tolerance._asdict()}

    def __str__(self) -> str:
        """A clause."""
        right, others = self.claimed - self.wrong, self.results - self.within
        of_right = f"{right} of the {self.within} that are"
        return f"certain to be within {self.tolerance}: {of_right}, {self.wrong} of {others} others"
