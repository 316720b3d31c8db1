"""Joins the looks of a stage through the faces of a wide lens to one, by adding their normal equations.

The faces are pinhole cameras in one place, like a rigid rig whose pose is the camera's (`calibnet.drive.rig`): a motion
along the optical axis of one, which it hardly sees, moves points across the image of another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calibnet.geometry.se3 import pose_from_vector, pose_vector
from calibnet.judging.covariance import CovarianceModel
from calibnet.trace import StageTrace


def join_looks(looks: Sequence[StageTrace], limit_px: float, model: CovarianceModel) -> StageTrace:
    """Join looks of one stage through faces, all rotated to the camera (`StageTrace.rotated`), to one.

    Each is weighted by its measured covariance, which is larger than the one that its network states. A face that does
    not fit the scan, such as one filled by the bonnet, is left out if another one fits.

    Args:
        looks: at least one look; camera, details and matches are those of the first one used.
        limit_px: largest match error at which a look is believed.
        model: model of the measured covariance of looks.
    """
    fitting = [look for look in looks if not look.match_error_px > limit_px] or list(looks)
    first = fitting[0]
    if len(fitting) == 1:
        return first
    weights = np.array([model.weight(look) for look in fitting])
    vectors = np.array([pose_vector(look.correction) for look in fitting])
    correction = pose_from_vector(np.linalg.solve(weights.sum(axis=0), np.einsum("nij,nj->i", weights, vectors)))
    stated = [look.information for look in fitting if look.information is not None]
    prior = first.range.information
    matches = [1 if look.matches is None else len(look.matches.points) for look in fitting]
    return replace(
        first,
        after=correction @ first.before,
        correction=correction,
        information=np.sum(stated, axis=0) - (len(stated) - 1) * prior if len(stated) == len(fitting) else None,
        match_error_px=float(np.average([look.match_error_px for look in fitting], weights=matches)),
        milliseconds={part: sum(look.milliseconds.get(part, 0.0) for look in looks) for part in first.milliseconds},
    )
