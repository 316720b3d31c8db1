"""Every input of the table ends as its row says: with one sentence, in time, in memory, and nothing is lost."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.hostile.rows import Row
from tests.hostile.table import ROWS, prepared
from tests.hostile.tried import GIGABYTES, try_row


@pytest.fixture(scope="module", autouse=True)
def around() -> Iterator[None]:
    with prepared():
        yield


def test_no_row_has_the_name_of_another() -> None:
    assert len({row.what for row in ROWS}) == len(ROWS)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.what)
def test_an_input_ends_as_its_row_says(row: Row, tmp_path: Path) -> None:
    outcome = try_row(row, tmp_path)
    assert outcome.verdict(row) == "as it should", outcome.said
    assert outcome.megabytes < 1000 * GIGABYTES
