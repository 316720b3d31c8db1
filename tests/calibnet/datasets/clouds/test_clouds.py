"""Clouds in every layout that people have: columns of .bin, tables, surveys; and intensity, judged once a drive."""

from __future__ import annotations

import io
import re
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path

import laspy
import numpy as np
import pyarrow as pa
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pyarrow import feather, parquet

from calibnet.datasets.clouds import tables
from calibnet.datasets.clouds.bin import KITTI, LAYOUTS, read_bin, recognised
from calibnet.datasets.clouds.columns import CloudError, intensity_name, points_of
from calibnet.datasets.clouds.pcd import read_pcd
from calibnet.datasets.clouds.scans import clean_points
from calibnet.datasets.clouds.text import read_text
from calibnet.errors import DatasetError
from tests.support.clouds import pcd, with_fields


def scan(count: int = 4000, seed: int = 0) -> np.ndarray:
    """x y z intensity ring time, of a road, walls and poles around."""
    generator = np.random.default_rng(seed)
    azimuth, ring = generator.uniform(-np.pi, np.pi, count), generator.integers(0, 32, count)
    elevation = np.radians(-24 + ring * 0.9)
    distance = np.minimum(1.8 / np.maximum(np.sin(-elevation), 1e-3), 12 + 30 * (np.sin(5 * azimuth) > 0))
    points = distance[:, None] * np.column_stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    )
    return np.column_stack([points, generator.beta(1, 4, count), ring, np.linspace(0, 0.1, count)]).astype(np.float32)


@pytest.mark.parametrize("count", [3, 4, 5, 6])
@pytest.mark.parametrize("shuffled", [False, True])
def test_columns_of_a_bin_are_recognised(count, shuffled):
    rows = scan()
    if shuffled:
        np.random.default_rng(1).shuffle(rows)
    assert len(recognised(rows[:, :count].tobytes())) == count


def test_intensity_of_eight_bits_and_points_without_a_return_do_not_confuse_it():
    rows = scan()[:, :5]
    rows[:, 3] = np.round(255 * rows[:, 3])
    rows[::7, :3] = np.nan
    assert len(recognised(rows.tobytes())) == 5
    rows[::7, :3] = 0.0
    assert len(recognised(rows.tobytes())) == 5


def test_few_points_are_taken_for_kitti_s():
    assert recognised(scan(50)[:, :4].tobytes()) == KITTI
    with pytest.raises(CloudError, match="does not show how many columns"):
        recognised(scan(50)[:49, :5].tobytes())


def test_what_is_no_float32_is_asked_about():
    with pytest.raises(
        CloudError, match=r"does not show how many columns.*cloud_columns: \[x, y, z, intensity, ring\]"
    ):
        recognised(np.random.default_rng(0).bytes(60 * 400))


@pytest.mark.parametrize("columns", [3, 4, 5, 6])
def test_float64_is_called_so(columns):
    with pytest.raises(CloudError, match="seem to be float64; write them as float32"):
        recognised(scan()[:, :columns].astype(np.float64).tobytes())
    steps = np.round(512 * scan()[:, :columns].astype(np.float64)) / 512  # whose lower halves are mostly zeros
    with pytest.raises(CloudError, match="seem to be float64; write them as float32"):
        recognised(steps.tobytes())


@pytest.mark.parametrize(("held", "named"), [(6, 4), (6, 3), (4, 5), (5, 4), (4, 3)])
def test_a_declared_layout_of_other_columns_is_refused(held, named):
    rows = scan(6000)[:, :held]
    names = ("x", "y", "z", "intensity", "ring")[:named]
    with pytest.raises(CloudError, match=f"names {named} columns .* but its numbers look like rows of {held}"):
        read_bin(rows.tobytes(), names)
    assert read_bin(rows.tobytes(), tuple("xyz") + ("a", "b", "c")[: held - 3])["x"] == pytest.approx(rows[:, 0])


def test_every_layout_has_positions_first():
    assert all(layout[:3] == ("x", "y", "z") for layout in LAYOUTS)


def test_declared_columns_are_taken_as_they_are(write_layout, write_calibration):
    layout = write_layout("folder")
    layout.calibration.write_text(write_calibration(cloud_columns="[ring, x, y, z, Intensity, time, tag]"))
    rows = scan(300)
    for path in layout.scans:
        np.column_stack([rows[:, 4], rows[:, :4], rows[:, 5], rows[:, 5]]).astype(np.float32).tofile(path)
    assert_array_equal(layout.open()[1].points, rows[:, :4])
    layout.scans[1].write_bytes(layout.scans[1].read_bytes()[:-4])
    with pytest.raises(DatasetError, match=r"number of rows of 7 columns \(ring, x, y, z, Intensity, time, tag"):
        layout.open()[1]


def test_nuscenes_s_ending_is_one(write_layout):
    layout = write_layout("folder")
    rows = scan()
    for path in layout.scans:
        rows[:, :5].tofile(path.with_suffix(".pcd.bin"))
        path.unlink()
    sequence = layout.open()
    assert [one.scan.name for one in sequence.files] == ["0000.pcd.bin", "0001.pcd.bin", "0002.pcd.bin"]
    assert_array_equal(sequence[0].points, rows[:, :4])


def las(rows: np.ndarray, **options) -> bytes:
    header = laspy.LasHeader(point_format=0, version="1.2")
    header.scales, header.offsets = [0.001] * 3, [0.0] * 3
    data = laspy.LasData(header)
    data.x, data.y, data.z = (rows[:, axis].astype(np.float64) for axis in range(3))
    data.intensity = np.round(rows[:, 3] * 255).astype(np.uint16)
    stream = io.BytesIO()
    data.write(stream, **options)
    return stream.getvalue()


def table(rows: np.ndarray) -> pa.Table:
    columns = {name: rows[:, place] for place, name in enumerate(("X", "y", "z"))}
    return pa.table(columns | {"intensity": np.round(rows[:, 3] * 255).astype(np.uint8), "name": ["a"] * len(rows)})


def written(write: Callable[[pa.Table, io.BytesIO], None]) -> bytes:
    stream = io.BytesIO()
    write(table(scan()), stream)
    return stream.getvalue()


FILES = {
    ".las": las(scan()),
    ".laz": las(scan(), do_compress=True),
    ".feather": written(lambda content, stream: feather.write_feather(content, stream)),
    ".parquet": written(lambda content, stream: parquet.write_table(content, stream)),
}


@pytest.mark.parametrize("suffix", FILES)
def test_tables_and_surveys(suffix, write_layout):
    layout = write_layout("folder")
    for path in layout.scans:
        path.unlink()
        path.with_suffix(suffix).write_bytes(FILES[suffix])
    points = layout.open()[1].points
    assert_allclose(points[:, :3], scan()[:, :3], atol=6e-4)
    assert_allclose(points[:, 3], np.round(scan()[:, 3] * 255) / 255, atol=1e-6)


@pytest.mark.parametrize("suffix", FILES)
@pytest.mark.parametrize(
    "damage", [lambda data: data[: len(data) // 2], lambda data: b"hello", lambda data: data[:60] + b"\xff" * 400]
)
def test_a_damaged_table_is_one_sentence(suffix, damage, write_layout):
    layout = write_layout("folder")
    layout.scans[1].unlink()
    path = layout.scans[1].with_suffix(suffix)
    path.write_bytes(damage(FILES[suffix]))
    with pytest.raises(DatasetError, match=path.name):
        layout.open()[1]


START = struct.unpack_from("<I", FILES[".laz"], 96)[0]
TABLE = struct.unpack_from("<q", FILES[".laz"], START)[0]


@pytest.mark.parametrize(
    ("form", "place", "value", "sentence"),
    [
        ("<I", 100, 1 << 24, "header"),
        ("<I", 107, 15_000_000, "header"),
        ("<q", START, 1 << 37, "table of chunks"),
        ("<q", START, START, "table of chunks"),
        ("<q", START, -1, "table of chunks"),
        ("<I", TABLE + 4, 1 << 30, "table of chunks"),
    ],
)
def test_what_would_keep_the_unpacker_busy_is_found_before(form, place, value, sentence, monkeypatch):
    """The first and the third alone took all of its seconds."""
    monkeypatch.setattr(tables, "unpacked", lambda *_: pytest.fail("it is unpacked"))
    data = bytearray(FILES[".laz"])
    struct.pack_into(form, data, place, value)
    with pytest.raises(CloudError, match=sentence):
        tables.read_las(bytes(data))


def test_a_table_without_a_coordinate_names_what_it_has(write_layout):
    layout = write_layout("folder")
    layout.scans[1].unlink()
    path = layout.scans[1].with_suffix(".feather")
    feather.write_feather(table(scan()).drop_columns(["z"]), path)
    with pytest.raises(DatasetError, match="it has no column z \\(its columns: x, y, intensity\\)"):
        layout.open()[1]


def test_a_table_with_two_columns_of_one_name_is_refused(write_layout):
    layout = write_layout("folder")
    layout.scans[1].unlink()
    path = layout.scans[1].with_suffix(".feather")
    whole = table(scan())
    feather.write_feather(whole.rename_columns(["x" if name == "y" else name for name in whole.column_names]), path)
    with pytest.raises(DatasetError, match="several of its columns are called 'x'"):
        layout.open()[1]


def test_a_transposed_array_is_refused_by_name(write_layout):
    layout = write_layout("folder")
    layout.scans[1].unlink()
    np.save(layout.scans[1].with_suffix(".npy"), scan()[:, :4].T)
    with pytest.raises(DatasetError, match=r"an array \(4, 4000\), which seems to be transposed; save \[N, 4\]"):
        layout.open()[1]


def in_folder(layout, name: str, write: Callable[[Path, np.ndarray], None]) -> np.ndarray:
    """The points that are read where the middle scan is written so."""
    layout.scans[1].unlink()
    write(layout.scans[1].with_name(name), scan()[:, :4])
    return np.asarray(layout.open()[1].points)


WAYS: dict[str, Callable[[Path, np.ndarray], None]] = {
    "0001.npy": lambda path, rows: np.save(path, with_fields(rows)),
    "0001.npz": lambda path, rows: np.savez(path, points=rows, label="a drive", stamp=np.float64(3.0)),
    "0001.Npz": lambda path, rows: np.savez(path.open("wb"), xyz=rows[:, :3], intensity=rows[:, 3:], rgb=rows[:, :3]),
    "0001.Npy": lambda path, rows: np.save(path.open("wb"), rows.reshape(40, 100, 4)),
    "0001.nPy": lambda path, rows: np.save(path.open("wb"), rows.view([("xyz", "<f4", 3), ("intensity", "<f4")])),
    "0001.NPZ": lambda path, rows: np.savez(path.open("wb"), **dict(zip(["x", "y", "z", "i"], rows.T, strict=True))),
}


@pytest.mark.parametrize("name", WAYS)
def test_clouds_as_numpy_saves_them(name, write_layout):
    assert_array_equal(in_folder(write_layout("folder"), name, WAYS[name]), scan()[:, :4])


@pytest.mark.parametrize(
    ("arrays", "problem"),
    [
        ({"a": scan(), "b": scan()}, r"not have exactly one array \[N, 4\] among a \(4000, 6\), b \(4000, 6\)"),
        ({"x": np.zeros(5), "y": np.zeros(4), "z": np.zeros(5)}, "its x, y and z have different lengths"),
        ({}, r"exactly one array \[N, 4\] among none"),
        ({"stamp": np.float64(3.0)}, r"exactly one array \[N, 4\] among stamp \(\)"),
        ({"xyz": np.zeros((0, 3)), "intensity": np.zeros((0, 1))}, "is empty"),
    ],
)
def test_an_archive_without_one_cloud_says_what_it_holds(arrays, problem, write_layout):
    with pytest.raises(DatasetError, match=problem):
        in_folder(write_layout("folder"), "0001.npz", lambda path, _: np.savez(path, **arrays))


def test_an_archive_that_unpacks_to_too_much_is_not_unpacked(write_layout):
    def write(path: Path, _: np.ndarray) -> None:
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
            file.writestr("points.npy", bytes(300 << 20))

    with pytest.raises(DatasetError, match="would unpack to more than 256 MB"):
        in_folder(write_layout("folder"), "0001.npz", write)


def test_python_objects_are_not_opened(write_layout):
    with pytest.raises(DatasetError, match="contains Python objects, which are not read"):
        in_folder(write_layout("folder"), "0001.npy", lambda path, _: np.save(path, np.array([{}], object)))


def test_other_files_are_named(write_layout):
    layout = write_layout("folder")
    for path in layout.scans:
        path.rename(path.with_suffix(".e57"))
    with pytest.raises(DatasetError, match=r"has no scans \(.*\.npz.*\), only \.e57; put them there"):
        layout.open()


def test_intensity_is_scaled_once_a_drive(write_layout):
    """A scan whose points are all dark, of a sensor of 8 bits, stays dark."""
    layout = write_layout("folder")
    for path, brightest in zip(layout.scans, (200.0, 1.0, 200.0), strict=True):
        rows = scan()[:, :4]
        rows[:, 3] = np.linspace(0, brightest, len(rows))
        rows.tofile(path)
    assert layout.open()[1].points[:, 3].max() == pytest.approx(1 / 255)
    assert layout.open()[0].points[:, 3].max() == pytest.approx(200 / 255)


def test_intensity_wider_than_eight_bits_is_scaled_by_what_is_bright(write_layout):
    """Sensors of 16 bits use few of them: what 99 % of the drive's points stay below counts as 1."""
    layout = write_layout("folder")
    rows = scan()[:, :4]
    rows[:, 3] = np.linspace(0, 1000, len(rows))
    rows[5, 3] = 65535
    for path in layout.scans:
        rows.tofile(path)
    intensity = layout.open()[1].points[:, 3]
    assert np.median(intensity) == pytest.approx(0.5 / 0.99, rel=1e-2)
    assert intensity.max() == 1.0


def test_points_without_a_return_are_dropped():
    rows = scan(300)[:, :4]
    nowhere = np.array([[0, 0, 0, 0.5], [np.nan, 1, 1, 0], [1, np.inf, 1, 0], [-3e38, 0, 0, 0]])
    assert_array_equal(clean_points(np.vstack([nowhere, rows]), Path("a.bin")), rows)
    with pytest.raises(DatasetError, match=r"has no finite point \(all NaN, infinite or 0, 0, 0\)"):
        clean_points(nowhere[:3], Path("a.bin"))


def test_points_of_a_map_are_no_scan():
    with pytest.raises(DatasetError, match="its points are more than 100 km away, like those of a map"):
        clean_points(scan(300)[:, :4] + [5e5, 5e6, 100.0, 0.0], Path("a.bin"))


NAMED = {
    "comma": "x,y,z,intensity\n{,}",
    "CloudCompare's comment": "//X Y Z Intensity\n{ }",
    "CloudCompare's name for none": "//X Y Z Scalar_field\n{ }",
    "another comment": "# made today\n\n# x  y  z  i\n{ }",
    "units, semicolons, a mark of order": "\ufeffX (m);Y [m];z_m;Reflectivity\n{;}",
    "millimetres": "X (mm),Y (mm),Z (mm),REFLECTIVITY (%)\n{,}",
    "Ouster's first return": "X1 (m);Y1 (m);Z1 (m);REFLECTIVITY (%)\n{;}",
    "CloudCompare's number of points": "//X Y Z Intensity\n4000\n{ }",
    "VeloView's": '"Points_m_XYZ:0","Points_m_XYZ:1","Points_m_XYZ:2","intensity"\n{,}',
    "none, blanks": "{ }",
    "none, tabs": "{\t}",
    "none, a comma and a blank": "{, }",
    "none, after their number": "4000\n{ }",
}


@pytest.mark.parametrize("way", NAMED)
@pytest.mark.parametrize("suffix", [".csv", ".xyz", ".txt"])
def test_clouds_of_text(write_layout, way, suffix):
    layout = write_layout("folder")
    head, separator = re.fullmatch(r"(.*)\{(.+)\}", NAMED[way], re.DOTALL).groups()
    unit = [1000, 1000, 1000, 1] if way == "millimetres" else 1
    lines = [separator.join(map(repr, row)) for row in (scan()[:, :4].astype(np.float64) * unit).tolist()]
    for path in layout.scans:
        path.unlink()
        path.with_suffix(suffix).write_text(
            head + "\n".join(lines) + "\n", newline="\r\n" if separator == ";" else "\n"
        )
    assert_allclose(layout.open()[1].points, scan()[:, :4], rtol=1e-7 if way == "millimetres" else 0)


def test_columns_of_text_are_found_by_name_among_words_and_dropouts():
    rows = b"time,label,intensity,z,y,x\n12:00:01,car,1,3.5,2.5,1.5\n12:00:02,,2,,,\n"
    columns = read_text(rows)
    assert_array_equal(points_of(columns), [[1.5, 2.5, 3.5, 1], [np.nan, np.nan, np.nan, 2]])
    assert_array_equal(points_of(read_text(b"x;y;z\n1,5;2,5;-3,5\n")), [[1.5, 2.5, -3.5, 0]])
    assert_array_equal(points_of(read_text(b"7 1.5 2.5 3.5\n", ("ring", "x", "y", "z"))), [[1.5, 2.5, 3.5, 0]])


@pytest.mark.parametrize(
    ("names", "found"),
    [
        (["x", "scalar_field", "intensity"], "intensity"),
        (["scalar_scalar_field", "scalar_reflectivity"], "scalar_reflectivity"),
        (["scalar_scalar_field"], "scalar_scalar_field"),
        (["scalar_field", "scalar_field_#2"], None),  # which of them is it?
        (["scalar_gpstime", "field"], None),
    ],
)
def test_intensity_among_the_columns_of_cloudcompare(names, found):
    assert intensity_name(names) == found


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("1.5 2.5 3.5 4.5 5.5\n", r"its 5 columns have no names; name them in its first line, or name them in cal"),
        ("0 1.5 2.5 3.5\n1 2.5 3.5 4.5\n", "no names, and column 1 has only whole numbers"),
        ("a,b,c\n1,2,3\n", r"its first line \(a,b,c\) does not name columns x, y and z"),
        ("x,y,z\n1,2,far\n", "invalid value 'far'"),
        ("x [ft],y [ft],z [ft]\n1,2,3\n", "its x, y and z are in ft; write metres"),
        ("x [m],y [mm],z [mm]\n1,2,3\n", "its x, y and z are in m, mm; write metres"),
        ("1.5 2.5 3.5\n1.5 2.5\n", r"Row #2: Expected 3 columns, got 2"),
        ("x,y,z\n", "it has no points"),
    ],
)
def test_text_that_is_no_cloud_is_one_sentence(text, sentence):
    with pytest.raises(CloudError, match=sentence):
        read_text(text.encode())


def test_times_beside_the_scans_are_none(write_layout):
    layout = write_layout("folder")
    (layout.scans[0].parent / "timestamps.txt").write_text("0.0\n0.1\n0.2\n")
    assert len(layout.open()) == 3


def test_texts_beside_the_scans_are_labels(write_layout):
    layout = write_layout("folder")
    for name in ("0000.txt", "README.txt"):
        (layout.scans[0].parent / name).write_text("Car 0.00 0 -1.57\n")
    assert [one.scan.suffix for one in layout.open().files] == [".bin"] * 3


def test_a_viewpoint_of_a_pcd_is_refused_unless_it_is_none():
    rows = scan(30)[:, :4]
    for none in ("0 0 0 1 0 0 0", "0 0 0 0 0 0 0", "0.0 -0.0 1e-9 -1 0 0 0", None):
        assert_array_equal(points_of(read_pcd(pcd(rows, VIEWPOINT=none))), rows)
    for pose in ("1.5 0 0 1 0 0 0", "0 0 0 0.7071 0 0 0.7071", "0 0 0 0 0 0 1", "a b c", "0 0 0 1"):
        with pytest.raises(CloudError, match=f"VIEWPOINT {pose}, and tools do not agree"):
            read_pcd(pcd(rows, VIEWPOINT=pose))
