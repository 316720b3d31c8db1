"""Images of a lens as the pinhole has them: dots are drawn where the lens puts them, and found where they belong."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from calibnet.geometry import CameraModel
from calibnet.geometry.rectification import Rectification, central, degrees_across, field_of_view_note, without_black

MATRIX = np.array([[150.0, 0.0, 199.0], [0.0, 155.0, 151.0], [0.0, 0.0, 1.0]])
LENSES = {
    "equidistant": [0.02, -0.008, 0.003, -0.0006],
    "omnidirectional": [1.2, -0.1, 0.05, 0.001, -0.002],
    "double_sphere": [-0.2, 0.6],
    "rational_polynomial": [-0.3, 0.1, 0.002, -0.001, 0.02, 0.05, -0.02, 0.01],
}
RAYS = np.array([[0.5, 0.1, 1.0], [-0.4, -0.3, 1.0], [0.1, 0.45, 1.0], [0.0, 0.0, 1.0]])


def camera(model: str) -> CameraModel:
    matrix = MATRIX.copy()
    if model == "omnidirectional":
        matrix[:2, :2] *= 2.2
    return CameraModel(400, 300, matrix, model, np.array(LENSES[model]))


def dots(places: np.ndarray, width: int, height: int) -> np.ndarray:
    v, u = np.mgrid[:height, :width]
    picture = sum(np.exp(-((u - x) ** 2 + (v - y) ** 2) / (2 * 2.5**2)) for x, y in places)
    return np.repeat(np.uint8(255 * np.clip(picture, 0, 1))[..., None], 3, axis=2)


@pytest.mark.parametrize("model", LENSES)
def test_a_lens_is_undone(model):
    rectification = central(camera(model))
    pinhole = rectification.pinhole
    picture = rectification(dots(rectification.camera.see(RAYS).pixels, 400, 300))
    assert picture.shape == (pinhole.height, pinhole.width, 3)
    v, u = np.mgrid[: pinhole.height, : pinhole.width]
    for x, y, _ in RAYS:
        expected = np.array([pinhole.focal[0] * x + pinhole.center[0], pinhole.focal[1] * y + pinhole.center[1]])
        weight = picture[..., 0] * ((u - expected[0]) ** 2 + (v - expected[1]) ** 2 < 14**2)
        assert_allclose([(weight * u).sum() / weight.sum(), (weight * v).sum() / weight.sum()], expected, atol=0.4)


def test_the_pinhole_shows_the_centre_as_large_as_the_lens_does():
    for model in ("equidistant", "omnidirectional", "double_sphere"):
        of_lens = camera(model)
        near = of_lens.see(np.array([[0.0, 0.0, 1.0], [0.01, 0.01, 1.0]])).pixels
        assert_allclose(central(of_lens).pinhole.focal, (near[1] - near[0]) / 0.01, rtol=2e-3)


def fisheye(focal: float) -> CameraModel:
    matrix = np.array([[focal, 0.0, 199.5], [0.0, focal, 149.5], [0.0, 0.0, 1.0]])
    return CameraModel(400, 300, matrix, "equidistant", np.zeros(4))


def test_a_pinhole_ends_where_the_lens_does_and_not_beyond_what_is_of_use():
    narrow = fisheye(500.0)
    expected = np.degrees(2 * 200 / 500)  # angles are distances from the centre
    assert degrees_across(central(narrow).pinhole) == pytest.approx(expected, abs=0.6)
    assert field_of_view_note(central(narrow)) == ()
    wide = fisheye(120.0)
    assert degrees_across(central(wide).pinhole) == pytest.approx(110, abs=0.5)
    (sentence,) = field_of_view_note(central(wide))
    assert sentence.startswith("The lens sees 190° across; the middle 110° are used")


def test_opencv_lens_keeps_matrix_and_size():
    pinhole = central(camera("rational_polynomial")).pinhole
    assert (pinhole.width, pinhole.height) == (400, 300)
    assert_allclose(pinhole.matrix, MATRIX)


def test_a_pinhole_may_look_to_the_side():
    """Turned by 60 degrees to the right, a point there lies at its centre."""
    of_lens = camera("equidistant")
    angle = np.radians(60.0)
    turn = np.array([[np.cos(angle), 0, -np.sin(angle)], [0, 1, 0], [np.sin(angle), 0, np.cos(angle)]])
    ray = np.array([[np.sin(angle), 0.0, np.cos(angle)]])
    assert_allclose(turn @ ray[0], [0, 0, 1], atol=1e-12)
    side = Rectification(of_lens, central(of_lens).pinhole, turn)
    picture = side(dots(of_lens.see(ray).pixels, 400, 300))[..., 0].astype(float)
    v, u = np.mgrid[: picture.shape[0], : picture.shape[1]]
    assert_allclose(
        [(picture * u).sum() / picture.sum(), (picture * v).sum() / picture.sum()], side.pinhole.center, atol=0.7
    )


def test_what_a_fisheye_leaves_black_is_cut_off():
    """An image that is lit only between columns 100 and 299 loses the rest, and no pixel moves."""
    of_lens = fisheye(150.0)
    whole = central(of_lens)
    image = np.zeros((300, 400, 3), np.uint8)
    image[:, 100:300] = np.arange(60, 260)[:, None]
    dark = np.zeros_like(image)
    cut = without_black(whole, [dark, image])
    left = int(np.ceil(whole.pinhole.center[0] - whole.pinhole.focal[0] * np.tan(100 / 150)))
    assert abs(whole.pinhole.center[0] - cut.pinhole.center[0] - left) <= 8, "columns of a pinhole are bent in the lens"
    assert cut.pinhole.width == pytest.approx(2 * 150 * np.tan(100 / 150), abs=16)
    shift = round(whole.pinhole.center[0] - cut.pinhole.center[0])
    assert_array_equal(cut(image), whole(image)[:, shift : shift + cut.pinhole.width])
    assert without_black(whole, [dark]) is whole
