"""What a fuzzer found its way to ends in an error of ours, or in none."""

from __future__ import annotations

import pytest

from tests import fuzz

TARGETS = [name for name in fuzz.TARGETS if fuzz.kept(name)]


def test_every_folder_of_inputs_is_of_a_target() -> None:
    assert {path.name for path in fuzz.KEPT.iterdir()} == {name.replace(" ", "-") for name in TARGETS}


@pytest.mark.parametrize("target", TARGETS)
def test_kept_inputs_end_as_all_should(target: str) -> None:
    for data in fuzz.kept(target):
        fuzz.try_one(target, data)
