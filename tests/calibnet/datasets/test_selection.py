"""Frames by text."""

from __future__ import annotations

import pytest

from calibnet.datasets import select_frames
from calibnet.errors import ConfigError, DatasetError


@pytest.mark.parametrize(
    ("text", "positions"),
    [
        (":", [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]),
        ("0:100:5", [0, 5]),
        ("2:4", [2, 3]),
        ("8:", [8, 9]),
        ("-2:", [8, 9]),
        ("::4", [0, 4, 8]),
        ("::-4", [9, 5, 1]),
        ("7", [7]),
        ("-1", [9]),
        (" 3:5 ", [3, 4]),
    ],
)
def test_slices_of_ten_frames(text, positions):
    assert select_frames(range(10), text) == positions


@pytest.mark.parametrize("text", ["", "a", "1:2:3:4", "0.5", "1,2", "5:x", "1 2", "0:5:0", "٣x"])
def test_malformed_text(text):
    with pytest.raises(ConfigError, match="0:100:5"):
        select_frames(range(10), text)


@pytest.mark.parametrize("text", ["10", "-11", "10:", "5:5", "5:2"])
def test_nothing_selected(text):
    with pytest.raises(DatasetError, match=r"choose from its 10 frames \(0 to 9\)"):
        select_frames(range(10), text)
