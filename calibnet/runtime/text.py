"""Quotes foreign text, such as names of files or content of recordings, wherever it leaves the program.

A folder may be called ``a⏎Tr: 1 0 0``, and a recording's title may contain escape sequences. On a terminal, in a
comment of a file or in an XML attribute, such text would be interpreted.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from urllib.parse import quote

LONGEST = 2000
"""Largest number of characters of a text that are shown."""
MOST_LISTED = 10
"""Largest number of items that a sentence lists."""
LONGEST_NAME = 100
"""Largest number of characters of a file name made from foreign text."""


def one_line(text: object, longest: int = LONGEST) -> str:
    """A text as one printable line, in which unprintable characters are escaped.

    Args:
        text: any object, converted by ``str``.
        longest: largest number of characters; a longer text loses its middle.
    """
    plain = str(text)
    if len(plain) > longest:
        plain = f"{plain[: longest // 2]} … {plain[-longest // 2 :]}"
    if plain.isprintable():
        return plain
    return "".join(one if one.isprintable() else _escaped(one) for one in plain)


def quoted_lines(text: object) -> str:
    """Do the same for each line of a text whose line breaks are our own."""
    return "\n".join(one_line(line, 10 * LONGEST) for line in str(text).split("\n"))


def number_of(count: int, noun: str) -> str:
    """A number and a noun, such as ``"1 drive"`` or ``"2 drives"``."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def listed(items: Sequence[object], most: int = MOST_LISTED) -> str:
    """Items with commas; of many, the first ones and how many more there are."""
    shown = ", ".join(map(str, items[:most]))
    return shown if len(items) <= most else f"{shown} and {len(items) - most} more"


def file_name(text: str) -> str:
    """Foreign text as the name of one file or folder: without separators, not hidden, at most 100 characters.

    Different texts have different names.
    """
    quoted = quote(text, safe=" ()+,=@", errors="surrogatepass")
    quoted = f"%2E{quoted[1:]}" if quoted.startswith(".") else quoted
    if 0 < len(quoted) <= LONGEST_NAME:
        return quoted
    mark = hashlib.sha256(text.encode(errors="surrogatepass")).hexdigest()[:16]
    return f"{quoted[: LONGEST_NAME - 17]}~{mark}"


def _escaped(character: str) -> str:
    """A character as Python escapes it, for instance a backslash and ``n``; a byte that is not UTF-8 by its value."""
    if "\udc80" <= character <= "\udcff":
        return f"\\x{ord(character) - 0xDC00:02x}"
    return character.encode("unicode_escape").decode("ascii")
