"""``calib-inspect seq|raw|tracking|kitti360|nuscenes|object|folder|demo``: calibrate frames and record every stage."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from calibnet.datasets import dataset_names
from calibnet.errors import ConfigError
from inspector.cli.options import FOLDER
from inspector.cli.run import calibrate, run_options

if TYPE_CHECKING:
    from calibnet.datasets import Sequence
    from inspector.cli.viewing import Viewing

DEMO_LENGTH = 12

root_option = click.option("--root", type=FOLDER, envvar="KITTI_ROOT", help="The dataset's folder.  [env: KITTI_ROOT]")
camera_option = click.option(
    "--camera", type=click.IntRange(min=0), default=2, show_default=True, help="Camera to calibrate."
)
perspective_option = click.option(
    "--camera",
    type=click.IntRange(0, 3),
    default=0,
    show_default=True,
    help="Camera to calibrate: 0 and 1 look ahead, 2 and 3 are fisheyes to the sides.",
)
NUSCENES_OPTIONS = (
    click.option("--root", type=FOLDER, envvar="NUSCENES", help="The dataset's folder.  [env: NUSCENES]"),
    click.option("--camera", metavar="CHANNEL", default="CAM_FRONT", show_default=True, help="Camera to calibrate."),
    click.option("--version", default="", metavar="NAME", help="Folder of the tables.  [default: the only one]"),
    click.option(
        "--compensate/--as-taken",
        default=True,
        show_default=True,
        help="Move each scan to the time of its image, by the car's poses.",
    ),
)


def nuscenes_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command what says where nuScenes is and what of it is read."""
    for option in reversed(NUSCENES_OPTIONS):
        command = option(command)
    return command


split_option = click.option(
    "--split", default="training", show_default=True, help="training, testing, or a list in ImageSets."
)
dataset_option = click.option(
    "--dataset",
    type=click.Choice([name for name in dataset_names() if not name.startswith(("kitti-", "nuscenes"))]),
    default="folder",
    show_default=True,
    help="What the folder holds; packages can add to these.",
)
FOLDER_OPTIONS = (
    click.option(
        "--guess",
        type=click.Path(dir_okay=False, path_type=Path),
        metavar="FILE",
        help="Start from the extrinsic of this calibration file; needed where the folder's own has none.",
    ),
    click.option("--camera", metavar="NAME", help="Camera of a calibration file of several, for instance cam0."),
    click.option("--camera-frame", metavar="NAME", help="The camera's optical frame, in a file of many frames."),
    click.option("--lidar-frame", metavar="NAME", help="The LiDAR's frame, likewise."),
    click.option(
        "--max-time-difference",
        type=click.FloatRange(min=0),
        metavar="MS",
        help="Pair each image with the nearest scan within so many milliseconds, by timestamps.txt in both folders or "
        "by names that are times.  [default: by name; by time within 50 where names differ]",
    ),
)


BAG_OPTIONS = (
    click.argument("files", type=click.Path(path_type=Path), nargs=-1, required=True),
    click.option("--image", metavar="TOPIC", help="Of the images.  [default: the only one]"),
    click.option("--points", metavar="TOPIC", help="Of the point clouds.  [default: the only one]"),
    click.option("--info", metavar="TOPIC", help="Of the CameraInfo.  [default: the one beside the images]"),
    FOLDER_OPTIONS[0],
    *FOLDER_OPTIONS[2:4],
    click.option(
        "--every",
        type=click.FloatRange(min=0, min_open=True),
        metavar="S",
        help="A frame in so many seconds, at a standstill where there is one.  [default: about 40 frames]",
    ),
    click.option(
        "--accumulate",
        type=click.IntRange(1, 100),
        default=1,
        metavar="N",
        help="Put N scans together at a standstill, for scanners that do not repeat their pattern (Livox).",
    ),
    click.option(
        "--max-time-difference",
        type=click.FloatRange(min=0, min_open=True),
        metavar="MS",
        help="Milliseconds that an image and its scan may be apart.  [default: 50]",
    ),
)
BAG_ONLY = (
    *("image", "points", "info", "guess", "camera_frame", "lidar_frame"),
    *("every", "accumulate", "max_time_difference"),
)
"""Those of them that are fields of `calibnet.datasets.bag.BagOptions`."""


def bag_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command what says how a bag is read; it passes them on to `open_bag`."""
    for option in reversed(BAG_OPTIONS):
        command = option(command)
    return command


FOLDER_ONLY = ("guess", "camera_frame", "lidar_frame", "max_time_difference")
"""Those of them that are no fields of `RunOptions`."""


def folder_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command what says how a folder is read; it passes them on to `open_folder`."""
    for option in reversed(FOLDER_OPTIONS):
        command = option(command)
    return dataset_option(command)


@click.command()
@click.argument("sequence")
@root_option
@camera_option
@run_options
def seq(sequence: str, root: Path | None, camera: int, **asked: Any) -> int:
    """Calibrate a KITTI odometry sequence, for instance 04.

    --root is the folder that holds `sequences`.
    """
    return calibrate(open_odometry(sequence, root, camera), camera=camera, **asked)


@click.command()
@click.argument("date")
@click.argument("number", metavar="DRIVE")
@root_option
@camera_option
@run_options
def raw(date: str, number: str, root: Path | None, camera: int, **asked: Any) -> int:
    """Calibrate a KITTI raw drive, for instance 2011_09_26 0005.

    --root is the folder that holds the dates.
    """
    return calibrate(open_raw(date, number, root, camera), camera=camera, **asked)


@click.command()
@click.argument("sequence")
@root_option
@camera_option
@run_options
def tracking(sequence: str, root: Path | None, camera: int, **asked: Any) -> int:
    """Calibrate a sequence of the KITTI tracking benchmark, for instance 0004.

    --root is the folder that holds `training`.
    """
    return calibrate(open_tracking(sequence, root, camera), camera=camera, **asked)


@click.command("object")
@split_option
@root_option
@camera_option
@run_options
def object_(split: str, root: Path | None, camera: int, **asked: Any) -> int:
    """Calibrate the frames of the KITTI object detection benchmark.

    --root is the folder that holds `training`. Its frames are of several mounts, so they are no drive.
    """
    asked["drive"] = asked["drive"] or False
    return calibrate(open_object(split, root, camera), camera=camera, **asked)


@click.command()
@click.argument("number", metavar="DRIVE")
@root_option
@perspective_option
@run_options
def kitti360(number: str, root: Path | None, camera: int, **asked: Any) -> int:
    """Calibrate a drive of KITTI-360, for instance 0003.

    --root is the folder that holds `calibration`, `data_2d_raw` and `data_3d_raw`.
    """
    return calibrate(open_kitti360(number, root, camera), camera=camera, **asked)


@click.command()
@click.argument("scene", required=False, default="")
@nuscenes_options
@run_options
def nuscenes(scene: str, root: Path | None, camera: str, version: str, compensate: bool, **asked: Any) -> int:
    """Calibrate the keyframes of a scene of nuScenes, for instance scene-0061; the first one by default.

    --root is the folder that holds `samples` and the tables, `v1.0-mini`. Its SDK is not needed.
    """
    return calibrate(open_nuscenes(scene, root, camera, version, compensate), camera=camera, **asked)


@click.command()
@click.argument("directory", type=FOLDER)
@folder_options
@run_options
def folder(directory: Path, dataset: str, **asked: Any) -> int:
    """Calibrate your own images/, clouds/ and calibration.yaml, or the calibration file of another tool.

    Without --range and --miscalibrate the calibration.yaml is what is to be corrected; with them it
    is the reference.
    """
    sequence = open_folder(directory, dataset, asked)
    return calibrate(sequence, as_is=not disturbed(asked), **asked)


@click.command()
@bag_options
@run_options
def bag(files: tuple[Path, ...], **asked: Any) -> int:
    """Calibrate a ROS 1 or ROS 2 bag, or an MCAP file.

    FILES is a .bag, .db3 or .mcap file, the folder of a ROS 2 bag, or several .bag files of one drive. Topics are found
    where there is one of a kind; the lens comes from CameraInfo, and the first guess from /tf_static. Without --range
    and --miscalibrate that guess is what is to be corrected; with them it is the reference.
    """
    return calibrate(open_bag(files, asked), as_is=not disturbed(asked), **asked)


@click.command()
@click.option("--length", type=click.IntRange(min=1), default=DEMO_LENGTH, show_default=True, help="Frames to drive.")
@run_options
def demo(length: int, viewing: Viewing, report: Path | None, **asked: Any) -> int:
    """Calibrate a drive through the synthetic world: needs no data.

    The recording is kept in recordings/demo.rrd, or, where that is there, in demo-2.rrd and so on.
    """
    from calibnet.datasets.synthetic import KITTI_LIKE, SyntheticSequence

    if report is None:
        viewing = replace(viewing, keep="demo")
    drive = SyntheticSequence(seed=asked["seed"], length=length, rig=KITTI_LIKE)
    return calibrate(drive, viewing=viewing, report=report, **asked)


def open_folder(directory: Path, dataset: str, asked: dict[str, Any]) -> Sequence:
    """A plain folder, or a folder of a dataset of another package, which knows none of the `FOLDER_OPTIONS`.

    Args:
        directory: the folder.
        dataset: what it holds.
        asked: all options of the command; `FOLDER_ONLY` are taken out.
    """
    from calibnet.datasets import open_sequence
    from calibnet.datasets.calibration_files import FrameChoice

    frames = FrameChoice(asked.pop("camera_frame"), asked.pop("lidar_frame"))
    options = {
        "guess": asked.pop("guess"),
        "camera": asked["camera"],
        "frames": frames if any(frames) else None,
        "max_time_difference": asked.pop("max_time_difference"),
    }
    return open_sequence(dataset, directory, **{name: value for name, value in options.items() if value is not None})


def open_bag(files: tuple[Path, ...], asked: dict[str, Any]) -> Sequence:
    """A bag.

    Args:
        files: of the bag.
        asked: all options of the command; `BAG_ONLY` are taken out.
    """
    from calibnet.datasets.bag import Bag, BagOptions
    from calibnet.datasets.calibration_files import FrameChoice

    options = {name: asked.pop(name) for name in BAG_ONLY}
    frames = FrameChoice(options.pop("camera_frame"), options.pop("lidar_frame"))
    return Bag(files, BagOptions(frames=frames, **options))


def open_odometry(sequence: str, root: Path | None, camera: int) -> Sequence:
    """A sequence of KITTI odometry."""
    from calibnet.datasets import open_sequence

    return open_sequence("kitti-odometry", require_root(root, "odometry"), sequence=sequence, camera=camera)


def open_raw(date: str, number: str, root: Path | None, camera: int) -> Sequence:
    """A drive of KITTI raw."""
    from calibnet.datasets import open_sequence

    return open_sequence("kitti-raw", require_root(root, "raw"), date=date, drive=number, camera=camera)


def open_tracking(sequence: str, root: Path | None, camera: int) -> Sequence:
    """A sequence of KITTI tracking."""
    from calibnet.datasets import open_sequence

    return open_sequence("kitti-tracking", require_root(root, "tracking"), sequence=sequence, camera=camera)


def open_kitti360(drive: str, root: Path | None, camera: int) -> Sequence:
    """A drive of KITTI-360."""
    from calibnet.datasets import open_sequence

    return open_sequence("kitti-360", require_root(root, "360"), drive=drive, camera=camera)


def open_nuscenes(scene: str, root: Path | None, camera: str, version: str, compensate: bool) -> Sequence:
    """A scene of nuScenes."""
    from calibnet.datasets import open_sequence

    if root is None:
        raise ConfigError(
            "No nuScenes folder: give --root DIR or set NUSCENES to where nuScenes is unpacked (from nuscenes.org)."
        )
    return open_sequence("nuscenes", root, scene=scene, camera=camera, version=version, compensate=compensate)


def open_object(split: str, root: Path | None, camera: int) -> Sequence:
    """The frames of KITTI object detection."""
    from calibnet.datasets import open_sequence

    return open_sequence("kitti-object", require_root(root, "object detection"), split=split, camera=camera)


def disturbed(asked: Mapping[str, Any]) -> bool:
    """Whether the options of a run put a miscalibration on the dataset's extrinsic."""
    return asked["range"] is not None or asked["miscalibration"] is not None


def require_root(root: Path | None, part: str) -> Path:
    """The dataset's folder, or one sentence that says how to get one."""
    if root is None:
        raise ConfigError(
            f"No KITTI folder: give --root DIR or set KITTI_ROOT to where KITTI {part} is unpacked "
            "(from cvlibs.net/datasets/kitti); `calib-inspect demo` needs none."
        )
    return root
