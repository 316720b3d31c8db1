"""A piece of a bag is unpacked up to a bound, whatever it is packed with."""

from __future__ import annotations

import bz2
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import lz4.frame
import pytest
from rosbags.rosbag1.reader import decompressors
from rosbags.rosbag2 import reader
from rosbags.rosbag2.storage_mcap import DECOMPRESSORS

from calibnet.datasets.bag import unpacking
from calibnet.datasets.bag.recording import BagRecording
from calibnet.errors import DatasetError
from tests.support.bags import write_bag
from tests.support.fakes import make_frame

zstd = vars(reader)["zstd"]
Pack = Callable[[bytes], bytes]
PACKERS: dict[str, tuple[Pack, Pack]] = {
    "ROS 1, bz2": (bz2.compress, lambda data: decompressors["bz2"](data)),
    "ROS 1, lz4": (lz4.frame.compress, lambda data: decompressors["lz4"](data)),
    "MCAP, lz4": (lz4.frame.compress, lambda data: DECOMPRESSORS["lz4"](data, 0)),
    "MCAP, zstd": (zstd.compress, lambda data: DECOMPRESSORS["zstd"](data, 0)),
    "a message, zstd": (zstd.compress, lambda data: zstd.decompress(data)),
}


@pytest.mark.parametrize("name", PACKERS)
def test_pieces_are_unpacked_up_to_a_bound(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(unpacking, "STEP_BYTES", 1 << 16)
    monkeypatch.setattr(unpacking, "LARGEST_BYTES", 1 << 21)
    unpacking.bound_unpacking()
    pack, unpack = PACKERS[name]
    content = bytes(range(256)) * 4000
    assert unpack(pack(content)) == content
    assert unpack(pack(b"")) == b""
    with pytest.raises(ValueError, match="unpacks to more than 2 MB"):
        unpack(pack(bytes(3 << 20)))
    with pytest.raises(ValueError, match="truncated"):
        unpack(pack(content)[:-20])


@pytest.fixture
def packed_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A ROS 2 bag whose file is packed as a whole, and a folder of its own for temporary files."""
    bag = write_bag(tmp_path / "bag", "sqlite3", [make_frame()])
    (file,) = bag.glob("*.db3")
    pack(file, file.read_bytes())
    metadata = bag / "metadata.yaml"
    text = metadata.read_text().replace(file.name, f"{file.name}.zstd")
    for key, value in (("format", "zstd"), ("mode", "FILE")):
        text = text.replace(f"compression_{key}: ''", f"compression_{key}: {value}")
    metadata.write_text(text)
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    return bag


def pack(file: Path, content: bytes) -> None:
    file.with_suffix(".db3.zstd").write_bytes(zstd.compress(content))
    file.unlink(missing_ok=True)


def test_a_bag_that_is_packed_as_a_whole_is_read(packed_whole: Path) -> None:
    assert BagRecording([packed_whole]).message("/points").content.width == 6000


def test_it_is_unpacked_up_to_a_bound_and_leaves_nothing(packed_whole: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(unpacking, "LARGEST_BYTES", 1 << 20)
    pack(packed_whole / "bag.db3", bytes(64 << 20))
    with pytest.raises(DatasetError, match=r"unpacks to more than 1 MB\)"):
        BagRecording([packed_whole])
    assert not list(Path(tempfile.gettempdir()).iterdir())


def test_it_is_not_unpacked_to_a_full_disk(packed_whole: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=unpacking.RESERVE_BYTES + 1000))
    with pytest.raises(DatasetError, match=r"more than 0 MB, the space available in .*temporary"):
        BagRecording([packed_whole])
