"""The text of a calibration file as nested mappings, lists and numbers: YAML, JSON, and OpenCV's YAML, XML and JSON."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

from calibnet.errors import DatasetError
from calibnet.runtime.reading import parse_json, parse_yaml, read_text

OPENCV_YAML, OPENCV_TAG = "%YAML:1.0", "!!opencv-matrix"
REMEDY = (
    "write width, height, camera_matrix, distortion and camera_from_lidar there, or give the file of another tool "
    "(docs/own-sensors.md)"
)


class Parsed(NamedTuple):
    """The content, and whether OpenCV's ``FileStorage`` wrote it."""

    content: Any
    is_opencv: bool


def parse(path: Path) -> Parsed:
    """Read and parse a file.

    Raises:
        DatasetError: it cannot be read, is none of these languages, or says a key twice.
    """
    text = read_text(path, "Calibration", remedy=REMEDY)
    start = text.lstrip()
    if start.startswith("<"):
        try:
            return Parsed({child.tag: _xml_value(child) for child in ElementTree.fromstring(text)}, True)
        except (ElementTree.ParseError, RecursionError) as error:
            line = error.position[0] if isinstance(error, ElementTree.ParseError) else 1
            raise DatasetError(f"Calibration {path} is not valid XML (line {line}); write it again.") from None
    try:
        if start.startswith("{"):
            return Parsed(parse_json(text), "opencv-matrix" in text)
    except ValueError:
        pass  # a mapping of YAML in braces, perhaps
    is_opencv = start.startswith(OPENCV_YAML) or OPENCV_TAG in text
    text = text.replace(OPENCV_YAML, "", 1).replace(OPENCV_TAG, "")
    try:
        return Parsed(parse_yaml(text), is_opencv)
    except ValueError as problem:
        raise DatasetError(f"Calibration {path} is not valid YAML ({problem}); write it again.") from None


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
