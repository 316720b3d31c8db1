"""The subcommands ``seq``, ``raw``, ``folder`` and so on of groups that say something of a sequence, such as verify."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from inspector.cli.inspect import (
    BAG_ONLY,
    FOLDER_ONLY,
    bag_options,
    camera_option,
    folder_options,
    nuscenes_options,
    open_bag,
    open_folder,
    open_kitti360,
    open_nuscenes,
    open_object,
    open_odometry,
    open_raw,
    open_tracking,
    perspective_option,
    root_option,
    split_option,
)
from inspector.cli.options import FOLDER
from inspector.cli.output import JSON_FILE
from inspector.cli.run import run_options


def over_sequences(group: click.Group, act: Callable[..., int]) -> None:
    """Give a group its subcommands, with all options of a calibration run and ``--json``.

    Args:
        group: that they belong to.
        act: called with what opens the sequence, and the options; returns the exit code.
    """

    def options(command: Callable[..., Any]) -> Callable[..., Any]:
        json_option = click.option(
            "--json", "json_file", type=JSON_FILE, metavar="FILE|-", help="The result as JSON; - for stdout."
        )
        return json_option(run_options(command))

    @group.command()
    @click.argument("sequence")
    @root_option
    @camera_option
    @options
    def seq(sequence: str, root: Path | None, camera: int, **asked: Any) -> int:
        """Of a KITTI odometry sequence, for instance 04."""
        return act(lambda: open_odometry(sequence, root, camera), camera=camera, **asked)

    @group.command()
    @click.argument("date")
    @click.argument("number", metavar="DRIVE")
    @root_option
    @camera_option
    @options
    def raw(date: str, number: str, root: Path | None, camera: int, **asked: Any) -> int:
        """Of a KITTI raw drive, for instance 2011_09_26 0005."""
        return act(lambda: open_raw(date, number, root, camera), camera=camera, **asked)

    @group.command()
    @click.argument("sequence")
    @root_option
    @camera_option
    @options
    def tracking(sequence: str, root: Path | None, camera: int, **asked: Any) -> int:
        """Of a KITTI tracking sequence, for instance 0004."""
        return act(lambda: open_tracking(sequence, root, camera), camera=camera, **asked)

    @group.command()
    @click.argument("number", metavar="DRIVE")
    @root_option
    @perspective_option
    @options
    def kitti360(number: str, root: Path | None, camera: int, **asked: Any) -> int:
        """Of a KITTI-360 drive, for instance 0003."""
        return act(lambda: open_kitti360(number, root, camera), camera=camera, **asked)

    @group.command()
    @click.argument("scene", required=False, default="")
    @nuscenes_options
    @options
    def nuscenes(scene: str, root: Path | None, camera: str, version: str, compensate: bool, **asked: Any) -> int:
        """Of a scene of nuScenes, for instance scene-0061."""
        return act(lambda: open_nuscenes(scene, root, camera, version, compensate), camera=camera, **asked)

    @group.command("object")
    @split_option
    @root_option
    @camera_option
    @options
    def object_(split: str, root: Path | None, camera: int, **asked: Any) -> int:
        """Of the KITTI object detection frames, which are of one calibration only where they are of one day."""
        return act(lambda: open_object(split, root, camera), camera=camera, **asked)

    @group.command()
    @click.argument("directory", type=FOLDER)
    @folder_options
    @options
    def folder(directory: Path, dataset: str, **asked: Any) -> int:
        """Of a folder with images/, clouds/ and calibration.yaml."""
        of_folder = {**asked}
        for name in FOLDER_ONLY:
            del asked[name]
        return act(lambda: open_folder(directory, dataset, of_folder), **asked)

    @group.command()
    @bag_options
    @options
    def bag(files: tuple[Path, ...], **asked: Any) -> int:
        """Of a ROS 1 or ROS 2 bag, or an MCAP file: of its /tf_static, or of --guess."""
        of_bag = {name: asked.pop(name) for name in BAG_ONLY}
        return act(lambda: open_bag(files, of_bag), **asked)
