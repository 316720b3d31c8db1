"""How often results claim to be within a tolerance, and how often they are not."""

from __future__ import annotations

import numpy as np

from calibnet.evaluation.claims import Claims
from calibnet.geometry import PoseError, miscalibration, pose_error
from calibnet.verdict import DRIVE_TOLERANCES


def off(yaw: float, ahead: float) -> PoseError:
    return pose_error(miscalibration([0, 0, yaw], [0, 0, ahead]), np.eye(4))


def test_claims_are_held_against_the_error() -> None:
    fine, coarse = DRIVE_TOLERANCES
    results = [
        (fine, off(0.1, 0.02)),
        (coarse, off(0.4, 0.1)),
        (None, off(0.4, 0.1)),
        (None, off(0.6, 0.1)),
        (coarse, off(0.4, 0.16)),
    ]
    claims = Claims.of(coarse, results)
    assert (claims.results, claims.within, claims.claimed, claims.wrong) == (5, 3, 3, 1)
    assert str(claims) == "certain to be within 0.5° / 15 cm: 2 of the 3 that are, 1 of 2 others"
    assert claims.as_dict()["tolerance"] == {"rotation_deg": 0.5, "translation_cm": 15.0}
