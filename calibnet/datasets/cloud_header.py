"""Whether a ``.pcd`` or ``.ply`` file holds as many values as its header promises."""

from __future__ import annotations

from pathlib import Path

from calibnet.errors import DatasetError

_PLY_BYTES = {
    **dict.fromkeys(("char", "uchar", "int8", "uint8"), 1),
    **dict.fromkeys(("short", "ushort", "int16", "uint16"), 2),
    **dict.fromkeys(("int", "uint", "float", "int32", "uint32", "float32"), 4),
    **dict.fromkeys(("double", "float64"), 8),
}


def check_complete(path: Path) -> None:
    """Compare the data of a cloud with its header.

    Raises:
        DatasetError: the file cannot be read, has no such header, or ends early.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise DatasetError(f"Scan {path} cannot be read ({error.strerror}); restore it.") from None
    layout = _pcd_layout if path.suffix.lower() == ".pcd" else _ply_layout
    try:
        text, points, values, point_bytes, start = layout(data)
    except (KeyError, ValueError, IndexError):
        kind = path.suffix[1:].upper()
        raise DatasetError(f"Scan {path} has no {kind} header that can be read; write it again as {kind}.") from None
    complete = len(data[start:].split()) >= points * values if text else len(data) - start >= points * point_bytes
    if not complete:
        raise DatasetError(f"Scan {path} is truncated: its header promises {points} points; write or copy it again.")


def _pcd_layout(data: bytes) -> tuple[bool, int, int, int, int]:
    """Whether the data is text, points, values a point, bytes a point (0: compressed), data offset."""
    start = data.index(b"\n", data.index(b"\nDATA") + 1) + 1
    lines = (line.split() for line in data[:start].decode("ascii", "replace").splitlines())
    header = {words[0]: words[1:] for words in lines if words}
    counts = [int(count) for count in header.get("COUNT", ["1"] * len(header["FIELDS"]))]
    sizes = [int(size) for size in header["SIZE"]]
    form = header["DATA"][0].lower()
    point_bytes = sum(c * s for c, s in zip(counts, sizes, strict=True)) if form == "binary" else 0
    return form == "ascii", int(header["POINTS"][0]), sum(counts), point_bytes, start


def _ply_layout(data: bytes) -> tuple[bool, int, int, int, int]:
    """The same for the vertices of a PLY file, which come first where scans are stored."""
    start = data.index(b"\n", data.index(b"end_header")) + 1
    header = [line.split() for line in data[:start].decode("ascii", "replace").splitlines()]
    if header[0] != ["ply"]:
        raise ValueError("not a PLY file")
    elements = [index for index, words in enumerate(header) if words[:1] == ["element"]]
    first, end = elements[0], (elements[1:] or [len(header)])[0]
    if header[first][1] != "vertex":
        return True, 0, 0, 0, start  # another element comes first: its size is not known, Open3D decides
    sizes = [_PLY_BYTES[words[1]] for words in header[first:end] if words[:1] == ["property"]]
    form = next(words[1] for words in header if words[:1] == ["format"])
    return form == "ascii", int(header[first][2]), len(sizes), sum(sizes), start
