"""Frames that were packed are the frames that training would have read, but for roundings that are known."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from safetensors import safe_open
from safetensors.torch import load_file, save_file

from calibnet.datasets.frame import Frame
from calibnet.datasets.images.files import decode_image
from calibnet.errors import ConfigError, DatasetError
from calibnet.geometry import RANGES, miscalibration, project
from calibnet.training import packed as packed_module
from calibnet.training import packing
from calibnet.training.build import build
from calibnet.training.data import Source
from calibnet.training.options import TrainingOptions
from calibnet.training.packed import (
    KEY,
    STEPS_PER_METRE,
    packed_residuals,
    read_packed,
    unpack_scan,
)
from calibnet.training.packing import FARTHEST_M, LARGEST_WIDTH, pack_image, pack_scan, pack_training, smaller
from tests.calibnet.training.tiny_run import options, trainer_of
from tests.support.scene import Scenes, make_frame

WHOLE = 2**30
ROUNDED = 0.5 / STEPS_PER_METRE + 1e-6


@pytest.fixture
def pack(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Path]:
    """Pack three scenes of one source and two synthetic ones of another into a folder."""

    def packed(folder: Path, largest: int = WHOLE, seed: int = 0) -> Path:
        sources = [Source(Scenes(3), 0.75), Source(Scenes(2), 0.25, synthetic=True)]
        monkeypatch.setattr(packing, "training_sources", lambda options: (sources, []))
        pack_training(TrainingOptions("tiny", "", "", seed=seed), folder, largest)
        return folder

    return packed


def around(frame: Frame) -> Frame:
    """The frame with points in all directions, as far as scanners reach and beyond."""
    generator = np.random.default_rng(3)
    direction = generator.normal(size=(20_000, 3))
    distance = generator.uniform(2, 200, (20_000, 1))
    points = direction / np.linalg.norm(direction, axis=1, keepdims=True) * distance
    intensity = generator.uniform(size=(20_000, 1))
    return replace(frame, points=np.concatenate([points, intensity], axis=1).astype(np.float32))


def test_points_come_back_rounded_and_in_order() -> None:
    generator = np.random.default_rng(0)
    points = generator.uniform((-127, -127, -127, 0), (127, 127, 127, 1), (5000, 4)).astype(np.float32)
    again = unpack_scan(pack_scan(points))
    assert again.dtype == np.float32 and np.abs(again[:, :3] - points[:, :3]).max() <= ROUNDED + 1e-5
    assert np.abs(again[:, 3] - points[:, 3]).max() <= 0.5 / 255 + 1e-6
    assert unpack_scan(pack_scan(points[:0])).shape == (0, 4)


def test_a_scan_that_is_cut_or_unpacks_without_end_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = pack_scan(np.zeros((1000, 4), np.float32))
    with pytest.raises(ValueError, match="truncated or too large"):
        unpack_scan(whole[:-3])
    monkeypatch.setattr(packed_module, "LARGEST_SCAN", 6999)
    with pytest.raises(ValueError, match="truncated or too large"):
        unpack_scan(whole)


def test_an_image_comes_back_in_its_own_colours() -> None:
    image = make_frame(1).image
    again = decode_image(pack_image(image))
    assert again.shape == image.shape and again.dtype == np.uint8
    difference = again.astype(float) - image
    assert np.sqrt((difference**2).mean()) < 8, "as JPEG has it; red and blue swapped would differ by 60"


def test_what_a_miscalibrated_camera_sees_is_kept_and_what_none_sees_is_not() -> None:
    frame = around(make_frame(2))
    kept = smaller(frame)
    assert 0.05 < len(kept.points) / len(frame.points) < 0.5
    assert np.abs(kept.points[:, :3]).max() < FARTHEST_M
    near = frame.points[(np.abs(frame.points[:, :3]) < FARTHEST_M - 1).all(axis=1)]
    for angles in ([15, 0, 0], [0, -15, 0], [-10, 10, 10]):
        turned = miscalibration(angles, [0, 0, 0]) @ frame.camera_from_lidar
        assert len(project(kept.points, turned, frame.camera).depth) == len(project(near, turned, frame.camera).depth)


def test_a_large_image_is_made_smaller_with_its_camera() -> None:
    frame = make_frame(0, 2 * LARGEST_WIDTH, 500)
    small = smaller(frame)
    assert small.image.shape == (250, LARGEST_WIDTH, 3) and small.camera.width == LARGEST_WIDTH
    assert np.allclose(small.camera.matrix[:2, :2], frame.camera.matrix[:2, :2] / 2)
    assert smaller(make_frame(0)).camera.width == make_frame(0).camera.width


def test_sources_come_back_with_names_weights_and_frames(pack: Callable[..., Path], tmp_path: Path) -> None:
    real, synthetic = read_packed(pack(tmp_path / "packed"))
    assert (real.weight, real.synthetic, len(real.sequence)) == (0.75, False, 3)
    assert (synthetic.weight, synthetic.synthetic, len(synthetic.sequence)) == (0.25, True, 2)
    assert real.sequence.name == Scenes.name
    assert real.sequence.rig == Scenes.rig, "by which the weights are known to know it"
    frames = {round(frame.points[0, 3] * 255): frame for frame in real.sequence}
    for seed in range(3):
        frame = smaller(make_frame(seed))
        again = frames[round(frame.points[0, 3] * 255)]
        assert np.array_equal(again.camera.matrix, frame.camera.matrix)
        assert np.array_equal(again.camera_from_lidar, frame.camera_from_lidar)
        assert np.abs(again.points - frame.points)[:, :3].max() <= ROUNDED


def test_parts_are_bounded_and_each_is_of_use_alone(pack: Callable[..., Path], tmp_path: Path) -> None:
    whole = sum(path.stat().st_size for path in pack(tmp_path / "whole").iterdir())
    folder = pack(tmp_path / "parts", largest=whole // 2)
    parts = sorted(folder.iterdir())
    assert 2 <= len(parts) <= 4 and max(path.stat().st_size for path in parts) < whole // 2 + 2000
    assert sum(len(source.sequence) for source in read_packed(folder)) == 5
    parts[0].unlink()
    left = read_packed(folder)
    assert 1 <= sum(len(source.sequence) for source in left) < 5
    assert all(frame.points.shape[1] == 4 for source in left for frame in source.sequence)


def test_what_is_in_the_folder_already_stays(pack: Callable[..., Path], tmp_path: Path) -> None:
    (path,) = pack(tmp_path).iterdir()
    before = path.read_bytes()
    with pytest.raises(ConfigError, match=f"{tmp_path} holds packed frames already"):
        pack(tmp_path, seed=1)
    assert path.read_bytes() == before


def test_a_run_trains_on_packed_frames_and_says_so(
    pack: Callable[..., Path], tiny_world: Scenes, tmp_path: Path
) -> None:
    pack(tmp_path / "packed")
    tiny_world.reads = 0
    trainer = trainer_of(options(tmp_path / "runs", packed=str(tmp_path / "packed")))
    assert [len(source.sequence) for source in trainer.training.samples.frames.sources] == [3, 2]
    weights = trainer.run()
    with safe_open(weights, "pt") as file:
        record = str(file.metadata())
    assert "packed" in record and str(tmp_path) not in record
    assert tiny_world.reads == 0, "nothing else was read"


def test_packed_frames_and_data_do_not_go_together(
    pack: Callable[..., Path], tiny_world: Scenes, tmp_path: Path
) -> None:
    with pytest.raises(ConfigError, match=r"either --packed.*or --data"):
        build(options(tmp_path / "runs", packed=str(pack(tmp_path / "packed")), data=["folder:here"]))


def test_residuals_travel_with_the_frames(
    pack: Callable[..., Path], tiny_world: Scenes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    left = [miscalibration([angle, 0, 0], [0, 0.1, 0]) for angle in (0.5, 1.0)]
    monkeypatch.setattr(packing, "stages_residuals", lambda *given: {"5/0.5": left, "2/0.2": []})
    monkeypatch.setattr(packing, "training_sources", lambda options: ([Source(Scenes(3), 1.0)], []))
    folder = tmp_path / "packed"
    pack_training(TrainingOptions("tiny", "", "", after="weights"), folder, 40_000)
    assert len(list(folder.iterdir())) > 1
    assert np.allclose(packed_residuals(folder, RANGES[2]), left)
    assert packed_residuals(folder, RANGES[3]) == []
    draws = build(options(tmp_path / "runs", packed=str(folder))).samples.draws
    assert np.allclose(draws.residuals, left) and draws.residual_share == 0.4


@pytest.mark.parametrize("harm", ["cut", "other", "metadata", "missing", "ends"])
def test_damaged_parts_are_named(pack: Callable[..., Path], tmp_path: Path, harm: str) -> None:
    (path,) = pack(tmp_path).iterdir()
    tensors = load_file(path)
    with safe_open(path, "pt") as file:
        about = file.metadata()
    if harm == "cut":
        path.write_bytes(path.read_bytes()[:-100])
    elif harm == "other":
        path.write_bytes(b"no safetensors")
    elif harm == "metadata":
        save_file(tensors, path, metadata={KEY: '[{"name": "a", "weight": -1, "synthetic": false}]'})
    elif harm == "missing":
        save_file({name: tensor for name, tensor in tensors.items() if name != "matrices"}, path, metadata=about)
    else:
        tensors["pictures.ends"][-1] += 1
        save_file(tensors, path, metadata=about)
    with pytest.raises(DatasetError, match=f"{path}.*pack them again") as raised:
        read_packed(tmp_path)
    assert "\n" not in str(raised.value)


def test_a_damaged_image_is_named(pack: Callable[..., Path], tmp_path: Path) -> None:
    (path,) = pack(tmp_path).iterdir()
    tensors = load_file(path)
    with safe_open(path, "pt") as file:
        about = file.metadata()
    tensors["pictures"].zero_()
    save_file(tensors, path, metadata=about)
    (source, _) = read_packed(tmp_path)
    with pytest.raises(DatasetError, match=rf"Frame \d of {path} is damaged"):
        source.sequence[0]


def test_parts_of_two_packings_are_not_mixed(
    pack: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pack(tmp_path)
    monkeypatch.setattr(packing, "training_sources", lambda options: ([Source(Scenes(1), 1.0)], []))
    pack_training(TrainingOptions("tiny", "", ""), tmp_path / "other", WHOLE)
    next((tmp_path / "other").iterdir()).rename(tmp_path / "frames-001.safetensors")
    (tmp_path / "other").rmdir()
    with pytest.raises(DatasetError, match=r"frames-001\.safetensors belongs to another packing"):
        read_packed(tmp_path)


def test_an_empty_folder_says_how_to_fill_it(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=f"No packed training frames are in {tmp_path}.*pack-training"):
        read_packed(tmp_path)


def test_parts_of_versions_that_left_the_rig_out_are_read(pack: Callable[..., Path], tmp_path: Path) -> None:
    (path,) = pack(tmp_path).iterdir()
    with safe_open(path, "pt") as file:
        about = json.loads(file.metadata()[KEY])
    for source in about:
        del source["rig"]
    save_file(load_file(path), path, metadata={KEY: json.dumps(about)})
    assert [source.sequence.rig for source in read_packed(tmp_path)] == [Scenes.name, Scenes.name]
