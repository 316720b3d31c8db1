"""The text of a calibration file as nested mappings, lists and numbers: YAML, JSON, and OpenCV's YAML, XML and JSON."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import yaml

from calibnet.errors import DatasetError

LARGEST_BYTES = 4_000_000
"""A calibration is a page; a larger file is something else, and would only take long to parse."""
MOST_VALUES = 100_000
OPENCV_YAML = "%YAML:1.0"


class Parsed(NamedTuple):
    """The content, and whether OpenCV's ``FileStorage`` wrote it."""

    content: Any
    is_opencv: bool


def parse(path: Path) -> Parsed:
    """Read and parse a file.

    Raises:
        DatasetError: it cannot be read, is none of these languages, or says a key twice.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise DatasetError(
            f"Calibration {path} cannot be read ({error.strerror}); write width, height, camera_matrix, distortion "
            "and camera_from_lidar there, or the file of another tool (docs/own-sensors.md)."
        ) from None
    if len(data) > LARGEST_BYTES:
        raise DatasetError(f"Calibration {path} has {len(data):,} bytes, so it is no calibration; give another file.")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise DatasetError(f"Calibration {path} is not a text file; give a YAML, JSON or XML file.") from None
    start = text.lstrip()
    try:
        if start.startswith("<"):
            return Parsed(_limited(_xml(text)), True)
        if start.startswith("{"):
            try:
                content = json.loads(text, object_pairs_hook=_distinct)
                return Parsed(_limited(content), "opencv-matrix" in text)
            except json.JSONDecodeError:
                pass  # a mapping of YAML in braces, perhaps
        is_opencv = start.startswith(OPENCV_YAML) or "!!opencv-matrix" in text
        if start.startswith(OPENCV_YAML):
            text = "\n" + start.partition("\n")[2]
        return Parsed(_limited(yaml.load(text, _Loader)), is_opencv)
    except (yaml.YAMLError, ElementTree.ParseError) as error:
        mark = getattr(error, "problem_mark", None)
        line = error.position[0] if isinstance(error, ElementTree.ParseError) else mark.line + 1 if mark else 0
        where, language = f" (line {line})" if line else "", "XML" if start.startswith("<") else "YAML"
        raise DatasetError(f"Calibration {path} is not valid {language}{where}; write it again.") from None
    except RecursionError:
        raise DatasetError(f"Calibration {path} is nested too deeply to be a calibration; give another file.") from None
    except (ValueError, OverflowError, TypeError) as error:  # a repeated key, or a date or number that is none
        raise DatasetError(f"Calibration {path} cannot be read: {error}; correct it there.") from None


class _Loader(yaml.SafeLoader):
    """YAML without anything that makes objects; a key that is there twice is an error, and OpenCV's tag a mapping."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        names = [str(key.value) for key, _ in node.value]
        _check_distinct(names, node.start_mark.line + 1)
        return super().construct_mapping(node, deep)


def _limited(content: Any) -> Any:
    """The content, if it is no more than a calibration can be; a few references of YAML may make it endless."""
    waiting, count = [content], 0
    while waiting:
        value = waiting.pop()
        count += 1
        if count > MOST_VALUES:
            raise ValueError("it holds far more values than a calibration has")
        if isinstance(value, dict):
            waiting.extend(value.values())
        elif isinstance(value, list):
            waiting.extend(value)
    return content


def _opencv_matrix(loader: yaml.SafeLoader, node: yaml.Node) -> Any:
    return loader.construct_mapping(node, deep=True) if isinstance(node, yaml.MappingNode) else None


_Loader.add_constructor("tag:yaml.org,2002:opencv-matrix", _opencv_matrix)


def _distinct(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    _check_distinct([name for name, _ in pairs])
    return dict(pairs)


def _check_distinct(names: list[str], line: int | None = None) -> None:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            below = "" if line is None else f" (in the mapping at line {line})"
            raise ValueError(f"the key {name!r} is there twice{below}")
        seen.add(name)


def _xml(text: str) -> dict[str, Any]:
    """The entries of an OpenCV storage; those of other XML files, which no reader will know, likewise."""
    return {child.tag: _xml_value(child) for child in ElementTree.fromstring(text)}


def _xml_value(element: ElementTree.Element) -> Any:
    children = list(element)
    if children and all(child.tag == "_" for child in children):
        return [_xml_value(child) for child in children]
    if children:
        return {child.tag: _xml_value(child) for child in children}
    words = (element.text or "").split()
    values = [_number(word) for word in words]
    if element.tag == "data" or len(values) > 1:
        return values
    return values[0] if values else None


def _number(word: str) -> Any:
    try:
        return int(word)
    except ValueError:
        try:
            return float(word)
        except ValueError:
            return word.strip('"')
