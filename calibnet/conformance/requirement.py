"""Promises as assertions that say in a sentence what was not kept, also where Python runs without ``assert``."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

TOLERANCE = 1e-6


def require(kept: bool, sentence: str) -> None:
    """Raise ``AssertionError`` with the sentence unless the promise is kept."""
    if not kept:
        raise AssertionError(sentence)


def require_rigid(matrix: ArrayLike, what: str, tolerance: float = TOLERANCE) -> None:
    """A rigid transform: 4x4, finite, its rotation orthonormal and no reflection, its last row 0 0 0 1."""
    values = np.asarray(matrix, dtype=np.float64)
    require(values.shape == (4, 4), f"{what} has shape {list(values.shape)} and not [4, 4].")
    require(bool(np.isfinite(values).all()), f"{what} is not finite.")
    require(bool((values[3] == [0, 0, 0, 1]).all()), f"The last row of {what} is {values[3].tolist()}.")
    rotation = values[:3, :3]
    orthonormal = np.allclose(rotation @ rotation.T, np.eye(3), atol=tolerance) and np.linalg.det(rotation) > 0
    require(bool(orthonormal), f"The rotation of {what} is not orthonormal or is a reflection.")


def require_definite(matrix: ArrayLike, what: str) -> None:
    """A covariance or information: 6x6, finite, symmetric, positive definite."""
    values = np.asarray(matrix, dtype=np.float64)
    require(values.shape == (6, 6), f"{what} has shape {list(values.shape)} and not [6, 6].")
    require(bool(np.isfinite(values).all()), f"{what} is not finite.")
    scale = np.abs(values).max()
    require(bool(np.allclose(values, values.T, atol=1e-4 * scale)), f"{what} is not symmetric.")
    require(bool(np.linalg.eigvalsh((values + values.T) / 2).min() > 0), f"{what} is not positive definite.")
