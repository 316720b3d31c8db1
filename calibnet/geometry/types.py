"""Type aliases for arrays of a certain shape; all are float64."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
"""An array of any shape."""

Transform: TypeAlias = NDArray[np.float64]
"""``[4, 4]``, a rigid ``target_from_source`` in metres: a miscalibration, a correction."""

Extrinsic: TypeAlias = NDArray[np.float64]
"""``[4, 4]``, the transform ``camera_from_lidar``."""

Rotation: TypeAlias = NDArray[np.float64]
"""``[3, 3]``, orthonormal."""

Intrinsics: TypeAlias = NDArray[np.float64]
"""``[3, 3]``, the camera matrix in pixels."""

Vector3: TypeAlias = NDArray[np.float64]
"""``[3]``: metres, radians, or a direction."""

Vector6: TypeAlias = NDArray[np.float64]
"""``[6]``: translation in metres, then rotation vector in radians."""

Matrix6: TypeAlias = NDArray[np.float64]
"""``[6, 6]`` over the components of a `Vector6`: a covariance, or an information matrix, its inverse."""
