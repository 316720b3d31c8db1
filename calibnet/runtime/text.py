"""Foreign text (names of files, words of a recording) quoted where it leaves the program, so that it stays one text.

A folder may be called ``a⏎Tr: 1 0 0`` and a recording's title may hold the escape sequences of a terminal. On a
terminal, in a comment of a file or in an attribute of XML such text would be read as content.
"""

from __future__ import annotations

import hashlib
from urllib.parse import quote

LONGEST = 2000
"""Characters of a text that are shown; the rest says nothing more to a reader."""
LONGEST_NAME = 100
"""Characters of a file's name that is made from foreign text."""


def one_line(text: object, longest: int = LONGEST) -> str:
    """A text in one line that a terminal shows as it is: whatever cannot be printed is written as an escape.

    Args:
        text: anything; its ``str`` is taken.
        longest: characters that are kept; a longer text loses its middle.
    """
    plain = str(text)
    if len(plain) > longest:
        plain = f"{plain[: longest // 2]} … {plain[-longest // 2 :]}"
    if plain.isprintable():
        return plain
    return "".join(one if one.isprintable() else _escaped(one) for one in plain)


def lines(text: object) -> str:
    """The same of a text whose lines are our own: what stands between newlines is quoted."""
    return "\n".join(one_line(line, 10 * LONGEST) for line in str(text).split("\n"))


def number_of(count: int, noun: str) -> str:
    """``"1 drive"``, ``"2 drives"``."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def file_name(text: str) -> str:
    """Foreign text as the name of one file or folder: no separator, nothing hidden, no parent, at most 100 characters.

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
