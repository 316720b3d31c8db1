"""What a recording is to contain: which parts of each frame, how densely, and what colours its points."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from calibnet.trace import ScaleTrace, StageDetail


class Detail(StrEnum):
    """How much of each frame is logged: a light set of views, everything, or the parts that are named."""

    OVERVIEW = "overview"
    FULL = "full"
    CUSTOM = "custom"


class Part(StrEnum):
    """What can be left out; image, overlays of start and result, extrinsics and table are always there."""

    CURVES = "curves"
    OVERLAYS = "overlays"
    VOLUMES = "volumes"
    HOURGLASS = "hourglass"
    SCENE = "scene"
    TENSORS = "tensors"


class Coloring(StrEnum):
    """What the colour of an overlay's points stands for."""

    DEPTH = "depth"
    INTENSITY = "intensity"
    EDGE = "edge"
    ERROR = "error"


@dataclass(frozen=True)
class Contents:
    """What is logged of each frame.

    Attributes:
        parts: which parts.
        dense: many points, at a quarter of a pixel, and the cost volumes of every scale; otherwise few points and
            the finest scale, for a megabyte a frame at most.
        color: of the overlays' points; ``error`` needs a reference.
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
        """Whether anything is logged that only the network's intermediate results show."""
        return bool(self.parts & {Part.VOLUMES, Part.HOURGLASS, Part.TENSORS})

    def scales(self, results: StageDetail | None) -> tuple[ScaleTrace, ...]:
        """The cost volumes that are shown, fine to coarse; none where the run kept none."""
        if results is None or not self.inside:
            return ()
        return results.scales if self.dense else results.scales[:1]
