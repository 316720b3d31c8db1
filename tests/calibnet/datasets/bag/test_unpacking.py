"""A piece of a bag is unpacked up to a bound, whatever it is packed with."""

from __future__ import annotations

import bz2
from collections.abc import Callable

import lz4.frame
import pytest
from rosbags.rosbag1.reader import decompressors
from rosbags.rosbag2 import reader
from rosbags.rosbag2.storage_mcap import DECOMPRESSORS

from calibnet.datasets.bag import unpacking

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
    with pytest.raises(ValueError, match="cut short"):
        unpack(pack(content)[:-20])
