"""Clouds are read as their headers say, and a header that promises what the bytes do not hold is refused."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from calibnet.datasets.cloud_table import CloudError
from calibnet.datasets.pcd import read_pcd, unpack_lzf
from calibnet.datasets.ply import read_ply
from calibnet.datasets.scans import _READERS, read_scan
from calibnet.errors import DatasetError
from tests.support.clouds import npy, pack_lzf, pcd, ply

VALUES = np.array([[1, 2, 3, 0.5], [4, 5, 6, 0.25], [7, 8, 9, 1], [10, 11, 12, 0]], np.float32)
NAMES = ["x", "y", "z", "intensity"]
FORMS = {"pcd": ("ascii", "binary", "binary_compressed"), "ply": ("ascii", "binary_little_endian", "binary_big_endian")}


@pytest.mark.parametrize(("kind", "form"), [(kind, form) for kind, forms in FORMS.items() for form in forms])
def test_every_form_gives_the_columns_that_were_written(kind: str, form: str) -> None:
    content = pcd(VALUES, form) if kind == "pcd" else ply(VALUES, form)
    columns = read_pcd(content) if kind == "pcd" else read_ply(content)
    assert list(columns) == NAMES
    for name, column in zip(NAMES, VALUES.T, strict=True):
        np.testing.assert_array_equal(columns[name], column)


def test_padding_as_pcl_writes_it() -> None:
    """`_` with COUNT > 1 fills rows; PCL leaves it out of compressed data."""
    header = {"SIZE": "4 4 4 1 4 1", "TYPE": "F F F U F U", "COUNT": "1 1 1 4 1 12"}
    rows = np.zeros((4, 32), np.uint8)
    rows[:, :12] = VALUES[:, :3].copy().view(np.uint8)
    rows[:, 16:20] = VALUES[:, 3:].copy().view(np.uint8)
    content = pcd(VALUES, fields="x y z _ intensity _", **header)
    binary = content[: content.index(b"DATA binary\n") + 12] + rows.tobytes()
    raw = VALUES.T.tobytes()
    packed = pack_lzf(raw)
    head = content[: content.index(b"DATA")] + b"DATA binary_compressed\n"
    compressed = head + np.array([len(packed), len(raw)], "<u4").tobytes() + packed
    for one in (binary, compressed):
        columns = read_pcd(one)
        np.testing.assert_array_equal(np.column_stack([columns[name] for name in NAMES]), VALUES)


def test_types_counts_and_capitals() -> None:
    content = pcd(VALUES, "ASCII", fields="X Y Z ring", TYPE="F F F U", SIZE="8 4 4 2", COUNT=None)
    text = content[: content.index(b"DATA")] + b"DATA ASCII\n" + b"1 2 3 7\n\n4 5 nan 8\n7 8 9 9\n10 11 12 6"
    columns = read_pcd(text)
    np.testing.assert_array_equal(columns["ring"], [7, 8, 9, 6])
    assert np.isnan(columns["z"][1])
    binary = pcd(VALUES, "BINARY")
    np.testing.assert_array_equal(read_pcd(binary)["y"], VALUES[:, 1])


def test_what_follows_the_vertices_of_a_ply_is_left_alone() -> None:
    faces = "element face 2\nproperty list uchar int vertex_indices\n"
    np.testing.assert_array_equal(read_ply(ply(VALUES, after=faces) + b"\3junk")["z"], VALUES[:, 2])
    np.testing.assert_array_equal(read_ply(ply(VALUES, "ascii", after=faces) + b"3 0 1 2\n3 0")["z"], VALUES[:, 2])


TEXT_PCD, TEXT_PLY = pcd(VALUES, "ascii"), ply(VALUES, "ascii")
BINARY, PACKED = pcd(VALUES), pcd(VALUES, "binary_compressed")
REFUSED = {
    "a short line of text": (TEXT_PCD.replace(b"4 5 6 0.25", b"4 5 6"), "point 2 of 4 has 3 numbers instead of 4"),
    "a long line of text": (TEXT_PCD.replace(b"4 5 6", b"4 5 6 7"), "point 2 of 4 has 5 numbers"),
    "a line less": (TEXT_PCD.replace(b"4 5 6 0.25\n", b""), "is truncated"),
    "lines more": (TEXT_PCD + b"1 2 3 4\n5 6 7 8\n9 9 9 9\n", "more than the 4 points"),
    "a word": (TEXT_PCD.replace(b"4 5 6", b"4 five 6"), "point 2 has a 'y' that is no number"),
    "a word in a ply": (TEXT_PLY.replace(b"4 5 6", b"4 five 6"), "point 2 has a 'y' that is no number"),
    "nonsense": (BINARY.replace(b"DATA binary", b"DATA nonsense"), "DATA 'nonsense'"),
    "no data line": (BINARY[: BINARY.index(b"DATA")], "no PCD header"),
    "too many points": (pcd(VALUES, POINTS=5, WIDTH=5), "is truncated"),
    "too few points": (pcd(VALUES, POINTS=2, WIDTH=2), "more than the 2 points"),
    "too many points compressed": (pcd(VALUES, "binary_compressed", POINTS=9, WIDTH=9), "not what its compressed"),
    "a size that disagrees": (pcd(VALUES, WIDTH=3), "promises 4 points and 3 x 1"),
    "a huge count": (pcd(VALUES, POINTS=10**30, WIDTH=10**30), "promises"),
    "a negative count": (pcd(VALUES, POINTS=-4), "'-4' where a whole number"),
    "a fractional size": (pcd(VALUES, SIZE="4 4 4 4.5"), "'4.5' where a whole number"),
    "an unknown type": (pcd(VALUES, TYPE="F F F Q"), "type Q4"),
    "a float of two bytes": (pcd(VALUES, SIZE="2 4 4 4"), "type F2"),
    "fields without sizes": (pcd(VALUES, SIZE=None), "FIELDS, SIZE, TYPE and COUNT"),
    "counts of zero": (pcd(VALUES, COUNT="1 1 1 0"), "columns"),
    "endless rows": (pcd(VALUES, COUNT="1 1 1 99999"), "more than 4096 bytes"),
    "damaged compression": (PACKED[:-20] + b"\xff" * 20, "compressed data is damaged"),
    "cut compression": (PACKED[:-5], "is truncated"),
    "no sizes of compression": (PACKED[: PACKED.index(b"compressed\n") + 14], "is truncated"),
    "faces first": (
        ply(VALUES).replace(b"element vertex", b"element face 1\nproperty int a\nelement vertex"),
        "first PLY element is not 'vertex'",
    ),
    "a list of a vertex": (ply(VALUES).replace(b"property float z", b"property list uchar int z"), "property 'list"),
    "an unknown format": (ply(VALUES, "binary_middle_endian"), "format 'binary_middle_endian'"),
    "no header": (b"ply\n" * 20_000, "no PLY header"),
    "one vertex less": (ply(VALUES)[:-16], "is truncated"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_a_header_promises_is_held_against_the_bytes(what: str, tmp_path: Path) -> None:
    content, words = REFUSED[what]
    file = tmp_path / ("scan.ply" if content.startswith(b"ply") else "scan.pcd")
    file.write_bytes(content)
    with pytest.raises(DatasetError) as caught:
        read_scan(file)
    assert words in str(caught.value)
    assert str(caught.value).startswith(f"Scan {file} cannot be read: ")


@pytest.mark.parametrize(
    "content",
    [
        npy(VALUES)[:-1],
        npy(VALUES) + b"12",
        npy(VALUES).replace(b"(4, 4)", b"(9, 9)"),
        npy(VALUES).replace(b"(4, 4)", b"(4,-4)"),
        npy(VALUES).replace(b"'<f4'", b"'|O' "),
        npy(VALUES).replace(b"'<f4'", b"None "),
        npy(VALUES).replace(b"{", b"["),
        b"\x93NUMPY\x01\x00\xff\xff" + b"(" * 65535,
        b"\x93NUMPY",
        b"\x93NUMPY\x09\x00\x04\x00abcd",
        b"PK\3\4",
    ],
)
def test_arrays_whose_header_lies_are_refused(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "scan.npy").write_bytes(content)
    with pytest.raises(DatasetError, match=r"scan\.npy cannot be read: "):
        read_scan(tmp_path / "scan.npy")


def test_what_is_too_far_is_no_return(tmp_path: Path) -> None:
    points = np.array([[1, 2, 3, 0.5], [1e300, 0, 0, 1], [np.inf, 0, 0, 1], [0, -2e5, 0, 1], [1, 1, 1, 1]])
    (tmp_path / "scan.npy").write_bytes(npy(points))
    np.testing.assert_array_equal(read_scan(tmp_path / "scan.npy"), points[[0, 4]].astype(np.float32))


@given(st.binary(max_size=400))
def test_lzf_is_undone(data: bytes) -> None:
    assert unpack_lzf(pack_lzf(data), len(data)) == data
    repeated = data[:5] * 40
    assert unpack_lzf(pack_lzf(repeated), len(repeated)) == repeated


def test_lzf_that_copies_over_itself() -> None:
    """Two literal bytes, then nine bytes from two back: the pattern goes on."""
    assert unpack_lzf(bytes([1]) + b"ab" + bytes([7 << 5, 0, 1]), 11) == b"abababababa"


@given(st.binary(max_size=300), st.integers(0, 1000))
def test_lzf_of_anything_ends_with_the_size_or_an_error(data: bytes, size: int) -> None:
    with contextlib.suppress(CloudError):
        assert len(unpack_lzf(data, size)) == size


@given(arrays(np.float32, (5, 4), elements=st.floats(-1e4, 1e4, width=32)), st.sampled_from(list(_READERS)))
def test_any_cloud_is_read_as_it_was_written(values: np.ndarray, suffix: str) -> None:
    contents = {
        ".bin": [values.tobytes()],
        ".npy": [npy(values), npy(np.asfortranarray(values)), npy(values.astype(">f8"))],
        ".pcd": [pcd(values, form) for form in FORMS["pcd"]],
        ".ply": [ply(values, form) for form in FORMS["ply"]],
    }
    for content in contents[suffix]:
        np.testing.assert_array_equal(_READERS[suffix](content), values)


WHOLE = {".pcd": [TEXT_PCD, BINARY, PACKED], ".ply": [TEXT_PLY, ply(VALUES)], ".npy": [npy(VALUES)]}


@given(st.data())
def test_any_damage_is_an_error_of_ours_or_gives_points(data: st.DataObject) -> None:
    suffix = data.draw(st.sampled_from(list(WHOLE)))
    content = bytearray(data.draw(st.sampled_from(WHOLE[suffix])))
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, len(content) - 1))
        content[place : place + data.draw(st.integers(0, 3))] = data.draw(st.binary(max_size=3))
    try:
        points = _READERS[suffix](bytes(content))
    except CloudError:
        return
    assert points.dtype == np.float32
    assert points.ndim == 2
    assert points.shape[1] == 4
