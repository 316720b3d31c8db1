"""Parses calibration files to nested mappings, lists and numbers: YAML, JSON, XML, and OpenCV's dialects of these."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

from calibnet.datasets.calibration_files import launch, urdf
from calibnet.errors import DatasetError
from calibnet.runtime.reading import parse_json, parse_yaml, read_text

OPENCV_YAML, OPENCV_TAG = "%YAML:1.0", "!!opencv-matrix"
"""First line of OpenCV's YAML, which before version 3 has no space after a key, and its tag of a matrix."""
END_OF_MESSAGE = re.compile(r"^---[ \t]*$", re.MULTILINE)
"""Line that ROS's ``topic echo`` prints after every message."""
MOST_MESSAGES = 100
AS_EXTRINSIC = "write them as 'lidar_from_camera: {translation: [x, y, z], quaternion_xyzw: [x, y, z, w]}'"
UNREADABLE = {
    r"^(from [\w.]+ )?import \w": "is a program, which is not run; print its numbers, and " + AS_EXTRINSIC,
    r"\A(At time [\d.]+\s+)?- Translation: \[": "is printed by tf_echo, which does not name its frames; if that was "
    f"'tf2_echo LIDAR CAMERA', take translation and quaternion, and {AS_EXTRINSIC}",
    r"\A[-+\d.eE,;\s\[\]]{20,}\Z": "has numbers without a name, so the direction of the extrinsic is unknown; name its "
    "matrix 'camera_from_lidar: [[…], …]' or 'lidar_from_camera: [[…], …]'",
}
"""What cannot be read, as patterns of the start of a file, and what to do about it."""
REMEDY = (
    "write width, height, camera_matrix, distortion and camera_from_lidar to it, or give the file of another tool "
    "(docs/own-sensors.md)"
)


class Parsed(NamedTuple):
    """The content, and whether it was written by OpenCV's ``FileStorage``."""

    content: Any
    is_opencv: bool


def parse(path: Path) -> Parsed:
    """Read and parse a file.

    Raises:
        DatasetError: it cannot be read, is in another language, or has a key twice.
    """
    text = read_text(path, "Calibration", remedy=REMEDY)
    start = text.lstrip()
    if problem := next(
        (words for pattern, words in UNREADABLE.items() if re.search(pattern, start, re.MULTILINE)), None
    ):
        raise DatasetError(f"Calibration {path} {problem}.")
    if start.startswith("<"):
        try:
            root = ElementTree.fromstring(text)
            if root.tag in urdf.ROOTS:
                return Parsed(urdf.transforms_of(root, path), False)
            if root.tag == "launch":
                return Parsed(launch.of_xml(root), False)
            return Parsed({child.tag: _xml_value(child) for child in root}, True)
        except (ElementTree.ParseError, RecursionError) as error:
            line = error.position[0] if isinstance(error, ElementTree.ParseError) else 1
            raise DatasetError(f"Calibration {path} is not valid XML (line {line}); write it again.") from None
    try:
        if start.startswith("{"):
            return Parsed(parse_json(text), "opencv-matrix" in text)
    except ValueError:
        pass  # it may be a YAML mapping in braces
    is_opencv = start.startswith(OPENCV_YAML) or OPENCV_TAG in text
    if start.startswith(OPENCV_YAML):
        text = re.sub(r"^([ \t]*\w+):(?=\S)", r"\1: ", text, flags=re.MULTILINE)
    text = re.sub(r"\A\s*%YAML.*", "", text)  # the directive is not followed by a document marker
    parts = [part for part in re.split(END_OF_MESSAGE, text.replace(OPENCV_TAG, "")) if part.strip()]
    if len(parts) > MOST_MESSAGES:
        raise DatasetError(f"Calibration {path} has {len(parts)} messages separated by ---; keep one.")
    try:
        messages = [parse_yaml(part) for part in parts]
    except ValueError as problem:
        raise DatasetError(f"Calibration {path} is not valid YAML ({problem}); write it again.") from None
    return Parsed(_joined([one for one in messages if one is not None], path), is_opencv)


def _joined(messages: list[Any], path: Path) -> Any:
    """Join the messages printed by ``topic echo``: equal ones, or several with transforms.

    Raises:
        DatasetError: they contradict each other.
    """
    if len(messages) <= 1:
        return messages[0] if messages else None
    if all(isinstance(one, Mapping) and isinstance(one.get("transforms"), list) for one in messages):
        return {"transforms": [transform for one in messages for transform in one["transforms"]]}
    if any(_said(one) != _said(messages[0]) for one in messages):
        raise DatasetError(
            f"Calibration {path} has {len(messages)} different messages separated by ---; keep the right one."
        )
    return messages[0]


def _said(message: Any) -> Any:
    """A message without its header."""
    return {key: message[key] for key in message if key != "header"} if isinstance(message, Mapping) else message


def _xml_value(element: ElementTree.Element) -> Any:
    """A value of OpenCV's XML: a mapping, a sequence of ``_``, numbers or text."""
    children = list(element)
    if children and all(child.tag == "_" for child in children):
        return [_xml_value(child) for child in children]
    if children:
        return {child.tag: _xml_value(child) for child in children}
    values = [_number(word) for word in (element.text or "").split()]
    if element.tag == "data" or len(values) > 1:
        return values
    return values[0] if values else None


def _number(word: str) -> Any:
    for kind in (int, float):
        try:
            return kind(word)
        except ValueError:
            continue
    return word.strip('"')
