from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
import pytest

from calibnet.training import synthetic_pool
from calibnet.training.synthetic_pool import SyntheticPool, version_of
from tests.support.scene import make_frame


def test_scenes_are_rendered_once_and_read_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from calibnet.datasets import synthetic

    drawn: list[int] = []

    def sample_frame(seed: int) -> object:
        drawn.append(seed)
        return make_frame(seed % 10)

    monkeypatch.setattr(synthetic, "sample_frame", sample_frame)
    pool = SyntheticPool(5, 2, tmp_path)
    first, again = pool[2], SyntheticPool(5, 2, tmp_path)[2]
    assert drawn == [2_000_002] and len(pool) == 5
    assert np.array_equal(first.image, again.image) and np.array_equal(first.points, again.points)
    assert np.array_equal(first.camera_from_lidar, again.camera_from_lidar)
    assert np.array_equal(first.camera.matrix, again.camera.matrix)
    assert (again.camera.width, again.camera.height) == (first.camera.width, first.camera.height)


@pytest.mark.parametrize("keep", [0, 10, 3000, -1])
def test_a_scene_cut_short_is_drawn_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, keep: int) -> None:
    from calibnet.datasets import synthetic

    monkeypatch.setattr(synthetic, "sample_frame", lambda seed: make_frame(1))
    pool = SyntheticPool(5, 2, tmp_path)
    expected = pool[0].points
    (file,) = tmp_path.iterdir()
    file.write_bytes(file.read_bytes()[:keep])
    assert np.array_equal(pool[0].points, expected)


def bomb(path: Path) -> None:
    """Half a megabyte that unpacks to 500 MB."""
    with ZipFile(path, "w", ZIP_DEFLATED, compresslevel=9) as file:
        file.writestr("image.npy", bytes(500 << 20))


@pytest.mark.parametrize(
    "put",
    [
        os.mkfifo,
        lambda path: path.symlink_to("/dev/zero"),
        lambda path: path.symlink_to("nowhere"),
        bomb,
        lambda path: np.savez(path, image=np.zeros((4, 4)), points=np.zeros((2, 4))),
        lambda path: np.savez(path, image=np.zeros((4, 4, 3), np.uint8), points=np.array([print], object)),
    ],
)
def test_what_is_no_scene_gives_way_to_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, put: Callable[[Path], object]
) -> None:
    """The cache lies in a folder that others can write to."""
    from calibnet.datasets import synthetic

    monkeypatch.setattr(synthetic, "sample_frame", lambda seed: make_frame(1))
    pool = SyntheticPool(5, 2, tmp_path)
    expected = pool[0].points
    (file,) = tmp_path.iterdir()
    file.unlink()
    put(file)
    assert np.array_equal(pool[0].points, expected)
    assert file.is_file() and not file.is_symlink()


def test_one_scene_of_four_is_a_robots(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from calibnet.datasets import synthetic

    drawn: list[tuple[str, int]] = []
    for name in ("sample_frame", "sample_robot_frame"):
        monkeypatch.setattr(synthetic, name, lambda seed, name=name: drawn.append((name, seed)) or make_frame(1))
    list(SyntheticPool(8, 2, tmp_path))
    assert [seed for name, seed in drawn if name == "sample_robot_frame"] == [2_000_003, 2_000_007]
    assert len(drawn) == 8


def test_scenes_of_another_world_are_rendered_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from calibnet.datasets import synthetic

    drawn: list[int] = []
    monkeypatch.setattr(synthetic, "sample_frame", lambda seed: drawn.append(seed) or make_frame(1))
    for version, expected in (("old", 1), ("old", 1), ("new", 2), ("old", 2)):
        monkeypatch.setattr(synthetic_pool, "world_version", lambda version=version: version)
        SyntheticPool(5, 2, tmp_path)[0]
        assert len(drawn) == expected


def test_the_version_of_the_world_changes_with_its_code_and_not_with_its_comments() -> None:
    code = {"a.py": "def wall(height):\n    return 2 * height\n", "b.py": "TALL = 3\n"}
    commented = code | {"a.py": 'def wall(height):\n    """Twice."""\n    return 2 * height  # metres\n'}
    changed = code | {"a.py": code["a.py"].replace("2", "3")}
    assert version_of(commented) == version_of(code) != version_of(changed)
    assert version_of(code) != version_of({"b.py": code["a.py"], "a.py": code["b.py"]})
    assert len(synthetic_pool.world_version()) == 8
