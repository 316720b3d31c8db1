"""nuScenes by its tables: scenes, cameras, the car's motion between sweep and image, and tables that are damaged."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from calibnet.datasets import open_sequence
from calibnet.datasets.discovery import find_sequences
from calibnet.datasets.nuscenes.tables import records
from calibnet.errors import DatasetError
from tests.calibnet.datasets.conftest import small_turn
from tests.calibnet.datasets.published import CAR_FROM_LIDAR, THEIRS_FROM_OURS, rigid, write_nuscenes


def test_only_the_keyframes_of_a_scene_are_read(write_layout):
    layout = write_layout("nuscenes")
    sequence = layout.open()
    assert sequence.name == "nuscenes/scene-0103" and len(sequence) == 3
    assert [round(frame.timestamp, 6) for frame in sequence] == [0.0, 0.5, 1.0]
    assert sequence.notes == ("Scans are moved to the time of their images, by up to 40 ms of the car's motion.",)
    assert open_sequence("nuscenes", layout.root, scene="103").name == "nuscenes/scene-0103"
    assert [one.name for one in find_sequences("nuscenes", layout.root, "scene-0103")] == ["nuscenes/scene-0103"]


def test_points_are_taken_to_where_they_were_when_the_image_was_taken(tmp_path):
    """A point that stands in the world is seen from where the car is by then."""
    world_from_car = rigid(small_turn(0.7, 2), [400.0, 1100.0, 0.0])
    car_moved = rigid(small_turn(0.02, 2), [0.6, 0.01, 0.0])
    layout = write_nuscenes(tmp_path, world_from_car @ car_moved)
    frame = layout.open()[1]
    standing = np.column_stack([layout.points[1][:, :3], np.ones(200)])
    world_from_lidar = world_from_car @ CAR_FROM_LIDAR @ THEIRS_FROM_OURS
    later_from_world = np.linalg.inv(world_from_car @ car_moved @ CAR_FROM_LIDAR @ THEIRS_FROM_OURS)
    expected = standing @ (later_from_world @ world_from_lidar).T
    assert_allclose(frame.points[:, :3], expected[:, :3], atol=2e-4)
    assert np.linalg.norm(frame.points[:, :3] - layout.points[1][:, :3], axis=1).min() > 0.1
    taken = layout.open(compensate=False)[1]
    np.testing.assert_array_equal(taken.points, layout.points[1])


def test_without_tables_of_scenes_everything_is_one_sequence(write_layout):
    layout = write_layout("nuscenes")
    for name in ("scene", "sample"):
        (layout.root / "v1.0-mini" / f"{name}.json").unlink()
    sequence = open_sequence("nuscenes", layout.root)
    assert sequence.name == "nuscenes/all" and len(sequence) == 4, "the other scene's frame among them"
    with pytest.raises(DatasetError, match=r"has no scene\.json and sample\.json"):
        layout.open()


def test_what_is_not_there_is_named(write_layout, tmp_path):
    layout = write_layout("nuscenes")
    with pytest.raises(DatasetError, match="has no scene 'scene-0001'; scenes there: scene-0061, scene-0103"):
        layout.open(scene="1")
    with pytest.raises(
        DatasetError, match="no keyframe of CAM_BACK and LIDAR_TOP in scene-0103; cameras of all scenes: CAM_FRONT"
    ):
        layout.open(camera="CAM_BACK")
    with pytest.raises(DatasetError, match="has no tables; unpack nuScenes's metadata"):
        open_sequence("nuscenes", tmp_path)
    poses = layout.root / "v1.0-mini" / "ego_pose.json"
    poses.write_text(json.dumps(json.loads(poses.read_text())[1:]))
    with pytest.raises(DatasetError, match="lacks 1 of 6 poses, lidar0 among them"):
        layout.open()


def test_a_file_outside_of_the_root_is_not_read(write_layout):
    layout = write_layout("nuscenes")
    table = layout.root / "v1.0-mini" / "sample_data.json"
    content = json.loads(table.read_text())
    content[1]["filename"] = "../../secret.png"
    table.write_text(json.dumps(content))
    with pytest.raises(DatasetError, match=r"names \.\./\.\./secret\.png, which is outside"):
        layout.open()


DAMAGED = ["", "{}", "[1]", '[{"a": 1}', '[{"a": 1},', '[{"a": }]', "[" * 100_000, "[\xff"]


@pytest.mark.parametrize("text", DAMAGED, ids=range(len(DAMAGED)))
def test_a_damaged_table_is_one_sentence(tmp_path: Path, text: str):
    (tmp_path / "scene.json").write_bytes(text.encode("latin-1"))
    with pytest.raises(DatasetError, match=r"scene\.json (is damaged|cannot be read)"):
        list(records(tmp_path, "scene"))


def test_a_long_table_is_read_record_by_record(tmp_path: Path):
    rows = [{"token": f"{number:08d}", "text": "ä" * 50} for number in range(12_000)]
    (tmp_path / "sample.json").write_text(json.dumps(rows, indent=0, ensure_ascii=False), encoding="utf-8")
    assert list(records(tmp_path, "sample")) == rows
    (tmp_path / "scene.json").write_text("[]")
    assert list(records(tmp_path, "scene")) == []
