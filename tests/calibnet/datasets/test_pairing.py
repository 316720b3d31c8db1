"""Images and scans of one moment: by their names, by times in files, and by names that are times."""

from __future__ import annotations

import unicodedata

import pytest
from numpy.testing import assert_allclose

from calibnet.errors import DatasetError


def rename(files, stems):
    files[:] = [path.rename(path.with_stem(stem)) for path, stem in zip(files, stems, strict=True)]


def write_times(files, times):
    (files[0].parent / "timestamps.txt").write_text("".join(f"{time}\n" for time in times))


def test_a_name_without_its_partner_is_a_bad_frame(write_layout):
    layout = write_layout("folder")
    layout.scans[1].unlink()
    sequence = layout.open()
    assert sequence.notes == ("1 of 3 names have only an image or only a scan (0001).",)
    assert [sequence[0].index, sequence[2].index] == [0, 2]
    with pytest.raises(DatasetError, match=r"no scan for 0001 \(.*0001\.png\); add it, or remove this file"):
        sequence[1]
    layout.images[2].unlink()
    with pytest.raises(DatasetError, match=r"no image for 0002 \(.*0002\.bin\)"):
        layout.open()[2]


def test_names_that_have_nothing_in_common_are_refused(write_layout):
    layout = write_layout("folder")
    rename(layout.scans, ["a", "b", "c"])
    with pytest.raises(
        DatasetError, match=r"\(3 images, the first 0000\) and .* \(3 scans, the first a\) have no name"
    ):
        layout.open()


@pytest.mark.parametrize(
    ("images", "scans"),
    [
        (["frame_0007", "frame_0008", "frame_0009"], ["scan7", "scan8", "scan9"]),
        (["0000_left", "0001_left", "0002_left"], ["0", "1", "2"]),
        (["cam2_1_rect", "cam2_2_rect", "cam2_10_rect"], ["lidar_000001", "lidar_000002", "lidar_000010"]),
    ],
)
def test_names_that_differ_but_in_their_number_pair_by_it(images, scans, write_layout):
    layout = write_layout("folder")
    rename(layout.images, images)
    rename(layout.scans, scans)
    sequence = layout.open()
    assert [(one.image.stem, one.scan.stem) for one in sequence.files] == list(zip(images, scans, strict=True))
    assert sequence.notes == (f"Paired by the number in their names, for instance {images[0]} and {scans[0]}.",)
    layout.scans[1].unlink()
    assert "1 of 3 names have only an image or only a scan" in layout.open().notes[1]


def test_numbers_are_in_order_whatever_their_length(write_layout):
    layout = write_layout("folder")
    for files in (layout.images, layout.scans):
        rename(files, ["9", "10", "100"])
    assert [one.index for one in layout.open().files] == [9, 10, 100]


@pytest.mark.parametrize("scans", [["scan_1", "scan_2", "scan_3"], ["a_0", "b_1", "c_2"], ["s_0", "s_0_", "s_1"]])
def test_numbers_that_may_count_something_else_pair_nothing(scans, write_layout):
    layout = write_layout("folder")
    rename(layout.scans, scans)
    with pytest.raises(DatasetError, match="have no name in common"):
        layout.open()


def test_each_image_gets_the_scan_that_is_nearest_in_time(write_layout):
    layout = write_layout("folder")
    rename(layout.scans, ["a", "b", "c"])
    write_times(layout.images, [10.00, 10.10, 10.20])
    write_times(layout.scans, [9.990, 10.109, 10.500])
    sequence = layout.open()
    assert sequence.notes[0] == (
        "Paired by time: 2 frames, image and scan up to 10 ms apart; 1 image and 1 scan are left out."
    )
    assert [(one.image.stem, one.scan.stem) for one in sequence.files] == [("0000", "a"), ("0001", "b")]
    assert_allclose([frame.timestamp for frame in sequence], [0.0, 0.1])
    assert len(sequence.notes) == 1


def test_a_scan_goes_to_one_image_only(write_layout):
    """A camera of 30 Hz beside a scanner of 10 Hz."""
    layout = write_layout("folder")
    write_times(layout.images, [1.000, 1.033, 1.066])
    write_times(layout.scans, [1.030, 2.0, 3.0])
    sequence = layout.open(max_time_difference=40)
    assert [(one.image.stem, one.scan.stem) for one in sequence.files] == [("0001", "0000")]


def test_a_large_difference_is_said_in_centimetres(write_layout):
    layout = write_layout("folder")
    write_times(layout.images, [1.00, 2.00, 3.00])
    write_times(layout.scans, [1.03, 2.00, 3.00])
    assert layout.open(max_time_difference=50).notes[1].startswith("At 50 km/h, 30 ms are 42 cm")
    with pytest.raises(
        DatasetError, match=r"has a scan within 1 ms, the nearest is 2000 ms away; check that both clocks"
    ):
        write_times(layout.scans, [5.0, 6.0, 7.0])
        layout.open(max_time_difference=1)


@pytest.mark.parametrize(
    ("images", "scans"),
    [
        (["1532402927612460000", "1532402927712460000", "1532402927812460000"],) * 2,
        (
            ["1532402927612460", "1532402927712460", "1532402927812460"],
            ["1532402927.612", "1532402927.712", "1532402927.812"],
        ),
        (["1532402927612", "1532402927712", "1532402927812"], ["1532402927_61", "1532402927_71", "1532402927_81"]),
        (
            [f"n015-2018-11-21-19-38-26+0800__CAM_FRONT__1532402927{tenth}12460" for tenth in (0, 1, 2)],
            [f"top 1532402927{tenth}10460000" for tenth in (0, 1, 2)],
        ),
    ],
)
def test_names_that_are_times_are_times(images, scans, write_layout):
    layout = write_layout("folder")
    rename(layout.images, images)
    layout.scans[:] = [path.rename(path.parent / f"{stem}.bin") for path, stem in zip(layout.scans, scans, strict=True)]
    frames = list(layout.open(max_time_difference=5))
    assert [frame.index for frame in frames] == [0, 1, 2]
    assert_allclose([frame.timestamp for frame in frames], [0.0, 0.1, 0.2], atol=1e-5)


def test_letters_with_accents_are_the_same_however_they_are_stored(write_layout):
    """macOS stores them as two characters."""
    layout, names = write_layout("folder"), ["ä0", "ä1", "ä2"]
    rename(layout.images, names)
    decomposed = [unicodedata.normalize("NFD", name) for name in names]
    layout.scans[:] = [path.rename(path.with_stem(stem)) for path, stem in zip(layout.scans, decomposed, strict=True)]
    assert len(list(layout.open())) == 3


def test_dates_of_kitti_are_times(write_layout):
    layout = write_layout("folder")
    for files in (layout.images, layout.scans):
        write_times(files, [f"2011-09-26 13:02:2{second}.594360375" for second in (5, 6, 8)])
    assert_allclose([frame.timestamp for frame in layout.open(max_time_difference=5)], [0, 1, 3], atol=1e-6)


@pytest.mark.parametrize(
    ("times", "problem"),
    [
        (["1.0", "soon", "3.0"], "'soon' is not a time"),
        (["1.0", "2.0"], "has 2 times for 3 files"),
        (["2011-99-26 13:02:25", "1", "2"], "is not a time"),
    ],
)
def test_times_that_are_none(times, problem, write_layout):
    layout = write_layout("folder")
    write_times(layout.images, times)
    with pytest.raises(DatasetError, match=problem):
        layout.open()


def test_times_that_are_asked_for_and_missing(write_layout):
    layout = write_layout("folder")
    with pytest.raises(DatasetError, match=r"images has no times for pairing; write .*timestamps\.txt"):
        layout.open(max_time_difference=20)


@pytest.mark.parametrize(
    "times",
    [
        ["2026-03-01T14:05:06.1+09:00", "2026-03-01T05:05:07.1Z", "2026-03-01 05:05:09.1"],
        ["20260301T050506.100", "20260301T050507.100", "20260301T050509.100"],
        ["2026-03-01 05:05:06,25", "2026-03-01T14:05:07,25+09:00", "2026-03-01 05:05:09,25"],
        ["2026-03-01T05:05:06-0100", "2026-03-01T05:05:07.000-01:00", "2026_03_01_06_05_09_000"],
        ["2016-12-31 23:59:60.5", "2017-01-01 00:00:01.5", "2017-01-01 00:00:03.5"],
        ["-1.5", "-0.5", "1.5"],
    ],
)
def test_dates_of_other_forms_are_times(times, write_layout):
    """Also in other zones, at a leap second, and of a clock that starts below zero."""
    layout = write_layout("folder")
    for files in (layout.images, layout.scans):
        write_times(files, times)
    assert_allclose([frame.timestamp for frame in layout.open(max_time_difference=5)], [0, 1, 3], atol=1e-6)


@pytest.mark.parametrize(
    "name",
    [
        "2026-03-01_14-05-0{}.12{}",
        "20260301_14050{}_12{}",
        "2026_03_01_14_05_0{}_12{}000",
        "2026-03-01-14-05-0{}-12{}",
        "front_20260301T14050{}.12{}",
        "0{}.12{}",
    ],
)
def test_names_that_are_dates_are_times(write_layout, name):
    layout = write_layout("folder")
    for files, late in ((layout.images, 0), (layout.scans, 4)):
        stems = [name.format(second, late) for second in (6, 7, 9)]
        files[:] = [path.rename(path.parent / f"{stem}{path.suffix}") for path, stem in zip(files, stems, strict=True)]
    sequence = layout.open()
    assert sequence.notes == ("Paired by time: 3 frames, image and scan up to 4 ms apart.",)
    assert_allclose([frame.timestamp for frame in sequence], [0, 1, 3], atol=1e-6)


@pytest.mark.parametrize("line", ["{time} images/{name}", "{name},{time}", "{stem}\t{time}"])
def test_lines_that_name_their_file_need_no_order(line, write_layout):
    layout = write_layout("folder")
    for files in (layout.images, layout.scans):
        times = zip(files, (10.0, 11.0, 13.0), strict=True)
        lines = [line.format(time=time, name=path.name, stem=path.stem) for path, time in times]
        (files[0].parent / "timestamps.txt").write_text("# time, file\n" + "\n".join(reversed(lines)))
    assert_allclose([frame.timestamp for frame in layout.open(max_time_difference=5)], [0, 1, 3])
    (layout.images[0].parent / "timestamps.txt").write_text("\n".join(lines[:2]))
    with pytest.raises(DatasetError, match="is not a time; write seconds"):
        layout.open(max_time_difference=5)
