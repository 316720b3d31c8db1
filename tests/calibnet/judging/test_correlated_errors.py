"""The covariance of a pose whose matches err alike: equal to the dense formula, and bounded by the common error."""

from __future__ import annotations

import numpy as np

from calibnet.geometry import PinholeCamera
from calibnet.judging.correlated_errors import SIGMA_PX, correlated_covariance, monomials
from calibnet.judging.lens import INDEPENDENT, view
from calibnet.trace import Matches

CAMERA = PinholeCamera(400, 200, np.array([[300.0, 0, 200], [0, 300.0, 100], [0, 0, 1]]))
PRIOR = np.diag([4.0, 4.0, 4.0, 100.0, 100.0, 100.0])


def matches(count: int, depth: tuple[float, float], seed: int = 0) -> Matches:
    generator = np.random.default_rng(seed)
    z = generator.uniform(*depth, count)
    ray = np.column_stack([generator.uniform(-0.6, 0.6, count), generator.uniform(-0.3, 0.3, count), np.ones(count)])
    scale = generator.uniform(0.5, 3.0, (count, 2))
    return Matches((ray * z[:, None]).astype(np.float32), np.zeros((count, 2), np.float32), scale.astype(np.float32))


def test_it_is_what_dense_covariances_of_the_matches_give() -> None:
    some = matches(60, (3.0, 20.0))
    place, jacobian, _ = view(some.points.astype(np.float64), np.zeros(4), equidistant=False)
    terms = monomials(place * 300.0 / 200.0)
    information = PRIOR.copy()
    for axis in (0, 1):
        errors = np.diag((some.scale[:, axis].astype(np.float64) / 300.0) ** 2 / INDEPENDENT)
        errors += (SIGMA_PX / 300.0) ** 2 * terms @ terms.T
        information += jacobian[:, axis, :6].T @ np.linalg.solve(errors, jacobian[:, axis, :6])
    assert np.allclose(correlated_covariance(some, CAMERA, PRIOR), np.linalg.inv(information), rtol=1e-6, atol=1e-10)


def test_a_common_error_stays_however_many_matches_there_are() -> None:
    """At one depth a shift across the view looks like the polynomial's constant: it is never known better than that."""
    flat = correlated_covariance(matches(200_000, (9.99, 10.01)), CAMERA, PRIOR)
    assert np.sqrt(flat[0, 0]) > 0.9 * 10.0 * SIGMA_PX / 300.0
    deep = correlated_covariance(matches(200_000, (2.0, 40.0)), CAMERA, PRIOR)
    assert np.sqrt(deep[0, 0]) < 0.1 * np.sqrt(flat[0, 0])


def test_without_matches_nothing_is_known_but_what_was() -> None:
    assert np.allclose(correlated_covariance(matches(0, (1.0, 2.0)), CAMERA, PRIOR), np.linalg.inv(PRIOR))
