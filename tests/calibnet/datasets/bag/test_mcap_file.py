"""MCAP files that no ROS 2 recorded, as frames."""

from __future__ import annotations

from pathlib import Path

import pytest

from calibnet.conformance import check_dataset
from calibnet.datasets.bag import Bag
from calibnet.errors import DatasetError
from tests.support.bags import assert_holds, write_frames
from tests.support.fakes import make_frame
from tests.support.foreign_mcap import ForeignMcap, Rewritten, image_of, write_foxglove

FRAMES = [make_frame(number, width=128, height=48, points=3000) for number in range(3)]


def written(path: Path, encoding: str) -> Path:
    if encoding in ("json", "protobuf"):
        return write_foxglove(path, encoding, FRAMES)
    return write_frames(Rewritten(path, encoding), FRAMES)


@pytest.mark.parametrize("encoding", ["ros1", "cdr", "json", "protobuf"])
def test_frames_are_those_that_were_recorded(encoding: str, tmp_path: Path) -> None:
    path = written(tmp_path / "drive.mcap", encoding)
    check_dataset(lambda: Bag([path]))
    bag = Bag([path])
    assert_holds(bag, FRAMES)


@pytest.mark.parametrize("encoding", ["json", "protobuf"])
def test_a_file_whose_summary_has_no_channels(encoding: str, tmp_path: Path) -> None:
    bag = ForeignMcap(tmp_path / "drive.mcap", encoding, summary=False)
    assert_holds(Bag([write_foxglove(bag.path, encoding, FRAMES, bag)]), FRAMES)


def test_a_file_that_was_cut_is_one_sentence(tmp_path: Path) -> None:
    path = written(tmp_path / "drive.mcap", "protobuf")
    whole = path.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: whole.rindex(b"/lidar")])
    with pytest.raises(DatasetError, match="cannot be read"):
        Bag([tmp_path / "cut.mcap"])


def test_points_that_lie_elsewhere_in_their_frame_are_refused(tmp_path: Path) -> None:
    pose = {"position": {"x": 0.0, "y": 0.0, "z": 1.2}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
    path = write_foxglove(tmp_path / "drive.mcap", "json", FRAMES, pose=pose)
    with pytest.raises(DatasetError, match="a pose within their frame"):
        Bag([path])


def test_several_are_to_be_joined(tmp_path: Path) -> None:
    path = written(tmp_path / "drive.mcap", "json")
    with pytest.raises(DatasetError, match="have to be joined first: mcap merge"):
        Bag([path, path])


def test_what_is_missing_is_listed(tmp_path: Path) -> None:
    bag = ForeignMcap(tmp_path / "drive.mcap", "json")
    bag.write("/cam/image", "CompressedImage", image_of(FRAMES[0], 1.0), 1.0)
    with pytest.raises(DatasetError, match=r"no point clouds; there are: /cam/image \(1 CompressedImage\)"):
        Bag([bag.close()])


@pytest.mark.parametrize("encoding", ["ros1", "cdr"])
def test_messages_of_ros_that_are_defined_otherwise_are_one_sentence(encoding: str, tmp_path: Path) -> None:
    path = written(tmp_path / "drive.mcap", encoding)
    content = path.read_bytes()
    assert b"uint32 point_step" in content
    path.write_bytes(content.replace(b"uint32 point_step", b"uint32 point_stop"))
    with pytest.raises(DatasetError, match=r"defines sensor_msgs/msg/PointCloud2 without point_step"):
        Bag([path])
