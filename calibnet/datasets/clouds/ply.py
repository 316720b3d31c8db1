"""Point clouds in ``.ply``, as text or binary, with the vertices first; read without a native library."""

from __future__ import annotations

import numpy as np

from calibnet.datasets.clouds.columns import CloudError, Column, Columns, from_rows, from_text, whole_number

HEADER_BYTES = 64 * 1024
TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
BYTE_ORDERS = {"ascii": "<", "binary_little_endian": "<", "binary_big_endian": ">"}


def read_ply(data: bytes) -> Columns:
    """The columns of the vertices of a ``.ply`` file.

    Raises:
        CloudError: the header cannot be read, the vertices do not come first, or the data does not match it.
    """
    lines, start = _header(data)
    form = next((words[1] for words in lines if words[0] == "format" and len(words) > 1), "")
    if form not in BYTE_ORDERS:
        raise CloudError(f"its PLY header has format {form[:40]!r} instead of one of {', '.join(BYTE_ORDERS)}")
    elements = [place for place, words in enumerate(lines) if words[0] == "element"]
    if not elements or len(lines[elements[0]]) != 3 or lines[elements[0]][1] != "vertex":
        raise CloudError("its first PLY element is not 'vertex'; write the points first")
    first, alone = elements[0], len(elements) == 1
    last = len(lines) if alone else elements[1]
    columns = [_column(words, BYTE_ORDERS[form]) for words in lines[first + 1 : last] if words[0] == "property"]
    points = whole_number(lines[first][2])
    if form == "ascii":
        return from_text(data[start:], columns, points, alone)
    return from_rows(memoryview(data)[start:], columns, points, alone)


def _header(data: bytes) -> tuple[list[list[str]], int]:
    """Words of every header line, and the offset of the data."""
    lines: list[list[str]] = []
    start = 0
    while not lines or lines[-1] != ["end_header"]:
        end = data.find(b"\n", start, HEADER_BYTES)
        if end < 0 or (lines and lines[0] != ["ply"]):
            raise CloudError("it has no valid PLY header")
        words = data[start:end].decode("ascii", "replace").split()
        start = end + 1
        if words and words[0] not in ("comment", "obj_info"):
            lines.append(words)
    return lines, start


def _column(words: list[str], order: str) -> Column:
    if len(words) != 3 or words[1] not in TYPES:
        raise CloudError(f"its PLY header has the unsupported property {' '.join(words[1:])[:60]!r}")
    return Column(words[2].lower(), np.dtype(order + TYPES[words[1]]))
