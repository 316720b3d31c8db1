"""The search: random extrinsics around the guess, then in ever smaller ranges around the best one so far."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from calibnet.datasets.frame import Frame
from calibnet.errors import CalibrationError
from calibnet.exhibit import Curve, Exhibit
from calibnet.geometry import MiscalibrationRange, miscalibration
from calibnet.geometry.types import Extrinsic, Floats, Transform
from calibnet.methods.calib_anything.attributes import attributes
from calibnet.methods.calib_anything.consistency import FEWEST, Consistency
from calibnet.methods.calib_anything.masks import Labels, painted, read_masks, segmented
from calibnet.runtime.clock import Clock
from calibnet.trace import CascadeTrace, StageTrace

HEIGHT, WIDTH = 256, 832
"""The image is resized to the area of this size, its aspect kept."""
ROUNDS = ((1.0, 0.0, 300), (0.5, 0.5, 200), (0.25, 0.25, 200), (0.1, 0.15, 200), (0.04, 0.06, 150))
"""Rounds of the search: shares of the range's rotation and translation within which poses are drawn, and the number of
poses. As in the paper, the first round draws rotations alone, and the others all six axes; the numbers are ours."""
SEED = 0


class CalibAnything:
    """A `Calibrator` without weights."""

    def __init__(self, range_: MiscalibrationRange, masks: Path | None = None) -> None:
        """Search within ``range_``, with a folder of ``masks`` of Segment Anything or, by default, our own."""
        self.range, self.masks = range_, masks

    def calibrate(self, frame: Frame, initial: Extrinsic, detail: bool = False) -> CascadeTrace:
        """Search one frame.

        Raises:
            CalibrationError: too few points are in the image under the guess.
            ConfigError: the folder of masks has none for the frame.
        """
        clock, camera = Clock(torch.device("cpu")), frame.camera.fitted(HEIGHT, WIDTH, 1)
        labels = segmented(frame, camera) if self.masks is None else read_masks(self.masks, frame, camera)
        clock("masks")
        if len(frame.points) < 3:
            raise CalibrationError(f"Frame {frame.index} has too few points for any mask.")
        score = Consistency(labels, camera, attributes(frame.points), initial)
        clock("attributes")
        change, scores = self._search(score, initial)
        clock("search")
        stage = StageTrace(1, self.range, camera, initial, change @ initial, change, clock.parts)
        if detail:
            curve = Curve("Gain in the best score so far, over the search", scores - scores[0])
            stage = replace(stage, exhibits=tuple(exhibits(labels, score, stage)), curves=(curve,))
        return CascadeTrace(initial, (stage,))

    def _search(self, score: Consistency, initial: Extrinsic) -> tuple[Transform, Floats]:
        """The best change of the guess, and the best score so far after every draw."""
        generator = np.random.default_rng(SEED)
        best, scores = np.zeros(6), [score(initial)]
        for turned, shifted, count in ROUNDS:
            reach = np.array([turned * self.range.rotation_deg] * 3 + [shifted * self.range.translation_m] * 3)
            limit = np.array([self.range.rotation_deg] * 3 + [self.range.translation_m] * 3)
            centre = best
            for draw in generator.uniform(-1, 1, (count, 6)):
                tried = np.clip(centre + reach * draw, -limit, limit)
                value = score(miscalibration(tried[:3], tried[3:]) @ initial)
                if value > scores[-1]:
                    best = tried
                scores.append(max(value, scores[-1]))
        return miscalibration(best[:3], best[3:]), np.array(scores)


def exhibits(labels: Labels, score: Consistency, stage: StageTrace) -> Iterator[Exhibit]:
    """The masks, and the similarity of the points in each at the start and at the end."""
    yield Exhibit("Masks", painted(labels))
    maps = {}
    for name, extrinsic in (("at the start", stage.before), ("at the end", stage.after)):
        scores, counts = score.of_masks(extrinsic)
        known = np.append(np.where(counts >= FEWEST, scores, np.nan), np.nan)  # the last is for pixels in no mask
        maps[f"Similarity of the points in each mask, {name}"] = known[labels].astype(np.float32)
    seen = np.concatenate([values[np.isfinite(values)] for values in maps.values()])
    limits = (float(seen.min()), float(seen.max())) if seen.size else None  # of both maps, since they are compared
    yield from (Exhibit(name, values, limits) for name, values in maps.items())
