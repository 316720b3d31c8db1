"""Files of point clouds, byte by byte, to be right or to be damaged."""

from __future__ import annotations

import io

import numpy as np

Values = np.ndarray


def pcd(values: Values, form: str = "binary", fields: str = "x y z intensity", **header: object) -> bytes:
    """A ``.pcd`` of float32 columns; lines of its header can be replaced (``POINTS=7``) or dropped (``COUNT=None``)."""
    names = fields.split()
    lines: dict[str, object] = {
        "VERSION": "0.7",
        "FIELDS": fields,
        "SIZE": " ".join("4" * len(names)),
        "TYPE": " ".join("F" * len(names)),
        "COUNT": " ".join("1" * len(names)),
        "WIDTH": len(values),
        "HEIGHT": 1,
        "VIEWPOINT": "0 0 0 1 0 0 0",
        "POINTS": len(values),
        "DATA": form,
    } | header
    head = "".join(f"{key} {value}\n" for key, value in lines.items() if value is not None)
    values = np.asarray(values, np.float32)
    if form.lower() == "ascii":
        body = _text(values)
    elif form.lower() == "binary_compressed":
        raw = values.T.tobytes()
        packed = pack_lzf(raw)
        body = np.array([len(packed), len(raw)], "<u4").tobytes() + packed
    else:
        body = values.tobytes()
    return head.encode() + body


def ply(values: Values, form: str = "binary_little_endian", names: str = "x y z intensity", after: str = "") -> bytes:
    """A ``.ply`` of float32 vertices; ``after`` are further lines of the header."""
    properties = "".join(f"property float {name}\n" for name in names.split())
    head = f"ply\nformat {form} 1.0\ncomment made\nelement vertex {len(values)}\n{properties}{after}end_header\n"
    order = ">f4" if form == "binary_big_endian" else "<f4"
    body = _text(values) if form == "ascii" else np.asarray(values).astype(order).tobytes()
    return head.encode() + body


def npy(array: Values) -> bytes:
    """A ``.npy`` file."""
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def npz(array: Values, **others: Values) -> bytes:
    """A ``.npz`` file of an array of points, and of others."""
    file = io.BytesIO()
    np.savez(file, points=array, **others)  # type: ignore[arg-type]  # numpy's own options come after arrays
    return file.getvalue()


def with_fields(rows: Values) -> Values:
    """Points ``[N, 4]`` as ``ros_numpy`` makes them, with a column of several values."""
    kinds = [("x", "f4"), ("y", "f4"), ("z", "f4"), ("rgb", "u1", 3), ("Intensity", "f4")]
    array = np.zeros(len(rows), np.dtype(kinds))
    for place, name in enumerate(("x", "y", "z", "Intensity")):
        array[name] = rows[:, place]
    return array


def pack_lzf(data: bytes) -> bytes:
    """LZF the simplest way: copies of four zeros or more from just before, and literals."""
    out, place = bytearray(), 0
    while place < len(data):
        run = len(data[place : place + 200]) - len(data[place : place + 200].lstrip(data[place - 1 : place] or b"?"))
        if place and run >= 3:
            length = min(run, 9 + 255) - 2
            out += bytes([length << 5, 0]) if length < 7 else bytes([7 << 5, length - 7, 0])
            place += length + 2
        else:
            literal = data[place : place + 4]
            out += bytes([len(literal) - 1]) + literal
            place += len(literal)
    return bytes(out)


def _text(values: Values) -> bytes:
    return "".join(" ".join(f"{value:.9g}" for value in row) + "\n" for row in np.asarray(values)).encode()
