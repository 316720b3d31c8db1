"""What a stage sees through the faces of a wide lens, as one look: their normal equations add up.

The faces are pinhole cameras in one place, so that they are a rig whose pose is the camera's (`calibnet.drive.rig`):
what one of them cannot see, the way it looks, is across the picture of another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calibnet.geometry import transform
from calibnet.geometry.prior import inverse
from calibnet.geometry.se3 import pose_from_vector, pose_vector
from calibnet.geometry.types import Rotation
from calibnet.judging.covariance import Spread
from calibnet.trace import StageTrace


def seen_by_camera(look: StageTrace, face_from_camera: Rotation) -> StageTrace:
    """A look through a face as one of the camera: its extrinsics, correction and information, not its matches."""
    back, axes = transform(face_from_camera.T, np.zeros(3)), np.kron(np.eye(2), face_from_camera)
    return replace(
        look,
        before=back @ look.before,
        after=back @ look.after,
        correction=back @ look.correction @ back.T,
        information=None if look.information is None else axes.T @ look.information @ axes,
        last_before=None if look.last_before is None else back @ look.last_before,
        upright=face_from_camera if look.upright is None else look.upright @ face_from_camera,
    )


def joined(looks: Sequence[StageTrace], limit_px: float) -> StageTrace:
    """Looks of one stage through faces, all as `seen_by_camera`, as one.

    Each counts as firmly as results of such looks are found to be right, which is less than their networks state. A
    face that shows another thing than the scan, as the bonnet, is left out where another one fits.

    Args:
        looks: at least one; camera, details and matches are those of the first that counts.
        limit_px: the match error that a look may expect to be believed.
    """
    fitting = [look for look in looks if not look.match_error_px > limit_px] or list(looks)
    first = fitting[0]
    if len(fitting) == 1:
        return first
    firmness = [_firmness(look) for look in fitting]
    moment = sum(
        (firm @ pose_vector(look.correction) for firm, look in zip(firmness, fitting, strict=True)), np.zeros(6)
    )
    correction = pose_from_vector(np.linalg.solve(np.sum(firmness, axis=0), moment))
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


def _firmness(look: StageTrace) -> np.ndarray:
    """Information ``[6, 6]`` of a look as its results are found to be right."""
    if look.information is None:
        return np.eye(6)
    return inverse(Spread().covariance(look.information, look.range, look.range, look.match_error_px))
