"""Lists of drives: what a row may say, and one sentence that names the row where it says it wrongly."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest

from calibnet.datasets.published import PUBLISHED, options_of
from calibnet.errors import ConfigError
from inspector.cli.fleet_drive import Task, _within_drive, read_options
from inspector.fleet.drives import Drive, find_drives
from inspector.fleet.places import Store


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
        "a,2,kitti-raw,kitti,2011_09_26/0005,,,\n"
        "a,3,bag,drive.mcap,,,,\n"
        "a,4,folder,mine,,cam0,,--guess 'first guess.yaml'\n",
        "--stages 5",
    )
    root = str(tmp_path / "kitti")
    assert [drive.arguments() for drive in drives] == [
        ["seq", "04", "--root", root, "--stages", "5", "--camera", "2", "--frames", "0:9", "--seed", "1"],
        ["raw", "2011_09_26", "0005", "--root", root, "--stages", "5"],
        ["bag", str(tmp_path / "drive.mcap"), "--stages", "5"],
        [
            "folder",
            str(tmp_path / "mine"),
            "--stages",
            "5",
            "--camera",
            "cam0",
            "--guess",
            str(tmp_path / "first guess.yaml"),
        ],
    ]
    assert drives[3].folder == "drives/a/4@cam0"


def test_what_a_row_says_counts_more_than_what_is_said_of_all(tmp_path: Path) -> None:
    common = "--frames : --camera 3 --seed 1"
    (drive,) = listed(tmp_path, "path,frames,camera,options\nmine,0:5,2,--seed 7\n", common)
    asked = read_options(Task(drive, Store(str(tmp_path / "out")))).options
    assert (asked["frames"], asked["camera"], asked["seed"]) == ("0:5", "2", 7)


@pytest.mark.parametrize("dataset", PUBLISHED)
def test_every_published_dataset_of_drives_can_be_in_a_list(tmp_path: Path, dataset: str) -> None:
    published = PUBLISHED[dataset]
    text = f"path,dataset,sequence,camera\ndata,{dataset},{published.example},1\n"
    if not published.one_mount:
        with pytest.raises(ConfigError, match=r"row 1 .*several mounts"):
            listed(tmp_path, text)
        return
    (drive,) = listed(tmp_path, text)
    opening = read_options(Task(drive, Store(str(tmp_path / "out")))).opening
    assert isinstance(opening, partial)
    named = opening.keywords
    assert (drive.arguments()[0], named["root"], str(named["camera"])) == (published.command, tmp_path / "data", "1")
    named["drive"] = named.get("number")  # what the dataset calls so
    opened = options_of(dataset, published.example, "")
    assert opened.items() <= named.items()


def test_a_camera_of_nuscenes_may_stand_in_the_name_of_the_sequence(tmp_path: Path) -> None:
    (drive,) = listed(tmp_path, "path,dataset,sequence\ndata,nuscenes,scene-0061/CAM_BACK\n")
    root = str(tmp_path / "data")
    assert drive.arguments() == ["nuscenes", "scene-0061", "--root", root, "--camera", "CAM_BACK"]
    assert drive.files == ("*/*.json", "samples/CAM_BACK", "samples/LIDAR_TOP")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "lists no drives"),
        ("path\n", "lists no drives"),
        ("car\nblue\n", r"row 1 \(line 2\): path is missing"),
        ("path,colour\nx,blue\n", "row 1 .*colour is unknown"),
        ("path,car\nx\ny,b,c\n", "row 2 .*more fields than the first line"),
        ("path,dataset\nx,waymo\n", "row 1 .*dataset 'waymo' is not known"),
        ("path,dataset\nx,kitti-raw\n", "row 1 .*sequence is missing"),
        ("path,dataset,sequence\nx,kitti-odometry,04 --save=/etc/x\n", "row 1 .*is not SEQUENCE; give for instance 04"),
        ("path,dataset,sequence\nx,kitti-odometry,--save=x\n", "row 1 .*must not begin with a dash"),
        ("path,dataset,sequence\nx,kitti-raw,0005\n", "row 1 .*is not DATE/DRIVE; give for instance 2011_09_26/0005"),
        ("path,date\nx,yesterday\n", "row 1 .*date 'yesterday' is not a date"),
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


@pytest.mark.parametrize(
    ("sentence", "said"),
    [
        ("Scan /d/a/clouds/0.bin is empty.", "Scan clouds/0.bin is empty."),
        ("/d/a has no images; look into /d/a.", "a has no images; look into a."),
        ("/d/ab and /d/a.yaml are not of '/d/a'.", "/d/ab and /d/a.yaml are not of 'a'."),
    ],
)
def test_files_in_a_reason_are_named_relative_to_the_drive(sentence: str, said: str) -> None:
    assert _within_drive(sentence, Path("/d/a")) == said
