"""What is particular to the KITTI layouts: the exact extrinsic, image types, times, lists, gaps."""

from __future__ import annotations

import numpy as np
import pykitti
import pytest
from numpy.testing import assert_allclose

from calibnet.datasets import open_sequence
from calibnet.errors import DatasetError
from calibnet.geometry import project


def test_offset_of_the_camera_is_exact_in_all_three_axes(write_layout):
    """By hand from the numbers of calib.txt: z is P[2, 3], x and y follow from it."""
    layout = write_layout("kitti-odometry")
    (fx, cx), (fy, cy), (px, py, pz) = (60.0, 31.0), (62.0, 22.5), (3.1, -0.25, 0.004)
    offset = np.array([(px - cx * pz) / fx, (py - cy * pz) / fy, pz])
    assert_allclose(layout.open()[0].camera_from_lidar[:3, 3], np.array([0.02, -0.07, -0.3]) + offset, atol=1e-15)
    dropped = pykitti.odometry(str(layout.root), "04").calib.T_cam2_velo[:3, 3]
    assert np.linalg.norm(dropped - layout.open()[0].camera_from_lidar[:3, 3]) > 0.004


@pytest.mark.parametrize("dataset", ["kitti-odometry", "kitti-raw", "kitti-object"])
def test_projection_agrees_with_the_3x4_matrix_of_kitti(dataset, write_layout):
    """KITTI defines its pixels as ``P R_rect Tr X``: the decomposition must not change them."""
    layout = write_layout(dataset)
    frame = layout.open()[1]
    rows = {}
    for path in [layout.calibration, *layout.calibration.parent.glob("calib_velo*")]:
        for line in path.read_text().splitlines():
            key, _, values = line.partition(":")
            if key and key != "calib_time":
                rows[key] = np.array(values.split(), dtype=float)
    projection = rows.get("P_rect_02", rows.get("P2")).reshape(3, 4)
    rotation = rows.get("R_rect_00", rows.get("R0_rect", np.eye(3))).reshape(3, 3)
    velodyne = rows.get("Tr", rows.get("Tr_velo_to_cam"))
    velodyne = np.column_stack([rows["R"].reshape(3, 3), rows["T"]]) if velodyne is None else velodyne.reshape(3, 4)
    homogeneous = np.column_stack([frame.points[:, :3], np.ones(len(frame.points))]).T
    in_camera0 = rotation @ velodyne @ homogeneous
    u, v, w = projection @ np.vstack([in_camera0, np.ones(in_camera0.shape[1])])
    projected = project(frame.points, frame.camera_from_lidar, frame.camera)
    assert len(projected.index) > 50
    assert_allclose(projected.pixels, np.column_stack([u / w, v / w])[projected.index], atol=2e-3)
    assert_allclose(projected.depth, w[projected.index], rtol=1e-5)


@pytest.mark.parametrize("dataset", ["kitti-odometry", "kitti-raw", "kitti-object"])
@pytest.mark.parametrize("suffix", [".jpg", ".jpeg"])
def test_jpeg_images_are_found(dataset, suffix, write_layout):
    import cv2

    layout = write_layout(dataset)
    for image, rgb in zip(layout.images, layout.pixels, strict=True):
        image.unlink()
        cv2.imwrite(str(image.with_suffix(suffix)), rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 100])
    frames = list(layout.open())
    assert [frame.index for frame in frames] == layout.indices
    assert_allclose(frames[1].image.astype(float), layout.pixels[1], atol=40)
    assert np.abs(frames[1].image.astype(float) - layout.pixels[1]).mean() < 4.0
    cut = layout.images[1].with_suffix(suffix)
    cut.write_bytes(cut.read_bytes()[:-2])
    with pytest.raises(DatasetError, match=r"000\d+\.jpe?g is truncated"):
        layout.open()[1]


@pytest.mark.parametrize(("dataset", "other"), [("kitti-odometry", "image_0"), ("kitti-raw", "image_00")])
def test_grey_camera_gives_three_equal_channels_and_its_own_extrinsic(dataset, other, write_layout):
    import cv2

    layout = write_layout(dataset)
    colour = next(parent for parent in layout.images[0].parents if parent.name.startswith("image_"))
    for image, rgb in zip(layout.images, layout.pixels, strict=True):
        grey = colour.with_name(other) / image.relative_to(colour)
        grey.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(grey), rgb[..., 1])
    frame = layout.open(camera=0)[2]
    assert "camera 0" in layout.open(camera=0).rig
    for channel in range(3):
        np.testing.assert_array_equal(frame.image[..., channel], layout.pixels[2][..., 1])
    moved = frame.camera_from_lidar[:3, 3] - layout.camera_from_lidar[:3, 3]
    assert_allclose(moved, [-1 / 60.0 - (3.1 - 31.0 * 0.004) / 60.0, (0.25 + 22.5 * 0.004) / 62.0, -0.004], atol=1e-12)


def test_odometry_times_come_from_the_file(write_layout):
    layout = write_layout("kitti-odometry")
    assert [frame.timestamp for frame in layout.open()] == [0.0, 0.104, 0.207]
    times = layout.calibration.with_name("times.txt")
    times.write_text("0.0\n0.1\n")
    with pytest.raises(DatasetError, match=r"times\.txt has 2 times for 3 frames"):
        layout.open()
    times.write_text("0.0\nsoon\n0.2\n")
    with pytest.raises(DatasetError, match=r"times\.txt: line 2 is not a time"):
        layout.open()
    times.unlink()
    assert_allclose([frame.timestamp for frame in layout.open()], [0.0, 0.1, 0.2])


def test_what_has_no_partner_is_left_out_and_the_times_stay(write_layout):
    """KITTI published no scan of four images of raw drive 0009."""
    layout = write_layout("kitti-raw")
    whole = [frame.timestamp for frame in layout.open()]
    layout.scans[1].unlink()
    sequence = layout.open()
    assert [frame.index for frame in sequence] == [3, 9]
    assert_allclose([frame.timestamp for frame in sequence], [whole[0], whole[2]])


def test_a_tracking_sequence_leaves_out_what_has_no_scan(write_layout):
    """KITTI published no scan of four images of sequence 0001."""
    layout = write_layout("kitti-tracking")
    for part, suffix in (("image_02", "png"), ("velodyne", "bin")):
        folder = layout.root / "training" / part
        (folder / "0007").rename(folder / "0001")
        for number, gap in enumerate((176, 177, 181)):
            (folder / "0001" / f"{number:06d}.{suffix}").rename(folder / "0001" / f"{gap:06d}.{suffix}")
    layout.calibration.rename(layout.calibration.with_name("0001.txt"))
    (layout.root / "training" / "velodyne" / "0001" / "000177.bin").unlink()
    sequence = open_sequence("kitti-tracking", layout.root, sequence="0001")
    assert [frame.index for frame in sequence] == [176, 181]
    assert_allclose([frame.timestamp for frame in sequence], [0.0, 0.5])
    assert sequence.notes == ("1 image without a partner is left out (000177).",)
    with pytest.raises(DatasetError, match="sequences there: 0001"):
        open_sequence("kitti-tracking", layout.root, sequence=3)


def test_own_data_in_the_layout_of_odometry_needs_one_projection_and_the_extrinsic(write_layout):
    layout = write_layout("kitti-odometry")
    rows = layout.calibration.read_text().splitlines()
    layout.calibration.write_text("\n".join(row for row in rows if row.startswith(("P2", "Tr"))) + "\n")
    frame = layout.open()[1]
    assert_allclose(frame.camera.matrix, layout.matrix)
    assert_allclose(frame.camera_from_lidar, layout.camera_from_lidar, atol=1e-12)
    with pytest.raises(DatasetError, match=r"has no row 'P2'"):
        layout.calibration.write_text(rows[-1] + "\n")
        layout.open()


def test_part_of_a_sequence_keeps_the_times_of_its_file_numbers(write_layout):
    layout = write_layout("kitti-odometry")
    for path in (layout.images[0], layout.scans[0]):
        path.unlink()
    frames = list(layout.open())
    assert [frame.index for frame in frames] == [1, 2]
    assert_allclose([frame.timestamp for frame in frames], [0.0, 0.103])


def test_raw_times_are_optional_and_fall_back_to_ten_hertz(write_layout):
    layout = write_layout("kitti-raw")
    assert [frame.timestamp for frame in layout.open()] == [0.0, 1.0, 2.0]
    stamps = next(layout.root.rglob("oxts/timestamps.txt"))
    stamps.write_text("2011-01-02 10:00:00.000000000\nyesterday\n")
    with pytest.raises(DatasetError, match=r"timestamps\.txt: line 2 is not a time"):
        layout.open()
    stamps.unlink()
    assert_allclose([frame.timestamp for frame in layout.open()], [0.0, 0.3, 0.6])


def test_sequence_and_drive_numbers_may_be_short(write_layout):
    assert len(write_layout("kitti-odometry").open(sequence=4)) == 3
    assert len(write_layout("kitti-raw").open(drive="7")) == 3


def test_missing_sequence_drive_and_split_list_what_is_there(write_layout):
    with pytest.raises(DatasetError, match=r"sequences/05 does not exist; sequences there: 04\."):
        write_layout("kitti-odometry").open(sequence="05")
    raw = write_layout("kitti-raw")
    with pytest.raises(DatasetError, match=r"drive_0008_sync does not exist; drives there: 0007\."):
        raw.open(drive="0008")
    with pytest.raises(DatasetError, match=r"2012_01_01 does not exist.*2011_01_02"):
        raw.open(date="2012_01_01", drive="1")
    with pytest.raises(DatasetError, match=r"no split 'trian'; splits there: training, testing, val\."):
        write_layout("kitti-object").open(split="trian")


def test_object_list_selects_frames_in_its_order(write_layout):
    layout = write_layout("kitti-object")
    assert [frame.index for frame in layout.open(split="val")] == [8, 1]
    lists = layout.root / "ImageSets" / "val.txt"
    lists.write_text("000008\n000009\n")
    with pytest.raises(DatasetError, match=r"val\.txt lists '000009'"):
        layout.open(split="val")
    lists.write_text("\n")
    with pytest.raises(DatasetError, match=r"val\.txt is empty"):
        layout.open(split="val")


def test_object_frames_have_their_own_calibration(write_layout):
    layout = write_layout("kitti-object")
    text = layout.calibration.read_text().replace("P2: 60 ", "P2: 70 ")
    layout.calibration.write_text(text)
    assert [frame.camera.focal[0] for frame in layout.open()] == [60.0, 70.0, 60.0]
