"""A drive through one synthetic scene; each frame is rendered when it is read."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from calibnet.datasets.frame import Frame
from calibnet.datasets.synthetic.camera import sample_exposure
from calibnet.datasets.synthetic.render import render_frame
from calibnet.datasets.synthetic.rig import Rig, sample_rig
from calibnet.datasets.synthetic.scene import sample_scene
from calibnet.datasets.synthetic.surroundings import EGO_SPEED
from calibnet.datasets.synthetic.world import World
from calibnet.errors import ConfigError
from calibnet.geometry.types import Transform

FRAME_INTERVAL = 0.1
"""Seconds between frames, as for KITTI's scanner."""
_NATIVE_PIXELS, _NATIVE_WIDTH = 1242 * 375, 1242


class SyntheticSequence:
    """A `Sequence` from a car that drives about a metre per frame among moving traffic.

    A frame depends only on the seed and its position, not on what was read before.
    """

    def __init__(self, seed: int, length: int, rig: Rig | None = None) -> None:
        """Build the scene.

        Args:
            seed: seed of the scene, its traffic, the noise and, without ``rig``, the sensors.
            length: number of frames.
            rig: sensors and mount; drawn from the seed if not given.

        Raises:
            ConfigError: the seed is negative, or the length is not positive.
        """
        if seed < 0 or length < 1:
            raise ConfigError(
                f"A synthetic drive with seed {seed} and length {length} is not possible; give a seed from 0 and a "
                "length from 1."
            )
        generator = np.random.default_rng([seed, 1])
        travel = length * EGO_SPEED * FRAME_INTERVAL
        self.seed, self.length = seed, length
        self.world = World(sample_scene(generator, travel))
        self.exposure = sample_exposure(generator)
        self.mount = rig or sample_rig(generator, _NATIVE_PIXELS, _NATIVE_WIDTH)
        self.name = f"synthetic/{seed}"
        self.rig = self.mount.name

    def __len__(self) -> int:
        """Number of frames."""
        return self.length

    def __iter__(self) -> Iterator[Frame]:
        """Render the frames in order."""
        return (self[position] for position in range(self.length))

    def world_from_vehicle(self, position: int) -> Transform:
        """Pose of the car at a frame, 4x4; its frame is on the road below the LiDAR, x forward, y left, z up."""
        return self.world.scene.pose(position * EGO_SPEED * FRAME_INTERVAL)

    def __getitem__(self, position: int) -> Frame:
        """Render one frame.

        Raises:
            IndexError: there is no such position.
        """
        index = position + self.length if position < 0 else position
        if not 0 <= index < self.length:
            raise IndexError(f"{self.name} has {self.length} frames, not one at {position}.")
        return render_frame(
            self.world,
            self.mount,
            self.world_from_vehicle(index),
            np.random.default_rng([self.seed, 2, index]),
            index=index,
            timestamp=index * FRAME_INTERVAL,
            exposure=self.exposure,
            source=f"{self.name}/{index:06d}",
        )
