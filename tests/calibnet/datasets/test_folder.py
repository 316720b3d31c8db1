"""The plain folder: cloud formats, intensities, lens distortion and calibration.yaml."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from calibnet.datasets.folder import Folder
from calibnet.errors import DatasetError

XYZ = np.random.default_rng(1).uniform(-20, 20, (50, 3)).astype(np.float32)
BYTES = np.arange(50, dtype=np.float32) * 5.0  # an 8-bit intensity, 0..245


def pcd(form: str, fields: str = "x y z intensity", values: np.ndarray | None = None) -> bytes:
    values = np.column_stack([XYZ, BYTES]).astype(np.float32) if values is None else values
    columns = values.shape[1]
    header = (
        f"# .PCD v0.7\nVERSION 0.7\nFIELDS {fields}\nSIZE {'4 ' * columns}\nTYPE {'F ' * columns}\n"
        f"COUNT {'1 ' * columns}\nWIDTH {len(values)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\n"
        f"POINTS {len(values)}\nDATA {form}\n"
    )
    rows = "\n".join(" ".join(f"{value:.9g}" for value in row) for row in values) + "\n"
    return header.encode() + (values.tobytes() if form == "binary" else rows.encode())


def ply(form: str, name: str = "intensity") -> bytes:
    header = (
        f"ply\nformat {form} 1.0\ncomment by hand\nelement vertex {len(XYZ)}\n"
        f"property float x\nproperty float y\nproperty float z\nproperty uchar {name}\nend_header\n"
    )
    rows = np.zeros(len(XYZ), dtype=[("xyz", "<f4", 3), ("i", "u1")])
    rows["xyz"], rows["i"] = XYZ, BYTES
    text = "\n".join(" ".join(map(str, [*xyz.tolist(), int(i)])) for xyz, i in rows) + "\n"
    return header.encode() + (text.encode() if form == "ascii" else rows.tobytes())


def npy(array: np.ndarray) -> bytes:
    import io

    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


CLOUDS = {
    "binary pcd": (".pcd", pcd("binary")),
    "ascii pcd": (".pcd", pcd("ascii")),
    "binary ply": (".ply", ply("binary_little_endian")),
    "ascii ply": (".ply", ply("ascii")),
    "CloudCompare ply": (".ply", ply("binary_little_endian", "scalar_Intensity")),
    "CloudCompare ply without a name": (".ply", ply("binary_little_endian", "scalar_Scalar_field")),
    "ply of another tool": (".ply", ply("ascii", "Remission")),
    "npy": (".npy", npy(np.column_stack([XYZ, BYTES]))),
    "npy of doubles with a ring": (".npy", npy(np.column_stack([XYZ, BYTES, BYTES]).astype(np.float64))),
    "bin": (".bin", np.column_stack([XYZ, BYTES]).astype(np.float32).tobytes()),
}


def with_cloud(layout, suffix: str, content: bytes):
    layout.scans[1].unlink()
    path = layout.scans[1].with_suffix(suffix)
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("kind", CLOUDS)
def test_every_cloud_format_gives_the_same_points(kind, write_layout):
    layout = write_layout("folder")
    with_cloud(layout, *CLOUDS[kind])
    points = layout.open()[1].points
    assert_allclose(points[:, :3], XYZ, rtol=1e-6)
    assert_allclose(points[:, 3], BYTES / 255.0, rtol=1e-6)


@pytest.mark.parametrize("kind", CLOUDS)
@pytest.mark.parametrize("kept", [0.5, 0.1])
def test_truncated_cloud_is_refused(kind, kept, write_layout):
    """Open3D alone would return the whole count, with stale memory for what is missing."""
    layout = write_layout("folder")
    suffix, content = CLOUDS[kind]
    path = with_cloud(layout, suffix, content[: int(kept * len(content)) | 1])
    with pytest.raises(DatasetError, match=path.name):
        layout.open()[1]


def test_cloud_that_lacks_one_point_is_refused(write_layout):
    layout = write_layout("folder")
    for suffix, content, lost in [(".ply", ply("binary_little_endian"), 13), (".pcd", pcd("binary"), 16)]:
        path = with_cloud(layout, suffix, content[:-lost])
        with pytest.raises(DatasetError, match=f"{path.name} cannot be read: it is truncated"):
            layout.open()[1]
        path.rename(layout.scans[1])


@pytest.mark.parametrize("suffix", [".pcd", ".ply", ".npy"])
def test_file_that_is_no_cloud(suffix, write_layout):
    layout = write_layout("folder")
    path = with_cloud(layout, suffix, b"hello, world")
    with pytest.raises(DatasetError, match=path.name):
        layout.open()[1]


def test_cloud_without_intensity_or_points(write_layout):
    layout = write_layout("folder")
    with_cloud(layout, ".npy", npy(XYZ.astype(np.float64)))
    assert_array_equal(layout.open()[1].points[:, 3], 0.0)
    layout.scans[1].with_suffix(".npy").write_bytes(npy(XYZ[:, :2]))
    with pytest.raises(DatasetError, match=r"\(50, 2\)"):
        layout.open()[1]
    layout.scans[1].with_suffix(".npy").write_bytes(npy(XYZ[:0]))
    with pytest.raises(DatasetError, match="is empty"):
        layout.open()[1]


def test_nan_points_of_a_pcd_are_dropped(write_layout):
    layout = write_layout("folder")
    values = np.column_stack([XYZ, BYTES])
    values[::2, :3] = np.nan
    with_cloud(layout, ".pcd", pcd("binary", values=values))
    assert_allclose(layout.open()[1].points[:, :3], XYZ[1::2])


@pytest.mark.parametrize(("largest", "divisor"), [(1.0, 1.0), (200.0, 255.0)])
def test_intensity_is_brought_to_one(largest, divisor, write_layout):
    layout = write_layout("folder")
    points = layout.points[1].copy()
    points[:, 3] = np.linspace(0, largest, len(points))
    points.tofile(layout.scans[1])
    assert_allclose(layout.open()[1].points[:, 3], points[:, 3] / divisor, rtol=1e-6)


@pytest.mark.parametrize(("glint", "divisor"), [(4095.0, 255.0), (1e9, 255.0), (np.inf, 255.0), (7.0, 1.0)])
def test_a_glint_leaves_the_other_intensities_as_they_are(glint, divisor, write_layout):
    """A reflector overflows what the sensor's other points are stored in."""
    layout = write_layout("folder")
    points = layout.points[1].copy()
    points[:, 3] = np.linspace(0, 0.98 * divisor, len(points))
    points[7, 3] = glint
    points.tofile(layout.scans[1])
    expected = points[:, 3] / divisor
    expected[7] = 0.0 if np.isinf(glint) else 1.0
    assert_allclose(layout.open()[1].points[:, 3], expected, rtol=1e-6)


def test_a_point_without_intensity_is_a_point(write_layout):
    """Drivers of sensors without intensity leave it NaN."""
    layout = write_layout("folder")
    points = layout.points[1].copy()
    points[::2, 3] = np.nan
    points.tofile(layout.scans[1])
    read = layout.open()[1].points
    assert_array_equal(read[:, :3], points[:, :3])
    assert_array_equal(read[::2, 3], 0.0)
    assert_array_equal(read[1::2, 3], points[1::2, 3])
    points[:, 3] = np.nan
    points.tofile(layout.scans[1])
    assert_array_equal(layout.open()[1].points[:, 3], 0.0)


def brown(x: float, y: float, k: list[float]) -> tuple[float, float]:
    """OpenCV's distortion model, written out: k1 k2 p1 p2 [k3 [k4 k5 k6]]."""
    k1, k2, p1, p2, k3, k4, k5, k6 = [*k, *[0.0] * (8 - len(k))]
    r = x * x + y * y
    radial = (1 + k1 * r + k2 * r**2 + k3 * r**3) / (1 + k4 * r + k5 * r**2 + k6 * r**3)
    return (
        x * radial + 2 * p1 * x * y + p2 * (r + 2 * x * x),
        y * radial + p1 * (r + 2 * y * y) + 2 * p2 * x * y,
    )


@pytest.mark.parametrize(
    "coefficients",
    [
        [-0.3, 0.1, 0.002, -0.001],
        [-0.37, 0.2, 0.0014, 0.0006, -0.07],
        [-0.3, 0.1, 0.002, -0.001, 0.02, 0.05, -0.02, 0.01],
    ],
)
def test_lens_distortion_is_undone(coefficients, write_layout, write_calibration):
    """Dots drawn where the distorting lens puts them are found where the pinhole camera has them."""
    matrix = np.array([[300.0, 0.0, 158.0], [0.0, 310.0, 121.0], [0.0, 0.0, 1.0]])
    layout = write_layout("folder")
    v, u = np.mgrid[0:240, 0:320]
    rays = [(-0.4, -0.28), (0.38, 0.25), (0.1, -0.2), (-0.3, 0.2)]
    picture = np.zeros((240, 320))
    for x, y in rays:
        dx, dy = brown(x, y, coefficients)
        picture += np.exp(-((u - 300 * dx - 158) ** 2 + (v - 310 * dy - 121) ** 2) / (2 * 2.5**2))
    for image in layout.images:
        cv2.imwrite(str(image), np.uint8(255 * np.clip(picture, 0, 1)))
    text = write_calibration(width=320, height=240, camera_matrix=matrix.tolist(), distortion=coefficients)
    layout.calibration.write_text(text)

    frame = layout.open()[0]
    assert_array_equal(frame.camera.matrix, matrix)
    for x, y in rays:
        expected = np.array([300 * x + 158, 310 * y + 121])
        near = (u - expected[0]) ** 2 + (v - expected[1]) ** 2 < 12**2
        weight = frame.image[..., 0] * near
        found = [(weight * u).sum() / weight.sum(), (weight * v).sum() / weight.sum()]
        assert_allclose(found, expected, atol=0.25)


def test_image_of_another_size(write_layout, write_calibration):
    layout = write_layout("folder")
    layout.calibration.write_text(write_calibration(width=80))
    with pytest.raises(DatasetError, match=r"0000\.png is 64x48 but its calibration is for 80x48"):
        layout.open()[0]


IDENTITY = np.eye(4).tolist()


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        *(({key: None}, f"no key '{key}'") for key in ("width", "camera_matrix", "distortion")),
        ({"camera_from_lidar": None}, "has no pose of the LiDAR; give a first guess with --guess FILE"),
        ({"width": 64.5}, "width is 64.5"),
        ({"height": -1}, "height is -1"),
        ({"camera_matrix": [[1, 2], [3, 4]]}, "camera_matrix has 2x2 numbers instead of 3x3"),
        ({"camera_matrix": "[[1, 0, 0], [0, 1]]"}, "camera_matrix is not a list of 3x3 numbers"),
        ({"camera_matrix": [[0, 0, 1], [0, 5, 1], [0, 0, 1]]}, "singular"),
        ({"camera_matrix": [[5, 0, 1], [0, 5, 1], [0, 0, 2]]}, "not a camera matrix"),
        ({"camera_matrix": "[[.nan, 0, 1], [0, 5, 1], [0, 0, 1]]"}, "not finite"),
        ({"distortion": [0, 0, 0]}, "distortion has 3 numbers instead of 4 or 5 or 8 or 12 or 14"),
        ({"camera_from_lidar": "front left"}, "camera_from_lidar is not a list of 4x4 or 3x4 numbers"),
        ({"camera_from_lidar": (2.0 * np.eye(4)).tolist()}, "last row"),
        ({"camera_from_lidar": np.diag([2.0, 1, 1, 1]).tolist()}, "not orthonormal"),
        ({"camera_from_lidar": np.diag([-1.0, 1, 1, 1]).tolist()}, "reflection"),
    ],
)
def test_malformed_calibration(changes, problem, write_layout, write_calibration):
    layout = write_layout("folder")
    layout.calibration.write_text(write_calibration(**changes))
    with pytest.raises(DatasetError) as caught:
        layout.open()
    assert str(layout.calibration) in str(caught.value)
    assert problem in str(caught.value)


@pytest.mark.parametrize(
    ("text", "problem"), [("a: [1, 2", "not valid YAML"), ("", "key: value"), ("- 1", "key: value")]
)
def test_calibration_that_is_no_mapping(text, problem, write_layout):
    layout = write_layout("folder")
    layout.calibration.write_text(text)
    with pytest.raises(DatasetError, match=problem):
        layout.open()


def test_numbers_without_a_decimal_point_are_numbers(write_layout, write_calibration):
    """YAML 1.1 reads ``6e1`` as text; whoever wrote it meant 60."""
    layout = write_layout("folder")
    layout.calibration.write_text(write_calibration(camera_matrix="[[6e1, 0, 31], [0, 62, 22.5], [0, 0, 1]]"))
    assert layout.open()[0].camera.focal == (60.0, 62.0)


def test_file_names_become_frame_numbers_where_they_are_numbers(write_layout):
    layout = write_layout("folder")

    def renamed(*stems: str) -> list[int]:
        for files in (layout.images, layout.scans):
            files[:] = [path.rename(path.with_stem(stem)) for path, stem in zip(files, stems, strict=True)]
        return [frame.index for frame in layout.open()]

    assert renamed("0007", "0009", "0030") == [7, 9, 30]
    assert renamed("left", "middle", "right") == [0, 1, 2]
    assert renamed("1532402927612460000", "1532402927712460000", "1532402927812460000") == [0, 1, 2]


def test_orientation_tag_does_not_turn_the_image(write_layout):
    """A phone's EXIF tag would swap width and height under the calibration."""
    layout = write_layout("folder")
    jpeg = cv2.imencode(".jpg", layout.pixels[1][..., ::-1])[1].tobytes()
    tag = b"Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0"
    layout.images[1].unlink()
    path = layout.images[1].with_suffix(".jpg")
    path.write_bytes(jpeg[:2] + b"\xff\xe1" + (len(tag) + 2).to_bytes(2, "big") + tag + jpeg[2:])
    assert cv2.imread(str(path)).shape == (64, 48, 3), "the tag is one that OpenCV obeys"
    assert layout.open()[1].image.shape == (48, 64, 3)


def test_two_files_of_one_stem(write_layout):
    layout = write_layout("folder")
    layout.scans[0].with_suffix(".npy").write_bytes(npy(XYZ))
    with pytest.raises(DatasetError, match=r"0000\.bin and 0000\.npy"):
        layout.open()


@pytest.mark.parametrize("bits", [8, 16])
def test_images_in_pgm(bits, write_layout):
    layout = write_layout("folder")
    grey = [cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in layout.images]
    for path, picture in zip(layout.images, grey, strict=True):
        path.unlink()
        cv2.imwrite(str(path.with_suffix(".pgm")), picture if bits == 8 else picture.astype(np.uint16) * 257)
    for frame, picture in zip(layout.open(), grey, strict=True):
        assert_array_equal(frame.image, np.repeat(picture[..., None], 3, axis=2))


def test_a_camera_is_named_in_whichever_file_holds_several(write_layout, tmp_path):
    layout = write_layout("folder")
    guess = tmp_path / "calib.txt"
    row = "0 -1 0 0 0 0 -1 -0.1 1 0 0 -0.2"
    guess.write_text(f"P0: 50 0 32 0 0 50 24 0 0 0 1 0\nP2: 50 0 32 10 0 50 24 0 0 0 1 0\nTr: {row}\n")
    found = Folder(layout.root, guess=guess, camera="2").calibration
    assert_allclose(found.camera_from_lidar[:3, 3], [0.2, -0.1, -0.2])
    with pytest.raises(DatasetError, match=r"calib\.txt has the cameras 0, 2; choose one with --camera"):
        Folder(layout.root, guess=guess)
    with pytest.raises(DatasetError, match=r"calibration\.yaml has one camera, which is not called 2"):
        Folder(layout.root, camera="2")


def test_a_folder_of_another_layout_is_told_by_what_it_has(write_layout):
    layout = write_layout("folder")
    (layout.root / "clouds").rename(layout.root / "lidar")
    with pytest.raises(DatasetError, match=r"clouds does not exist; .*, this one .*images/, lidar/\."):
        layout.open()
