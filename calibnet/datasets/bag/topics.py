"""Finds the topics of camera and LiDAR in a bag: the only one of a kind, or the one that the user names."""

from __future__ import annotations

import re
from collections.abc import Sequence

from calibnet.datasets.bag.messages import DEPTH, IMAGES, INFOS, PACKETS, POINTS
from calibnet.datasets.bag.recording import BagRecording, Topic
from calibnet.errors import DatasetError

SUFFIXES = ("/compressed", "/image_raw", "/image_color", "/image_rect_color", "/image_rect", "/image_mono", "/image")
"""Suffixes of image topics after the camera's name, which are removed one after the other."""
RECTIFIED = re.compile(r"(?<![a-z])rect(ified)?(?![a-z])", re.IGNORECASE)
"""Pattern in the names of topics of rectified images, such as ``image_rect_color``."""


def found_topic(bag: BagRecording, asked: str | None, types: Sequence[str], option: str, what: str) -> str:
    """The requested topic, or the only one of some types.

    If images are both raw and compressed, the compressed topic is used.

    Raises:
        DatasetError: there is none, or there are several to choose from; the message lists them.
    """
    found = [topic for topic in bag.of_type(types) if not topic.name.endswith(f"/{DEPTH}")]
    if asked is not None:
        if asked in [topic.name for topic in found]:
            return asked
        raise DatasetError(f"Bag {bag} has no {what} in {asked!r}; {_listed(found, what, bag)}.")
    compressed = {topic.name.removesuffix("/compressed") for topic in found if topic.name.endswith("/compressed")}
    found = [topic for topic in found if topic.name not in compressed]
    if len(found) == 1:
        return found[0].name
    if not found:
        packets = [topic.name for topic in bag.topics if types == POINTS and PACKETS.search(topic.type)]
        if packets:
            raise DatasetError(
                f"Bag {bag} has no {what}, only a scanner's packets in {packets[0]}; play it with the scanner's driver "
                "running, and record the PointCloud2 that this publishes."
            )
        raise DatasetError(f"Bag {bag} has no {what}; {_listed(bag.topics, 'messages', bag)}.")
    raise DatasetError(
        f"Bag {bag} has several topics of {what}; choose one with --{option}: {_listed(found, what, bag)}."
    )


def info_of(bag: BagRecording, asked: str | None, image: str) -> str | None:
    """The topic of the camera's calibration: the requested one, the one beside the images, or the only one; else None.

    The only one that is not beside the images is used if it cannot belong to other images in the bag.

    Raises:
        DatasetError: the requested one does not exist, or there are several.
    """
    infos = bag.of_type(INFOS)
    names = [topic.name for topic in infos]
    if asked is not None:
        if asked in names:
            return asked
        raise DatasetError(f"Bag {bag} has no CameraInfo in {asked!r}; {_listed(infos, 'CameraInfo', bag)}.")
    camera = camera_of(image)
    above = {name: name.rpartition("/")[0] for name in names}
    own = [name for name in names if above[name] == camera or above[name] == image.removesuffix("/compressed")]
    beside = [name for name in names if above[name] in (camera, camera.rpartition("/")[0]) and camera]
    cameras = {camera_of(topic.name) for topic in bag.of_type(IMAGES)}
    for found in (own, beside, names if len(cameras) == 1 else []):
        if len(found) == 1:
            return found[0]
    if not names:
        return None
    listed = _listed(infos, "CameraInfo", bag)
    raise DatasetError(
        f"Bag {bag} has several CameraInfo topics for {image}; choose one with --info, or give the camera's "
        f"calibration with --guess FILE: {listed}."
    )


def camera_of(image: str) -> str:
    """The camera's name, from that of its image topic."""
    for suffix in SUFFIXES:
        image = image.removesuffix(suffix)
    return image


def is_rectified(image: str) -> bool:
    """Whether the name of an image topic is that of images rectified by ``image_proc``."""
    return bool(RECTIFIED.search(image))


def _listed(topics: Sequence[Topic], what: str, bag: BagRecording) -> str:
    if not topics:
        return f"there are no {what} at all"
    rows = ", ".join(f"{topic.name} ({topic.messages} {topic.type.rpartition('/')[2]})" for topic in topics[:20])
    return f"there are: {rows}"
