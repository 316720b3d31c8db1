"""Lists of drives: what a row may say, and one sentence that names the row where it says it wrongly."""

from __future__ import annotations

from pathlib import Path

import pytest

from calibnet.errors import ConfigError
from inspector.fleet.drives import Drive, find_drives


def listed(tmp_path: Path, text: str, options: str = "") -> list[Drive]:
    file = tmp_path / "DRIVES.csv"
    file.write_text(text)
    return find_drives([str(file)], options)


def test_a_path_is_enough(tmp_path: Path) -> None:
    (drive,) = listed(tmp_path, "path\ncars/blue/monday\n")
    assert (drive.car, drive.drive, drive.dataset) == ("blue", "monday", "folder")
    assert drive.path == str(tmp_path / "cars/blue/monday")
    assert drive.arguments() == ["folder", drive.path]


def test_rows_are_the_commands_that_do_the_same_by_hand(tmp_path: Path) -> None:
    drives = listed(
        tmp_path,
        "car,drive,dataset,path,sequence,camera,frames,options\n"
        "a,1,kitti-odometry,kitti,04,2,0:9,--seed 1\n"
        "a,2,kitti-raw,kitti,2011_09_26 0005,,,\n"
        "a,3,bag,drive.mcap,,,,\n"
        "a,4,folder,mine,,cam0,,--guess 'first guess.yaml'\n",
        "--stages 5",
    )
    root = str(tmp_path / "kitti")
    assert [drive.arguments() for drive in drives] == [
        ["seq", "04", "--root", root, "--camera", "2", "--frames", "0:9", "--stages", "5", "--seed", "1"],
        ["raw", "2011_09_26", "0005", "--root", root, "--stages", "5"],
        ["bag", str(tmp_path / "drive.mcap"), "--stages", "5"],
        [
            "folder",
            str(tmp_path / "mine"),
            "--camera",
            "cam0",
            "--stages",
            "5",
            "--guess",
            str(tmp_path / "first guess.yaml"),
        ],
    ]
    assert drives[3].folder == "drives/a/4@cam0"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "names no drive"),
        ("path\n", "names no drive"),
        ("car\nblue\n", r"row 1 \(line 2\): path is missing"),
        ("path,colour\nx,blue\n", "row 1 .*colour is unknown"),
        ("path,car\nx\ny,b,c\n", "row 2 .*more fields than the first line names"),
        ("path,dataset\nx,waymo\n", "row 1 .*dataset 'waymo' is unknown"),
        ("path,dataset\nx,kitti-raw\n", "row 1 .*sequence is missing"),
        ("path,dataset,sequence\nx,kitti-odometry,04 --save=/etc/x\n", "row 1 .*is none"),
        ("path,date\nx,yesterday\n", "row 1 .*date 'yesterday' is none"),
        ("path,options\nx,'\n", "row 1 .*options cannot be split"),
        ("path,drive\nx,one\ny,one\nx/../x,one\n", "row 3 .* and .*row 1 .*are both called"),
        ('path\n"x\n', "row 1: unexpected end"),
    ],
)
def test_what_is_wrong_is_one_sentence_that_names_the_row(tmp_path: Path, text: str, sentence: str) -> None:
    with pytest.raises(ConfigError, match=sentence) as caught:
        listed(tmp_path, text.replace("x,one\ny,one\nx/../x,one", "a/x,one\nb/y,one\na/z,one"))
    assert "\n" not in str(caught.value)


def test_an_address_stays_as_it_is(tmp_path: Path) -> None:
    (drive,) = listed(tmp_path, "path\nmemory://fleet/blue/monday\n")
    assert (drive.car, drive.drive, drive.path) == ("blue", "monday", "memory://fleet/blue/monday")


def test_neither_a_list_nor_a_folder(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"is neither a folder nor a \.csv file"):
        find_drives([str(tmp_path / "none")])
