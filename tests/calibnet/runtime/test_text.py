"""Foreign text stays one text wherever it is shown."""

from __future__ import annotations

import os

import pytest

from calibnet.runtime.text import listed, one_line, quoted_lines


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("Straße 7, 前方", "Straße 7, 前方"),
        ("a\nTr: 1 0 0", r"a\nTr: 1 0 0"),
        ("\x1b[2Jgone", r"\x1b[2Jgone"),
        ("a\u2028b", r"a\u2028b"),
        ("\u202egnp.exe", r"\u202egnp.exe"),
        (os.fsdecode(b"caf\xe9"), r"caf\xe9"),
        ("bell\x07", r"bell\x07"),
    ],
)
def test_what_cannot_be_printed_is_escaped(text: str, shown: str) -> None:
    assert one_line(text) == shown
    assert one_line(text).isprintable()


def test_a_long_text_loses_its_middle() -> None:
    short = one_line("-" + 5000 * "9", longest=100)
    assert short.startswith("-99")
    assert short.endswith("99")
    assert len(short) == 103


def test_our_own_lines_stay_lines() -> None:
    assert quoted_lines("one\ntwo\x1b[0m") == "one\ntwo\\x1b[0m"


def test_a_sentence_lists_no_thousand_items() -> None:
    assert listed([3, 5, 9]) == "3, 5, 9"
    assert listed(range(4541)) == "0, 1, 2, 3, 4, 5, 6, 7, 8, 9 and 4531 more"
