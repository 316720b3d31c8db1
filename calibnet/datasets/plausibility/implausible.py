"""The finding of a check, and what becomes of it: input is refused, or the finding is kept as a suspicion."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from calibnet.errors import ImplausibleError


@dataclass(frozen=True)
class Implausible:
    """Something that cannot be right, or hardly.

    Attributes:
        name: ``focal-length``, ``principal-point``, ``picture-size``, ``distortion``, ``units``, ``axes``,
            ``accumulated``, ``bit-depth`` or ``bayer``.
        text: a sentence without its full stop: what is seen; what to do.
        certain: whether no sensor has it, so that the input is refused.
    """

    name: str
    text: str
    certain: bool = False


def refuse(found: Iterable[Implausible | None], where: str | Path) -> tuple[Implausible, ...]:
    """What is unlikely.

    Raises:
        ImplausibleError: something is certainly wrong; the message names ``where`` it was found.
    """
    remarks = tuple(remark for remark in found if remark is not None)
    for remark in remarks:
        if remark.certain:
            raise ImplausibleError(f"{where}: {remark.text}.", remark.name)
    return remarks


def suspicion(remarks: Iterable[Implausible], otherwise: str) -> str:
    """What to check when picture and scan do not fit: what is unlikely about them, or what usually is wrong."""
    return ", or ".join(remark.text for remark in remarks) or otherwise
