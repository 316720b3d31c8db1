"""The images of a recording and the points drawn over them, read on demand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inspector import entities
from inspector.read.file import RecordingFile
from inspector.read.understood import RecordingError, understood
from inspector.record.subtree import below


class OverlayPoints(NamedTuple):
    """Points over an image: ``uv`` ``[N, 2]`` float32, pixel centres at integers; ``rgb`` ``[N, 3]`` uint8."""

    uv: NDArray[np.float32]
    rgb: NDArray[np.uint8]


@dataclass(frozen=True)
class RecordedPictures:
    """The pictures of one camera.

    Attributes:
        file: the recording's file.
        prefix: prefix of the entity paths, where a recording has several cameras.
    """

    file: RecordingFile
    prefix: str = ""

    def image(self, index: int) -> bytes:
        """The image of a frame as JPEG."""
        with understood(self.file.path):
            (blob,) = self._row(entities.IMAGE, index, "EncodedImage:blob")
            return np.asarray(blob.values[0].values).tobytes()

    def overlay(self, entity: str, index: int) -> OverlayPoints:
        """The points drawn over a frame's image, far to near."""
        with understood(self.file.path):
            positions, colors = self._row(entity, index, "Points2D:positions", "Points2D:colors")
            rgba = np.asarray(colors.values).astype(np.uint32)
            rgb = np.stack([rgba >> shift & 0xFF for shift in (24, 16, 8)], axis=-1).astype(np.uint8)
            uv = np.asarray(positions.values.flatten()).reshape(-1, 2)
            if len(uv) != len(rgb):
                raise ValueError(f"{len(uv)} points of {len(rgb)} colours")
            return OverlayPoints(uv - np.float32(0.5), rgb)  # Rerun's pixel centres are at x.5

    def _row(self, entity: str, index: int, *components: str) -> list[Any]:
        for chunk in self.file.chunks(below(self.prefix, entity)):
            batch = chunk.to_record_batch()
            if set(components) <= set(batch.schema.names):
                found = np.flatnonzero(np.asarray(batch[entities.FRAME]) == index)
                if found.size:
                    return [batch[component][int(found[-1])] for component in components]
        raise RecordingError(
            f"{self.file.path} has no {entity} of frame {index}; choose another frame, or record again."
        )
