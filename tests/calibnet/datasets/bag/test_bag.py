"""Bags that other software wrote (rosbags), of ROS 1 and ROS 2 in both storages, as frames."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rosbags.typesys import get_types_from_msg

from calibnet.conformance import check_dataset
from calibnet.datasets.bag import Bag, BagOptions
from calibnet.datasets.bag.messages import columns_of
from calibnet.datasets.calibration_files import FrameChoice
from calibnet.errors import DatasetError
from tests.support.bags import BagWriter, assert_holds, write_bag
from tests.support.fakes import make_frame

KINDS = ("ros1", "sqlite3", "mcap")
FRAMES = [make_frame(number, width=128, height=48, points=3000) for number in range(3)]
NAMES = {"ros1": "drive.bag", "sqlite3": "drive", "mcap": "drive"}


@pytest.fixture(scope="module", params=KINDS)
def path(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bags [1] 100%")
    return write_bag(folder / NAMES[request.param], request.param, FRAMES)


def test_a_bag_is_a_dataset_like_every_other(path: Path) -> None:
    check_dataset(lambda: Bag([path]))


def test_frames_of_a_bag_are_those_that_were_recorded(path: Path) -> None:
    bag = Bag([path])
    assert (bag.image, bag.points) == ("/cam/image_raw/compressed", "/points")
    assert_holds(bag, FRAMES)
    (note,) = bag.notes
    assert note.startswith("/cam/image_raw/compressed (3) and /points (6): 3 frames, 3 of them at a standstill")


def test_a_single_file_of_a_ros_2_bag_is_a_bag(tmp_path: Path) -> None:
    folder = write_bag(tmp_path / "drive", "mcap", FRAMES)
    (file,) = folder.glob("*.mcap")
    assert len(Bag([file])) == 3


def test_a_folder_without_metadata_is_the_bags_in_it(path: Path, tmp_path: Path) -> None:
    for file in [path] if path.is_file() else path.iterdir():
        if file.suffix != ".yaml":
            (tmp_path / file.name).write_bytes(file.read_bytes())
    assert len(Bag([tmp_path])) == 3


def test_a_folder_without_bags_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"is not a bag; give a \.bag, \.db3 or \.mcap file"):
        Bag([tmp_path])


@pytest.mark.parametrize("name", ["drive.bag.active", "drive.BAG", "drive"])
def test_a_file_of_another_name_is_one_sentence(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(b"#ROSBAG V2.0\n")
    with pytest.raises(DatasetError, match=r"does not end with one of \.bag, \.db3, \.mcap; rename it"):
        Bag([tmp_path / name])


def test_frames_without_a_name_are_found_by_what_they_are_called(tmp_path: Path) -> None:
    bag, nameless = BagWriter(tmp_path / "drive", "mcap"), FRAMES[0]
    image = bag.raw(nameless.image, "rgb8", 10.0)
    bag.write("/cam/image_raw", replace(image, header=bag.header(10.0, "")), 10.0)
    bag.write("/cam/camera_info", bag.info(nameless, "plumb_bob", [0.0] * 5), 10.0)
    bag.write("/points", bag.cloud(nameless.points, 10.0), 10.0)
    bag.write("/tf_static", bag.transforms(nameless.camera_from_lidar), 10.0)
    assert_allclose(Bag([bag.close()])[0].camera_from_lidar, nameless.camera_from_lidar, atol=1e-9)


def test_scans_are_put_together_at_a_standstill(path: Path) -> None:
    frames = list(Bag([path], BagOptions(accumulate=2)))
    assert [len(frame.points) for frame in frames] == [2 * len(frame.points) for frame in FRAMES]


def test_every_says_how_many_frames(path: Path) -> None:
    assert len(Bag([path], BagOptions(every=10.0))) == 1


def test_the_stillest_moment_of_a_period_is_taken(tmp_path: Path) -> None:
    """The car stands in the second half of each period."""
    bag, start = BagWriter(tmp_path / "drive", "mcap"), 1000.0
    bag.write("/tf_static", bag.transforms(FRAMES[0].camera_from_lidar), start)
    bag.write("/cam/camera_info", bag.info(FRAMES[0], "plumb_bob", [0.0] * 5), start)
    for number in range(10):
        now, points = start + 0.1 * number, FRAMES[0].points.copy()
        points[:, 0] += 2.0 * min(number, 5)
        bag.write("/cam/image_raw/compressed", bag.compressed(FRAMES[0].image, now), now)
        bag.write("/points", bag.cloud(points, now), now)
    (frame,) = Bag([bag.close()], BagOptions(every=5.0))
    assert_allclose(frame.points[:, 0], FRAMES[0].points[:, 0] + 10.0, atol=1e-5)


def two_cameras(tmp_path: Path) -> Path:
    bag = BagWriter(tmp_path / "drive", "mcap")
    for camera, width in (("left", 128), ("right", 130)):
        frame = make_frame(0, width=width, height=48, points=500)
        bag.write(f"/{camera}/camera_info", bag.info(frame, "plumb_bob", [0.0] * 5), 10.0)
        bag.write(f"/{camera}/image_raw", bag.raw(frame.image, "rgb8", 10.0), 10.0)
    bag.write("/points", bag.cloud(FRAMES[0].points, 10.0), 10.0)
    bag.write("/tf_static", bag.transforms(FRAMES[0].camera_from_lidar), 10.0)
    return bag.close()


def test_one_of_several_topics_has_to_be_named(tmp_path: Path) -> None:
    path = two_cameras(tmp_path)
    with pytest.raises(DatasetError) as caught:
        Bag([path])
    assert "several topics of images; choose one with --image: there are: /left/image_raw (1 Image), /right" in str(
        caught.value
    )
    assert Bag([path], BagOptions(image="/right/image_raw"))[0].camera.width == 130, "with the CameraInfo beside it"
    with pytest.raises(DatasetError, match="has no images in '/rear'"):
        Bag([path], BagOptions(image="/rear"))
    with pytest.raises(DatasetError, match=r"is 128x48 but its calibration is for 130x48"):
        Bag([path], BagOptions(image="/left/image_raw", info="/right/camera_info"))[0]


def without(tmp_path: Path, *left_out: str) -> Path:
    bag = BagWriter(tmp_path / "drive", "mcap")
    messages = {
        "/tf_static": bag.transforms(FRAMES[0].camera_from_lidar),
        "/cam/camera_info": bag.info(FRAMES[0], "equidistant", [0.01, 0.0, 0.0, 0.0]),
        "/cam/image_raw": bag.raw(FRAMES[0].image, "rgb8", 10.0),
        "/points": bag.cloud(FRAMES[0].points, 10.0),
    }
    for topic, message in messages.items():
        if topic not in left_out:
            bag.write(topic, message, 10.0)
    return bag.close()


def test_what_a_bag_lacks_comes_from_the_guess(tmp_path: Path) -> None:
    path, guess = without(tmp_path, "/tf_static", "/cam/camera_info"), tmp_path / "guess.yaml"
    with pytest.raises(DatasetError, match="has no CameraInfo of /cam/image_raw; give the camera's calibration"):
        Bag([path])
    camera = FRAMES[0].camera
    rows = FRAMES[0].camera_from_lidar.tolist()
    guess.write_text(
        f"width: 128\nheight: 48\ncamera_matrix: {camera.matrix.tolist()}\ndistortion: [0, 0, 0, 0]\n"
        f"camera_from_lidar: {rows}\n"
    )
    assert_array_equal(Bag([path], BagOptions(guess=guess))[0].camera_from_lidar, FRAMES[0].camera_from_lidar)


def test_a_bag_without_transforms_asks_for_a_guess(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="has no /tf_static with the pose of the LiDAR; give a first guess"):
        Bag([without(tmp_path, "/tf_static")])


def test_a_bag_without_points_says_what_it_holds(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"has no point clouds; there are: /cam/camera_info \(1 CameraInfo\)"):
        Bag([without(tmp_path, "/points")])


def test_the_lens_of_a_bag_is_undone_and_kept(tmp_path: Path) -> None:
    frame = Bag([without(tmp_path)])[0]
    assert frame.original is not None and frame.original.camera.model == "equidistant"
    assert_array_equal(frame.original.image, FRAMES[0].image)


def test_frames_that_are_not_there_are_named(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="has no frame 'rear'; choose one of cam_optical, velodyne"):
        Bag([without(tmp_path)], BagOptions(frames=FrameChoice("rear")))


@pytest.mark.parametrize("content", [b"", b"#ROSBAG V2.0\n", b"\x89MCAP0\r\n", b"hello" * 100])
@pytest.mark.parametrize("name", ["a.bag", "a.mcap", "a.db3", "a.txt"])
def test_a_file_that_is_no_bag_is_one_sentence(name: str, content: bytes, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(DatasetError, match=name):
        Bag([tmp_path / name])


def test_a_missing_bag(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"nowhere\.bag does not exist"):
        Bag([tmp_path / "nowhere.bag"])


def test_a_truncated_bag_is_one_sentence(path: Path, tmp_path: Path) -> None:
    file = path if path.is_file() else next(file for file in path.iterdir() if file.suffix != ".yaml")
    cut = tmp_path / file.name
    cut.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    with pytest.raises(DatasetError):
        list(Bag([cut]))


@pytest.mark.parametrize("other", [b"uint32 point_stop", b"string point_step"])
def test_a_bag_that_defines_messages_otherwise_is_one_sentence(other: bytes, tmp_path: Path) -> None:
    (file,) = write_bag(tmp_path / "drive", "mcap", FRAMES[:1]).glob("*.mcap")
    content = file.read_bytes()
    assert b"uint32 point_step" in content
    file.write_bytes(content.replace(b"uint32 point_step", other))
    with pytest.raises(DatasetError, match=r"defines sensor_msgs/msg/PointCloud2 without point_step, or differently"):
        Bag([file])


def test_points_in_rows_with_something_behind_them(tmp_path: Path) -> None:
    bag = BagWriter(tmp_path / "a", "mcap")
    message = bag.cloud(FRAMES[0].points[:60], 1.0)
    data = np.concatenate([np.concatenate([row, np.full(8, 255, np.uint8)]) for row in message.data.reshape(3, -1)])
    rows = replace(message, height=3, width=20, row_step=20 * 32 + 8, data=data)
    assert_array_equal(columns_of(rows)["x"], FRAMES[0].points[:60, 0])


@pytest.mark.parametrize("quaternion", [(0.0, 0.0, 0.0, 0.0), (np.nan, 0.0, 0.0, 1.0), (np.inf, 0.0, 0.0, 1.0)])
def test_a_transform_that_is_none_is_left_out_as_ros_does(quaternion: tuple[float, ...], tmp_path: Path) -> None:
    bag, frame = BagWriter(tmp_path / "broken", "mcap"), make_frame(0)
    transforms = bag.transforms(frame.camera_from_lidar)
    rotation = bag.make("geometry_msgs/msg/Quaternion", **dict(zip("xyzw", quaternion, strict=True)))
    object.__setattr__(transforms.transforms[0].transform, "rotation", rotation)
    bag.write("/tf_static", transforms, 1.0)
    bag.write("/cam/camera_info", bag.info(frame, "plumb_bob", [0.0] * 5), 1.0)
    bag.write("/cam/image_raw", bag.raw(frame.image, "rgb8", 2.0), 2.0)
    bag.write("/points", bag.cloud(frame.points, 2.01), 2.01)
    with pytest.raises(DatasetError, match=r"without cam_optical \(a quaternion of length 0, or a number that is not"):
        Bag([bag.close()])


def test_scans_of_livox_s_drivers_are_read(tmp_path: Path) -> None:
    for kind, package in (("ros1", "livox_ros_driver"), ("sqlite3", "livox_ros_driver2"), ("mcap", "livox_interfaces")):
        bag = BagWriter(tmp_path / f"drive-{kind}{'.bag' if kind == 'ros1' else ''}", kind)
        bag.write_all_but_points(FRAMES[0], 10.0)
        bag.write("/livox/lidar", bag.livox(FRAMES[0].points, 10.0, package), 10.0)
        (frame,) = Bag([bag.close()])
        assert_array_equal(frame.points[:, :3], FRAMES[0].points[:, :3])
        assert_allclose(frame.points[:, 3], np.floor(FRAMES[0].points[:, 3] * 255) / 255, atol=1e-6)


def test_clocks_that_differ_are_paired_by_recording_time_on_request(tmp_path: Path) -> None:
    """The scanner counts from its start, as an Ouster does by default."""
    bag = BagWriter(tmp_path / "drive", "mcap")
    for number, frame in enumerate(FRAMES):
        bag.write_all_but_points(frame, 1000.0 + number)
        bag.write("/points", bag.cloud(frame.points, 7.0 + number), 1000.04 + number)
    path = bag.close()
    with pytest.raises(DatasetError, match=r"the nearest is 99\d,\d{3} ms away; .*, --by-recording-time"):
        Bag([path])
    found = Bag([path], BagOptions(by_recording_time=True))
    for frame, expected in zip(found, FRAMES, strict=True):
        assert_array_equal(frame.points[:, :3], expected.points[:, :3])
    assert found.notes[1].endswith("trust standstills only.")


def test_packets_of_a_scanner_have_to_be_unpacked(tmp_path: Path) -> None:
    bag = BagWriter(tmp_path / "drive", "mcap")
    bag.types.register(get_types_from_msg("std_msgs/Header header\n", "velodyne_msgs/msg/VelodyneScan"))
    bag.write_all_but_points(FRAMES[0], 10.0)
    packets = bag.make("velodyne_msgs/msg/VelodyneScan", header=bag.header(10.0, "velodyne"))
    bag.write("/velodyne_packets", packets, 10.0)
    with pytest.raises(DatasetError, match=r"only a scanner's packets in /velodyne_packets; play it with the scanner"):
        Bag([bag.close()])
