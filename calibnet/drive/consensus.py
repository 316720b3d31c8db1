"""One extrinsic from a drive: the mount is the same in every frame, so the frames are solved together.

Every frame says with its normal equations where it believes the extrinsic to be and how firmly. Their
sum, each frame weighted by how well it agrees with the others, is the estimate of all; how far they
scatter around it is its uncertainty. A frame leaves 42 numbers behind, so memory does not grow with
images or scans. What all of them get wrong alike, the edges of some frames tell (`calibnet.alignment`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calibnet.alignment import Evidence, align
from calibnet.geometry.se3 import invert, pose_from_vector, pose_vector
from calibnet.geometry.types import Extrinsic, Floats, Matrix6, Transform, Vector6
from calibnet.trace import Estimate

OUTLIER = 3.0
"""A frame so many times farther off than the median one counts half as much (Cauchy weights)."""
UNSTATED = 1000.0
"""How much firmer than the prior a head is taken to be that does not say: its answer is not drawn to the start."""
COMMON_TRANSLATION_M, COMMON_ROTATION_DEG = 0.08, 0.12
"""Standard deviations, per axis, of what the shipped networks get wrong in all frames of a drive alike: 14 cm, 0.2° in
all, somewhat more than on validation (10 cm; 0.1° and 0.3°)."""
FARTHEST_TRANSLATION_M, FARTHEST_ROTATION_DEG = 0.3, 0.6
"""Standard deviations of what frames agree on, in all, beyond which edges would pull onto whatever is near."""
REWEIGHTINGS = 10
"""Times that frames are weighted anew; weights settle after three or four."""


class Consensus:
    """Frames' corrections of one common extrinsic, and what they agree on."""

    def __init__(self, before: Extrinsic, prior: Matrix6) -> None:
        """Start with none.

        Args:
            before: ``camera_from_lidar`` that all corrections are relative to.
            prior: ``[6, 6]`` information of the range the stage was trained for. Every frame's information
                contains it; the estimate counts it once.
        """
        self.before, self.prior = before, prior
        self._vectors: list[Vector6] = []
        self._informations: list[Matrix6] = []

    def __len__(self) -> int:
        return len(self._vectors)

    def add(self, correction: Transform, information: Matrix6 | None) -> None:
        """Take in one frame: its 4x4 correction and information ``[6, 6]``; without one, all frames count alike."""
        self._vectors.append(pose_vector(correction))
        self._informations.append(UNSTATED * self.prior if information is None else information)

    def estimate(self) -> Estimate:
        """What the frames so far agree on.

        Raises:
            ValueError: there are none.
        """
        if not self._vectors:
            raise ValueError("There is no frame to estimate from.")
        vectors, informations = np.array(self._vectors), np.array(self._informations)
        weights = np.ones(len(vectors))
        for _ in range(REWEIGHTINGS):
            normal, mean = self._solve(vectors, informations, weights)
            offsets = vectors - mean
            distances = np.einsum("ni,nij,nj->n", offsets, informations, offsets)
            weights = 1 / (1 + distances / (OUTLIER**2 * max(float(np.median(distances)), 1e-12)))
        covariance = np.linalg.inv(normal).astype(np.float64)
        if len(vectors) > 1:
            freedom = 6 * (weights.sum() - weights.max())
            covariance = covariance * max(1.0, float((weights * distances).sum() / max(freedom, 1.0)))
        return Estimate(pose_from_vector(mean) @ self.before, covariance, len(vectors))

    def aligned(self, evidence: Sequence[Evidence], starts: Sequence[Estimate] = ()) -> Estimate:
        """What they and the evidence of frames, gathered under ``before``, agree on.

        The covariance counts what the networks get wrong in all frames alike, too: without evidence that stays.
        Frames that scatter farther than edges pull are not aligned.

        Args:
            evidence: of any of the frames.
            starts: where to start; what the frames agree on by default.
        """
        agreed = self.estimate()
        sigma = [COMMON_TRANSLATION_M] * 3 + [np.radians(COMMON_ROTATION_DEG)] * 3
        known, *others = (pose_vector(one.camera_from_lidar @ invert(self.before)) for one in (agreed, *starts))
        covariance = agreed.covariance + np.diag(np.square(sigma))
        if agreed.rotation_deg > FARTHEST_ROTATION_DEG or agreed.translation_cm > 100 * FARTHEST_TRANSLATION_M:
            evidence = ()
        correction, covariance = align(evidence, known, covariance, others)
        return Estimate(pose_from_vector(correction) @ self.before, covariance, agreed.frames)

    def _solve(self, vectors: Floats, informations: Floats, weights: Floats) -> tuple[Matrix6, Vector6]:
        """Summed normal equations: matrix ``[6, 6]`` and solution ``[6]``."""
        weighted = weights[:, None, None] * informations
        normal = weighted.sum(0) - weights.sum() * self.prior + self.prior
        return normal, np.linalg.solve(normal, np.einsum("nij,nj->i", weighted, vectors))
