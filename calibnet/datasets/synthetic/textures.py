"""The texture atlas: procedural tiles drawn once per process, sampled with mip levels at ray hits."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from calibnet.datasets.synthetic import tiles
from calibnet.datasets.synthetic.drawing import TILE, noise

LEVELS = 9
"""Number of mip levels: sides of 256, 128, … 1 pixels."""


@dataclass(frozen=True, eq=False)
class Atlas:
    """Square tiles with their mip levels in one flat array.

    Attributes:
        texels: ``[N, 4]`` uint8: sRGB-like colour and LiDAR reflectance, all levels and tiles.
        level_offset: ``[LEVELS]`` int32, where each level starts.
        tile_metres: ``[M]`` float32, side of the surface that a tile covers, metres.
        groups: numbers of the tiles of each kind of surface, for instance ``groups["brick"]``.
    """

    texels: NDArray[np.uint8]
    level_offset: NDArray[np.int32]
    tile_metres: NDArray[np.float32]
    groups: dict[str, tuple[int, ...]]

    def pick(self, group: str, generator: Generator) -> int:
        """The number of a random tile of a group."""
        layers = self.groups[group]
        return layers[int(generator.integers(len(layers)))]

    def sample(
        self, layer: NDArray[np.int32], uv: NDArray[np.float32], footprint: NDArray[np.float32]
    ) -> NDArray[np.uint8]:
        """Texels ``[N, 4]`` at ``uv`` metres, at the level whose texels match ``footprint`` metres."""
        metres = self.tile_metres[layer]
        level = np.log2(np.maximum(footprint * (TILE / metres), 1.0))
        level = np.minimum((level + 0.3).astype(np.int32), LEVELS - 1)
        size = np.right_shift(np.int32(TILE), level)
        place = uv / metres[:, None]
        place -= np.floor(place)
        cell = np.minimum((place * size[:, None]).astype(np.int32), size[:, None] - 1)
        row = self.level_offset[level] + (layer * size + cell[:, 1]) * size + cell[:, 0]
        picked: NDArray[np.uint8] = self.texels[row]
        return picked


@lru_cache(maxsize=1)
def atlas() -> Atlas:
    """The one atlas of this process (the same in every process)."""
    drawn = tiles.draw_all(np.random.default_rng(20_250_101))
    stack = np.stack([tile.image for tile in drawn])
    levels, offsets, start = [], [], 0
    for _ in range(LEVELS):
        offsets.append(start)
        levels.append(stack.reshape(-1, 4))
        start += len(levels[-1])
        if stack.shape[1] > 1:
            blocks = stack.astype(np.uint16)
            total = blocks[:, ::2, ::2] + blocks[:, 1::2, ::2] + blocks[:, ::2, 1::2] + blocks[:, 1::2, 1::2]
            stack = ((total + 2) // 4).astype(np.uint8)
    groups: dict[str, tuple[int, ...]] = {}
    for layer, tile in enumerate(drawn):
        groups[tile.group] = (*groups.get(tile.group, ()), layer)
    return Atlas(
        texels=np.concatenate(levels),
        level_offset=np.array(offsets, dtype=np.int32),
        tile_metres=np.array([tile.metres for tile in drawn], dtype=np.float32),
        groups=groups,
    )


@lru_cache(maxsize=1)
def turbulence() -> NDArray[np.float32]:
    """Tileable noise ``[TILE, TILE]`` of mean 0.5, for clouds and stains."""
    return 0.5 + 0.35 * noise(np.random.default_rng(3), 4, 6, 0.6)
