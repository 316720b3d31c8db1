"""What a recording's bytes go to."""

from __future__ import annotations

from pathlib import Path

import pytest

from inspector import entities
from inspector.read.sizes import group_of, sizes_by_group
from inspector.record.tabs import cascade, cost_volumes, hourglass


def test_the_groups_add_up_to_the_file(full_recording: Path) -> None:
    sizes = sizes_by_group(full_recording)
    assert set(sizes) == {
        "image", "overlays", "3D scene", "raw volumes", "hourglass", "cost-volume maps", "figures and legends"
    }  # fmt: skip
    assert list(sizes.values()) == sorted(sizes.values(), reverse=True)
    assert 0.7 * full_recording.stat().st_size < sum(sizes.values()) < full_recording.stat().st_size


@pytest.mark.parametrize(
    ("entity", "group"),
    [
        (entities.of_scale(3, 8, cost_volumes.SLICE_MARKS), "raw volumes"),
        (entities.of_scale(3, 8, cost_volumes.WINDOW_TRUTH), "cost-volume maps"),
        (cascade.displacement_arrows(3), "cost-volume maps"),
        (entities.of_scale(3, 8, hourglass.AFTER), "hourglass"),
        (entities.TABLE, "figures and legends"),
    ],
)
def test_an_entity_has_its_group(entity: str, group: str) -> None:
    assert group_of(entity) == group
