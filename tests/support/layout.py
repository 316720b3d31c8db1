"""What a blueprint lays out."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import rerun.blueprint as rrb


def views(part: Any) -> Iterator[rrb.View]:
    """The views of a part of a blueprint, depth first."""
    if isinstance(part, rrb.View):
        yield part
    else:
        for child in part.contents:
            yield from views(child)
