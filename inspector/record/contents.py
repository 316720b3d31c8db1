"""The contents of a recording: parts of each frame, their density, and the colouring of points."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from calibnet.trace import ScaleTrace, StageDetail


class Detail(StrEnum):
    """How much of each frame to log: a light set of views, everything, or selected parts."""

    OVERVIEW = "overview"
    FULL = "full"
    CUSTOM = "custom"


class Part(StrEnum):
    """Optional parts of a frame; image, overlays of start and result, extrinsics and table are always logged."""

    CURVES = "curves"
    OVERLAYS = "overlays"
    VOLUMES = "volumes"
    HOURGLASS = "hourglass"
    SCENE = "scene"
    TENSORS = "tensors"


class Coloring(StrEnum):
    """Quantity that colours the points of an overlay."""

    DEPTH = "depth"
    INTENSITY = "intensity"
    EDGE = "edge"
    ERROR = "error"


@dataclass(frozen=True)
class Contents:
    """What to log of each frame.

    Attributes:
        parts: parts to log.
        dense: whether to log many points, rounded to a quarter of a pixel, and the cost volumes of every scale;
            otherwise few points and the finest scale, for at most a megabyte per frame.
        color: colouring of the overlays' points; ``error`` needs a reference.
    """

    parts: frozenset[Part]
    dense: bool
    color: Coloring = Coloring.DEPTH

    @classmethod
    def of(cls, detail: Detail, parts: frozenset[Part] = frozenset(), color: Coloring = Coloring.DEPTH) -> Contents:
        """The contents of a level of detail; ``parts`` are those of `Detail.CUSTOM`."""
        everything = frozenset(Part)
        chosen = {Detail.OVERVIEW: everything - {Part.TENSORS}, Detail.FULL: everything, Detail.CUSTOM: parts}
        return cls(chosen[detail], detail is not Detail.OVERVIEW, color)

    @property
    def inside(self) -> bool:
        """Whether anything is logged that needs the network's intermediate results."""
        return bool(self.parts & {Part.VOLUMES, Part.HOURGLASS, Part.TENSORS})

    def scales(self, results: StageDetail | None) -> tuple[ScaleTrace, ...]:
        """The cost volumes to show, fine to coarse; none where the run kept none."""
        if results is None or not self.inside:
            return ()
        return results.scales if self.dense else results.scales[:1]
