"""Which topics of a bag are the camera's and the LiDAR's: the only one of a kind, or one that the user names."""

from __future__ import annotations

from collections.abc import Sequence

from calibnet.datasets.bag.messages import INFOS
from calibnet.datasets.bag.recording import BagRecording, Topic
from calibnet.errors import DatasetError

SUFFIXES = ("/compressed", "/image_raw", "/image_color", "/image_rect_color", "/image_rect", "/image_mono", "/image")
"""What an image's topic ends with, beyond the camera's name; taken off one after the other."""


def found_topic(bag: BagRecording, asked: str | None, types: Sequence[str], option: str, what: str) -> str:
    """The topic that is asked for, or the only one of some types.

    Of the same images raw and compressed, the compressed ones are taken: that is one topic in two forms.

    Raises:
        DatasetError: there is none, or one of several has to be named; the message lists them.
    """
    found = bag.of_type(types)
    if asked is not None:
        if asked in [topic.name for topic in found]:
            return asked
        raise DatasetError(f"Bag {bag} has no {what} in {asked!r}; {_listed(found, what, bag)}.")
    compressed = {topic.name.removesuffix("/compressed") for topic in found if topic.name.endswith("/compressed")}
    found = [topic for topic in found if topic.name not in compressed]
    if len(found) == 1:
        return found[0].name
    if not found:
        raise DatasetError(f"Bag {bag} holds no {what}; {_listed(bag.topics, 'messages', bag)}.")
    raise DatasetError(
        f"Bag {bag} holds several topics of {what}, choose one with --{option}; {_listed(found, what, bag)}."
    )


def info_of(bag: BagRecording, asked: str | None, image: str) -> str | None:
    """The topic of the camera's calibration: asked for, beside the images, or the only one; None where there is none.

    Raises:
        DatasetError: what is asked for is not there, or it is one of several.
    """
    infos = bag.of_type(INFOS)
    names = [topic.name for topic in infos]
    if asked is not None:
        if asked in names:
            return asked
        raise DatasetError(f"Bag {bag} has no CameraInfo in {asked!r}; {_listed(infos, 'CameraInfo', bag)}.")
    camera = image
    for suffix in SUFFIXES:
        camera = camera.removesuffix(suffix)
    beside = [name for name in names if name.rpartition("/")[0] in (camera, camera.rpartition("/")[0]) and camera]
    for found in ([name for name in names if name.rpartition("/")[0] == camera], beside, names):
        if len(found) == 1:
            return found[0]
    if not names:
        return None
    listed = _listed(infos, "CameraInfo", bag)
    raise DatasetError(f"Bag {bag} holds several topics of CameraInfo, choose that of {image} with --info; {listed}.")


def _listed(topics: Sequence[Topic], what: str, bag: BagRecording) -> str:
    if not topics:
        return f"there are no {what} at all"
    rows = ", ".join(f"{topic.name} ({topic.messages} {topic.type.rpartition('/')[2]})" for topic in topics[:20])
    return f"there are: {rows}"
