"""Training frames: drawn from the sources, augmented, at the input size of their batch."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calibnet.datasets.frame import Frame
from calibnet.training.augmentation import augment
from calibnet.training.data import Source
from calibnet.training.recipe import Recipe


class TrainingFrames:
    """The sources' frames, augmented as the recipe says.

    The input size is drawn once per batch, so that lenses and aspect ratios vary while a batch stays one tensor.
    """

    def __init__(
        self,
        sources: Sequence[Source],
        recipe: Recipe,
        area: float,
        batch: int,
        seed: int,
        magnification: float = 1.0,
    ) -> None:
        """Frames for samples that are numbered from 0 on.

        Args:
            sources: where they come from.
            recipe: sizes and augmentations.
            area: area of the images, pixels.
            batch: number of consecutive samples with one size.
            seed: seed of the sizes.
            magnification: a stage whose image has this many times the width and height is trained on crops of it.
        """
        self.sources, self.recipe = list(sources), recipe
        self.batch, self.seed, self.magnification = batch, seed, magnification
        weights = np.array([source.weight for source in sources], dtype=np.float64)
        self.probability = weights / weights.sum()
        height, width = recipe.sample.sizes[0]
        factor = (area / (height * width)) ** 0.5
        self.sizes = [(round(h * factor / 32) * 32, round(w * factor / 32) * 32) for h, w in recipe.sample.sizes]
        self.memory: dict[tuple[int, int], Frame] = {}

    def draw(self, number: int, generator: np.random.Generator, variety: float = 1.0, whole: bool = False) -> Frame:
        """An augmented frame for sample ``number``.

        Args:
            number: number of the sample.
            generator: source of all random numbers but the size.
            variety: probability that scan and image are augmented, and that a draw of the synthetic world is kept.
            whole: without the magnification, so that the whole image is seen.
        """
        source = self.draw_source(generator, variety)
        frame = self.read(source, int(generator.integers(len(self.sources[source].sequence))))
        magnification = 1.0 if whole else self.magnification
        return augment(frame, *self.size(number), generator, self.recipe, variety, magnification)

    def size(self, number: int) -> tuple[int, int]:
        """Height and width of sample ``number``, the same for its whole batch."""
        generator = np.random.default_rng([self.seed, 1, number // self.batch])
        return self.sizes[generator.choice(len(self.sizes), p=self.recipe.sample.size_shares)]

    def read(self, source: int, position: int) -> Frame:
        """Read one frame; real frames, which are few, are kept in memory."""
        sequence = self.sources[source].sequence
        if self.sources[source].synthetic:
            return sequence[position]
        if (source, position) not in self.memory:
            self.memory[source, position] = sequence[position]
        return self.memory[source, position]

    def draw_source(self, generator: np.random.Generator, variety: float) -> int:
        """Draw a source by its weight; a draw of the synthetic world is kept with probability ``variety``."""
        while True:
            source = int(generator.choice(len(self.sources), p=self.probability))
            synthetic = self.sources[source].synthetic and len(self.sources) > 1
            if not synthetic or generator.random() < variety:
                return source
