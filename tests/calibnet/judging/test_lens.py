from __future__ import annotations

import numpy as np
import pytest

from calibnet.geometry import miscalibration, pose_error
from calibnet.geometry.se3 import pose_from_vector, transform_points
from calibnet.judging.lens import LENSES, PINHOLE, fit, view
from tests.support.drive import REFERENCE
from tests.support.matches import CAMERA, matches

PRIOR = np.diag([300.0] * 3 + [3e4] * 3)
"""Of a guess that may be 6 cm and 0.3 degrees off an axis."""
CORRECTION = miscalibration([0.2, -0.1, 0.15], [0.03, -0.02, 0.04])


@pytest.mark.parametrize("equidistant", [False, True])
def test_derivatives_are_those_of_finite_differences(equidistant: bool) -> None:
    points = np.array([[4.0, 1.0, 9.0], [-7.0, -1.0, 8.0], [0.5, 0.2, 30.0]])
    extra = np.array([0.03, 0.01, -0.02, -0.05])
    _, jacobian, ahead = view(points, extra, equidistant)
    for axis, step in enumerate(1e-6 * np.eye(10)):
        more, less = (
            view(transform_points(pose_from_vector(sign * step[:6]), points), extra + sign * step[6:], equidistant)[0]
            for sign in (1, -1)
        )
        assert jacobian[:, :, axis] == pytest.approx((more - less) / 2e-6, abs=1e-6)
    assert (ahead == 1).all()


def test_the_pose_alone_is_found_and_no_lens_gains_where_the_lens_is_right() -> None:
    found = matches(CORRECTION, noise=1.0)
    alone = fit(found, REFERENCE, CAMERA, PRIOR, PINHOLE)
    error = pose_error(alone.camera_from_lidar, CORRECTION @ REFERENCE)
    assert error.translation_cm < 1.5 and error.rotation_deg < 0.03
    gains = [alone.cost - fit(found, REFERENCE, CAMERA, PRIOR, lens).cost for lens in LENSES]
    assert max(gains) < 1.0


def by_radius(k1: float) -> object:
    return lambda places: places * (1 + k1 * (places**2).sum(axis=1, keepdims=True))


def equidistant(places: np.ndarray) -> np.ndarray:
    radius = np.hypot(*places.T)[:, None]
    return places * np.arctan(radius) / radius


@pytest.mark.parametrize(
    ("name", "bend", "found"),
    [
        ("focal-length", lambda places: 1.05 * places, lambda one: (one.focal - 1, 0.05, 0.003)),
        ("principal-point", lambda places: places + np.eye(2)[0] / 20, lambda one: (one.center[0] / 580, 0.05, 0.005)),
        ("distortion", by_radius(-0.15), lambda one: (one.radial, -0.15, 0.01)),
        ("lens-model", equidistant, lambda one: (one.focal, 1.0, 1e-9)),
    ],
)
def test_the_lens_that_is_wrong_gains_most_and_is_measured(name, bend, found) -> None:  # type: ignore[no-untyped-def]
    bad = matches(CORRECTION, bend, noise=0.5)
    fits = {lens.name: fit(bad, REFERENCE, CAMERA, PRIOR, lens) for lens in (PINHOLE, *LENSES)}
    assert min(fits, key=lambda key: fits[key].cost) == name
    assert fits[""].cost - fits[name].cost > 5
    value, expected, within = found(fits[name])
    assert value == pytest.approx(expected, abs=within)
    right = pose_error(fits[name].camera_from_lidar, CORRECTION @ REFERENCE)
    wrong = pose_error(fits[""].camera_from_lidar, CORRECTION @ REFERENCE)
    assert right.translation_cm < wrong.translation_cm


def test_a_fit_that_starts_from_the_pose_alone_comes_to_the_same_and_is_given_up_where_it_cannot_win() -> None:
    found = matches(CORRECTION, noise=1.0)
    alone = fit(found, REFERENCE, CAMERA, PRIOR, PINHOLE)
    for lens in LENSES:
        afresh = fit(found, REFERENCE, CAMERA, PRIOR, lens).cost
        warm = fit(found, REFERENCE, CAMERA, PRIOR, lens, start=alone).cost
        assert warm == pytest.approx(afresh, rel=3e-4) if afresh <= alone.cost else warm > alone.cost
