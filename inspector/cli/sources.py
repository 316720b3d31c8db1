"""Every kind of data that can be calibrated: its name at the command line, its options, and how it is opened.

`calib-inspect NAME`, `verify NAME`, `watch NAME`, `live NAME` and `evaluate --dataset` all read this list.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import click

from calibnet.datasets import dataset_names
from calibnet.datasets.published import PUBLISHED, options_of
from calibnet.errors import ConfigError
from inspector.cli.options import FOLDER, NumberRange
from inspector.cli.source import Source, open_bag, open_folder, published

if TYPE_CHECKING:
    from calibnet.datasets import Sequence

KITTI = "{} is unpacked (from cvlibs.net/datasets/kitti)"
AS_GIVEN = (
    "With --range or --miscalibrate the data's calibration is the reference; without them it is the one to correct, "
    "and "
    "there is no reference."
)
CAMERA = click.Option(
    ["--camera"], type=click.IntRange(min=0), default=2, show_default=True, help="Camera to calibrate."
)
GUESS = click.Option(
    ["--guess"],
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Start from the extrinsic in this calibration file; required if the data contain no extrinsic.",
)
CAMERA_OF_FILE = click.Option(
    ["--camera"], metavar="NAME", help="Camera to use from a calibration file with several, for instance cam0."
)
CAMERA_FRAME = click.Option(
    ["--camera-frame"],
    metavar="NAME",
    help="Name of the camera's optical frame, if the calibration file or bag has several frames.",
)
LIDAR_FRAME = click.Option(["--lidar-frame"], metavar="NAME", help="Name of the LiDAR's frame, if there are several.")

SOURCES = (
    published(
        "kitti-odometry",
        KITTI.format("KITTI odometry"),
        (click.Argument(["sequence"]), CAMERA),
        of="a KITTI odometry sequence, for instance 04",
        note="--root is the folder that holds `sequences`.",
    ),
    published(
        "kitti-raw",
        KITTI.format("KITTI raw"),
        (click.Argument(["date"]), click.Argument(["number"], metavar="DRIVE"), CAMERA),
        of="a KITTI raw drive, for instance 2011_09_26 0005",
        note="--root is the folder that holds the dates.",
    ),
    published(
        "kitti-object",
        KITTI.format("KITTI object detection"),
        (
            click.Option(
                ["--split"], default="training", show_default=True, help="training, testing, or a list in ImageSets."
            ),
            CAMERA,
        ),
        of="the frames of the KITTI object detection benchmark",
        note="--root is the folder that holds `training`. Its frames come from several mounts and do not form a drive.",
    ),
    published(
        "kitti-tracking",
        KITTI.format("KITTI tracking"),
        (click.Argument(["sequence"]), CAMERA),
        of="a sequence of the KITTI tracking benchmark, for instance 0004",
        note="--root is the folder that holds `training`.",
    ),
    published(
        "kitti-360",
        "KITTI-360 is unpacked (from cvlibs.net/datasets/kitti-360)",
        (
            click.Argument(["number"], metavar="DRIVE"),
            click.Option(
                ["--camera"],
                type=click.IntRange(0, 3),
                default=0,
                show_default=True,
                help="Camera to calibrate: 0 and 1 face forward, 2 and 3 are fisheye cameras facing sideways.",
            ),
        ),
        variable="KITTI360_DATASET",
        of="a drive of KITTI-360, for instance 0003",
        note="--root is the folder that holds `calibration`, `data_2d_raw` and `data_3d_raw`.",
    ),
    published(
        "nuscenes",
        "nuScenes is unpacked (from nuscenes.org)",
        (
            click.Argument(["scene"], required=False, default=""),
            click.Option(
                ["--camera"], metavar="CHANNEL", default="CAM_FRONT", show_default=True, help="Camera to calibrate."
            ),
            click.Option(
                ["--version"], default="", metavar="NAME", help="Folder of the tables.  [default: the only one]"
            ),
            click.Option(
                ["--compensate/--as-taken"],
                default=True,
                show_default=True,
                help="Move each scan to the time of its image using the car's poses, or leave it as recorded.",
            ),
        ),
        variable="NUSCENES",
        of="the keyframes of a scene of nuScenes, for instance scene-0061; the first one by default",
        note="--root is the folder that holds `samples` and the tables, `v1.0-mini`. Its SDK is not needed.",
    ),
    Source(
        name="folder",
        of="your own images/ and clouds/, with a calibration.yaml or the calibration file of another tool",
        note=AS_GIVEN,
        parameters=(
            click.Argument(["directory"], type=FOLDER),
            click.Option(
                ["--dataset"],
                type=click.Choice([name for name in dataset_names() if name not in PUBLISHED]),
                default="folder",
                show_default=True,
                help="Kind of data in the folder; other packages can add kinds.",
            ),
            GUESS,
            CAMERA_OF_FILE,
            CAMERA_FRAME,
            LIDAR_FRAME,
            click.Option(
                ["--max-time-difference"],
                type=NumberRange(min=0),
                metavar="MS",
                help="Pair each image with the nearest scan within this many milliseconds, by timestamps.txt in both "
                "folders or by names that are times.  [default: by name; by time within 50 ms where names differ]",
            ),
        ),
        open=open_folder,
        given=True,
    ),
    Source(
        name="bag",
        of="a ROS 1 or ROS 2 bag, or an MCAP file",
        note="FILES is a .bag, .db3 or .mcap file, the folder of a ROS 2 bag, or several .bag files of one drive. "
        "Topics are found automatically if there is one of each kind; the lens comes from CameraInfo, and the first "
        "guess from "
        f"/tf_static or --guess. {AS_GIVEN}",
        parameters=(
            click.Argument(["files"], type=click.Path(path_type=Path), nargs=-1, required=True),
            click.Option(["--image"], metavar="TOPIC", help="Topic of the images.  [default: the only one]"),
            click.Option(["--points"], metavar="TOPIC", help="Topic of the point clouds.  [default: the only one]"),
            click.Option(
                ["--info"], metavar="TOPIC", help="Topic of the CameraInfo.  [default: the one next to the images]"
            ),
            GUESS,
            CAMERA_OF_FILE,
            CAMERA_FRAME,
            LIDAR_FRAME,
            click.Option(
                ["--every"],
                type=NumberRange(min=0, min_open=True),
                metavar="S",
                help="Take one frame per this many seconds, preferably at a standstill.  [default: about 40 frames]",
            ),
            click.Option(
                ["--accumulate"],
                type=click.IntRange(1, 100),
                default=1,
                metavar="N",
                help="Accumulate N scans at standstills, for scanners with a non-repeating pattern (Livox).",
            ),
            click.Option(
                ["--max-time-difference"],
                type=NumberRange(min=0, min_open=True),
                metavar="MS",
                help="Largest time difference between an image and its scan, in milliseconds.  [default: 50]",
            ),
            click.Option(
                ["--by-recording-time"],
                is_flag=True,
                help="Pair by when messages were recorded rather than by their stamps, if camera and LiDAR have "
                "different clocks. Trust only frames at a standstill then.",
            ),
        ),
        open=open_bag,
        given=True,
    ),
)
"""Every kind of data, in the order in which ``--help`` lists them."""


def open_parts(dataset: str, root: Path, names: list[str], camera: str | None) -> list[Sequence]:
    """Open the sequences of a dataset that ``evaluate --sequences`` names.

    Args:
        dataset: one of `dataset_names`.
        root: its folder.
        names: names of the sequences or, for a dataset without a command of its own, of folders below ``root``.
        camera: name or number of the camera; None for the dataset's own choice.
    """
    from calibnet.datasets import open_sequence

    published = PUBLISHED.get(dataset)
    if published is None:
        options = options_of(dataset, "", camera or "")
        return [open_sequence(dataset, root / name, **options) for name in names or [os.curdir]]
    if not names and published.whole is None:
        raise click.UsageError(
            f"--sequences is needed with --dataset {dataset}, for instance --sequences {published.example}."
        )
    try:
        asked = [options_of(dataset, name, camera or "") for name in names or [""]]
    except ConfigError as error:
        raise click.UsageError(str(error)) from None
    return [open_sequence(dataset, root, **options) for options in asked]
