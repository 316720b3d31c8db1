"""The consensus of a drive: the weighted least-squares extrinsic of all its frames, which share one mount.

Every frame contributes normal equations: a correction and its information matrix. Their sum, with robust weights
(Cauchy) for frames that disagree with the others, gives the estimate; the scatter of the frames about it scales its
covariance. Only 42 numbers are kept per frame, so memory does not grow with images or scans. Errors that the networks
make in all frames do not average out; aligning edges of some frames corrects them (`calibnet.alignment`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calibnet.alignment import Evidence, align
from calibnet.geometry import MiscalibrationRange
from calibnet.geometry.prior import PosePrior, inverse
from calibnet.geometry.se3 import invert, pose_from_vector, pose_vector
from calibnet.geometry.types import Extrinsic, Floats, Matrix6, Transform, Vector6
from calibnet.trace import Estimate

OUTLIER = 3.0
"""Distance relative to that of the median frame at which a frame's weight is one half (Cauchy weights)."""
FIRM = 1000.0
"""Information of a frame whose network states none, relative to that of the range; large, so that the estimate is the
mean of the frames and is not drawn to the initial extrinsic."""
FARTHEST_TRANSLATION_M, FARTHEST_ROTATION_DEG = 0.3, 0.6
"""Largest standard deviations of the estimate, over all axes, at which edges are aligned, since beyond these they would
match wrong edges nearby."""
REWEIGHTINGS = 10
"""Number of reweighting iterations; weights converge after three or four."""


class Consensus:
    """Corrections of one extrinsic by several frames, and their estimate."""

    def __init__(
        self,
        before: Extrinsic,
        range_: MiscalibrationRange,
        pose_prior: PosePrior | None = None,
        common_error: Matrix6 | None = None,
    ) -> None:
        """Start without frames.

        Args:
            before: ``camera_from_lidar`` to which all corrections apply.
            range_: range of the stage. Every frame's information contains that of the range; the estimate counts it
                once.
            pose_prior: prior on the extrinsic, counted once as well.
            common_error: covariance of the error that the networks make in all frames; added to that of the frames when
                they are weighed against the prior and when edges are aligned.
        """
        self.before, self.range, self.pose_prior = before, range_, pose_prior
        self.common_error = np.zeros((6, 6)) if common_error is None else common_error
        self._vectors: list[Vector6] = []
        self._informations: list[Matrix6] = []

    def __len__(self) -> int:
        return len(self._vectors)

    def add(self, correction: Transform, information: Matrix6 | None) -> None:
        """Add the correction of one frame and its information, None if the network states none."""
        self._vectors.append(pose_vector(correction))
        self._informations.append(FIRM * self.range.information if information is None else information)

    def estimate(self) -> Estimate:
        """The estimate from the frames so far and the prior.

        Raises:
            ValueError: there are none.
        """
        mean, covariance = self.agreed()
        if self.pose_prior is not None:
            mean, covariance = self.pose_prior.fused(mean, inverse(covariance + self.common_error), self.before)
        return Estimate(pose_from_vector(mean) @ self.before, covariance, len(self))

    def agreed(self) -> tuple[Vector6, Matrix6]:
        """The correction from all frames without the prior, and its covariance."""
        if not self._vectors:
            raise ValueError("There are no frames to estimate from.")
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
        return mean, covariance

    def aligned(self, evidence: Sequence[Evidence], starts: Sequence[Estimate] = ()) -> Estimate:
        """The estimate from the frames and from the evidence of some of them, their edges and reflectance.

        Its covariance includes the common error of the networks as far as the evidence does not determine it. Frames
        that scatter too far for edges to be matched are not aligned.

        Args:
            evidence: evidence of some frames, gathered under ``before``.
            starts: starting points of the alignment, of which the best result is used; by default the consensus.
        """
        known = self.estimate()
        others = [pose_vector(one.camera_from_lidar @ invert(self.before)) for one in starts]
        likely, covariance = self.agreed()
        covariance = covariance + self.common_error
        if self.pose_prior is not None:
            likely, covariance = self.pose_prior.fused(likely, inverse(covariance), self.before)
        if known.rotation_deg > FARTHEST_ROTATION_DEG or known.translation_cm > 100 * FARTHEST_TRANSLATION_M:
            evidence = ()
        correction, covariance = align(evidence, likely, covariance, others)
        return Estimate(pose_from_vector(correction) @ self.before, covariance, known.frames)

    def _solve(self, vectors: Floats, informations: Floats, weights: Floats) -> tuple[Matrix6, Vector6]:
        """Summed normal equations of vectors ``[N, 6]`` and informations ``[N, 6, 6]``: matrix and solution."""
        weighted = weights[:, None, None] * informations
        of_range = self.range.information
        normal = weighted.sum(0) - weights.sum() * of_range + of_range
        return normal, np.linalg.solve(normal, np.einsum("nij,nj->i", weighted, vectors))
