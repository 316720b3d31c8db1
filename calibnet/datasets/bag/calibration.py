"""Camera and first guess of a bag, from its own messages or from a file of the user."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from calibnet.datasets.bag.messages import TRANSFORMS, camera_info_of, links_of
from calibnet.datasets.bag.recording import BagRecording
from calibnet.datasets.bag.topics import info_of, is_rectified
from calibnet.datasets.calibration_files import FrameChoice, Wanted, read_calibration, ros
from calibnet.datasets.calibration_files.frames import Link, camera_from_lidar
from calibnet.datasets.plausibility import Implausible, of_camera, of_extrinsic, of_lens, rectification, refuse
from calibnet.errors import DatasetError
from calibnet.geometry.camera_model import CameraModel
from calibnet.geometry.rectification import central
from calibnet.geometry.types import Extrinsic

MOST_TRANSFORMS = 2000
"""Largest number of messages read from a topic of transforms."""


class BagCalibration(NamedTuple):
    """Calibration of the sensors of a bag.

    Attributes:
        camera: the camera with its lens.
        camera_from_lidar: the first guess, 4x4.
        remarks: unlikely findings.
    """

    camera: CameraModel
    camera_from_lidar: Extrinsic
    remarks: tuple[Implausible, ...]


def read(
    bag: BagRecording, image: str, frames: FrameChoice, info: str | None, guess: Path | None, wanted: Wanted
) -> BagCalibration:
    """Read the calibration of a bag.

    Args:
        bag: the recording.
        image: topic of the images.
        frames: the coordinate frames that images and scans are in.
        info: topic of the CameraInfo; None to find it.
        guess: a calibration file that takes precedence, except for the camera if ``info`` is given.
        wanted: what to use of that file.

    Raises:
        DatasetError: something is missing or cannot be right.
    """
    given = None if guess is None else read_calibration(guess, wanted)
    if given is not None and given.camera is None and given.camera_from_lidar is None:
        raise DatasetError(
            f"Calibration {guess} has neither a camera nor the pose of the LiDAR; give a file that has one of them."
        )
    remarks: list[Implausible | None] = []
    if given is not None and given.camera is not None and info is None:
        camera = given.camera
    else:
        camera, mixed = _of_info(bag, info, image)
        remarks.append(mixed)
    extrinsic = None if given is None else given.camera_from_lidar
    extrinsic = _of_transforms(bag, frames) if extrinsic is None else extrinsic
    remarks += [*of_lens(camera), *of_camera(central(camera).pinhole), *of_extrinsic(extrinsic)]
    where = f"Calibration of {image} in {bag}" + (f", with {guess}" if guess else "")
    return BagCalibration(camera, extrinsic, refuse(remarks, where))


def _of_info(bag: BagRecording, asked: str | None, image: str) -> tuple[CameraModel, Implausible | None]:
    """The camera of the images' CameraInfo, and an unlikely finding about it."""
    info = info_of(bag, asked, image)
    if info is None:
        raise DatasetError(
            f"Bag {bag} has no CameraInfo of {image}; give the camera's calibration with --guess FILE, or its topic "
            "with --info."
        )
    where = Path(f"{bag}, {info}")
    content = ros.as_stored(camera_info_of(bag.message(info).content), where)
    rectified = is_rectified(image)
    camera = ros.camera(content, where, rectified)
    projection, rotation = np.array(content["P"]), np.array(content["R"])
    if rectified or projection.size != 12 or rotation.size != 9:
        return camera, None
    return camera, rectification(camera, rotation.reshape(3, 3), projection.reshape(3, 4)[:, :3])


def _of_transforms(bag: BagRecording, frames: FrameChoice) -> Extrinsic:
    topics = bag.of_type(TRANSFORMS)
    static = [topic for topic in topics if topic.name.endswith("tf_static")]
    links = [
        link
        for topic in static or topics
        for message in bag.messages(topic.name, most=MOST_TRANSFORMS)
        for link in links_of(message.content)
    ]
    where = f"{bag}, {' and '.join(topic.name for topic in static or topics)}"
    links = links if static else steady(links)
    if not links:
        raise DatasetError(
            f"Bag {bag} has no /tf_static with the pose of the LiDAR; give a first guess with --guess FILE."
        )
    return camera_from_lidar(links, frames, where)


def steady(links: Sequence[Link]) -> list[Link]:
    """The transforms that never change, where static ones are published among the others."""
    told: dict[tuple[str, str], list[Link]] = {}
    for link in links:
        told.setdefault((link.parent, link.child), []).append(link)
    return [
        same[0]
        for same in told.values()
        if all(np.allclose(one.parent_from_child, same[0].parent_from_child, atol=1e-6) for one in same)
    ]
