"""Stages of wider ranges, which run if a result leaves the range that the first stage was trained for."""

from __future__ import annotations

from collections.abc import Sequence

from calibnet.cascade.stage import Stage
from calibnet.geometry import invert
from calibnet.geometry.types import Extrinsic
from calibnet.trace import MARGIN


def covering(first: Stage, wider: Sequence[Stage], initial: Extrinsic, found: Extrinsic) -> list[Stage]:
    """The wider stages with which to start again if the initial extrinsic turns out to be too far off.

    Empty if the first stage's range covers its miscalibration; else from the finest stage whose range does, or all.

    Args:
        first: the first stage that ran.
        wider: stages of wider ranges, coarse to fine.
        initial: initial ``camera_from_lidar``, 4x4.
        found: resulting ``camera_from_lidar``, 4x4.
    """
    miscalibration = initial @ invert(found)
    if not wider or first.range.contains(miscalibration, MARGIN):
        return []
    fitting = [number for number, stage in enumerate(wider) if stage.range.contains(miscalibration, MARGIN)]
    return list(wider[max(fitting, default=0) :])
