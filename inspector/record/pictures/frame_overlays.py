"""The overlays of one frame: its points under every extrinsic of the run, each with a caption."""

from __future__ import annotations

from functools import lru_cache

import rerun as rr

from calibnet.geometry.types import Extrinsic
from calibnet.verdict import REJECTED, Verdict
from inspector import colors, entities
from inspector.record.contents import Contents
from inspector.record.observation import Observation
from inspector.record.pictures.captions import caption_strip
from inspector.record.pictures.lettering import text_png
from inspector.record.pictures.overlay import Overlay, Thinning, make_overlay
from inspector.record.pictures.painting import make_painter
from inspector.record.subtree import Subtree, Timeless

SPARSE, DENSE = Thinning(cells_across=140, pixel=1.0), Thinning(cells_across=180, pixel=0.25)
"""Two densities of points; sparse keeps about 2,500 of KITTI's 19,000 points, so that a frame takes under a
megabyte."""


class FrameOverlays:
    """Draws the overlay of each extrinsic once, however many entities show it."""

    def __init__(self, observation: Observation, contents: Contents) -> None:
        """Draw points of an observation with the density and colouring of the contents."""
        self._observation, self._camera = observation, observation.frame.as_taken.camera
        self._thinning = DENSE if contents.dense else SPARSE
        self._paint = make_painter(observation, contents.color)
        self._drawn: dict[bytes, Overlay] = {}

    def log(
        self,
        rec: Subtree,
        entity: str,
        name: str,
        camera_from_lidar: Extrinsic,
        color: colors.Rgb = colors.LETTERS,
    ) -> None:
        """Log the points under an extrinsic and, above them, its name and error."""
        rec.log(entity, self._under(camera_from_lidar).archetype())
        error = self._observation.error(camera_from_lidar)
        figures = "" if error is None else f"{error.rotation_deg:.2f}°, {error.translation_cm:.1f} cm off"
        self._log_caption(rec, entity, name, figures, color)

    def log_reference(self, rec: Subtree, entity: str, reference: Extrinsic) -> None:
        """Log the points under the reference, with its name only."""
        rec.log(entity, self._under(reference).archetype())
        self._log_caption(rec, entity, "reference")

    def log_worst(self, rec: Subtree) -> None:
        """Log the result as static data, as that of the worst frame."""
        self.log_result(Timeless(rec), entities.OVERLAY_WORST, f"frame {self._observation.frame.index}, ")

    def log_result(self, rec: Subtree, entity: str, whose: str = "") -> None:
        """Log the points under the final result, and above them the verdict."""
        trace, given = self._observation.trace, self._observation.given
        if given is not None:
            self.log(rec, entity, f"{whose}{given_caption(given)}", trace.corrected, colors.VERDICTS[given.word])
            return
        word = "" if trace.verdict is None else trace.verdict.word
        became = "worse than before" if self._observation.worse else "corrected"
        name = f"{REJECTED}, left as it was" if trace.rejected else ", ".join(filter(None, [became, word]))
        self.log(rec, entity, f"{whose}{name}", trace.corrected, colors.VERDICTS.get(word, colors.LETTERS))

    def _under(self, camera_from_lidar: Extrinsic) -> Overlay:
        key = camera_from_lidar.tobytes()
        if key not in self._drawn:
            projection = self._observation.projected(camera_from_lidar)
            self._drawn[key] = make_overlay(projection, self._camera, self._thinning, self._paint)
        return self._drawn[key]

    def _log_caption(
        self, rec: Subtree, entity: str, name: str, figures: str = "", color: colors.Rgb = colors.LETTERS
    ) -> None:
        """Log a strip of the image's width above it."""
        camera, path = self._camera, entities.caption(entity)
        strip = caption_strip((camera.width, camera.height), self._observation.reference is not None)
        lines = [": ".join(filter(None, [name, figures]))] if strip.lines == 1 else [name, figures]
        picture = text_png(lines, (camera.width, strip.height), strip.letters, color)
        rec.log(
            path,
            rr.Transform3D(translation=[0.0, -float(strip.height), 0.0]),
            rr.EncodedImage(contents=picture, media_type="image/png", opacity=1.0),
            rr.AnyValues(text=": ".join(filter(None, [name, figures]))),
        )


def given_caption(given: Verdict) -> str:
    """The verdict on the calibration that is verified, above points under the one that was found."""
    return f"calibration {given.word}, points as found"


@lru_cache(maxsize=1)
def frame_overlays(observation: Observation, contents: Contents) -> FrameOverlays:
    """The overlays of an observation; the same object for every tab that asks while its frame is logged."""
    return FrameOverlays(observation, contents)
