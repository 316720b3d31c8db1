"""Launch files of ROS 1 and 2 (XML, YAML) that publish static transforms, such as our own export for ROS."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from calibnet.errors import DatasetError

PUBLISHER = "static_transform_publisher"


def is_known(content: Any) -> bool:
    """Whether the content is of a launch file."""
    return isinstance(content, Mapping) and isinstance(content.get("launch"), list)


def of_xml(root: Element) -> dict[str, Any]:
    """A launch file in XML, in the form of one in YAML."""
    return {"launch": [{"node": dict(node.attrib)} for node in root.iter("node")]}


def transforms_of(content: Mapping[Any, Any], path: Path) -> dict[str, Any]:
    """The transforms, as a list for `calibnet.datasets.calibration_files.transforms`.

    Raises:
        DatasetError: the file publishes none, or a number is filled in only at launch.
    """
    found = [_transform(arguments, path) for arguments in _published(content["launch"])]
    if not found:
        raise DatasetError(f"Calibration {path} is a launch file without a {PUBLISHER}; give a file that has one.")
    return {"transforms": found}


def _published(items: Any) -> Iterator[str]:
    """Arguments of every publisher, including those in groups."""
    for item in items if isinstance(items, list) else ():
        if not isinstance(item, Mapping):
            continue
        node = item.get("node")
        if isinstance(node, Mapping) and PUBLISHER in (node.get("exec"), node.get("type")):
            yield str(node.get("args", ""))
        yield from (one for value in item.values() for one in _published(value))


def _transform(arguments: str, path: Path) -> dict[str, Any]:
    if "$(" in arguments:
        raise DatasetError(
            f"Calibration {path}: {PUBLISHER} has arguments that are filled in at launch ({arguments[:80]}); replace "
            "them by numbers."
        )
    try:
        words = shlex.split(arguments)
    except ValueError:
        words = []
    if words and words[0].startswith("--"):
        named = {key.removeprefix("--"): value for key, value in zip(words[::2], words[1::2], strict=False)}
        given = {name: named.get(name, "0") for name in "xyz"}
        of_quaternion = any(name in named for name in ("qx", "qy", "qz", "qw"))
        for name in ("qx", "qy", "qz", "qw") if of_quaternion else ("roll", "pitch", "yaw"):
            given[name] = named.get(name, "1" if name == "qw" else "0")
        frames = [named.get("frame-id"), named.get("child-frame-id")]
    else:
        count = next((place for place, word in enumerate(words) if not re.fullmatch(r"[-+.\deE]+", word)), len(words))
        names = ("x", "y", "z", *(("qx", "qy", "qz", "qw") if count == 7 else ("yaw", "pitch", "roll")))
        given = dict(zip(names, words, strict=False)) if count in (6, 7) else {}
        frames = [*words[count:], None, None][:2]
    if not given or None in frames:
        raise DatasetError(
            f"Calibration {path}: the arguments of {PUBLISHER} ({arguments[:80]}) are not of the form --x … "
            "--child-frame-id "
            "or x y z, yaw pitch roll or qx qy qz qw, and two frames; correct them."
        )
    return {"parent": frames[0], "child": frames[1], **given}
