"""URDF, a robot's description, whose links are frames and whose fixed joints are the transforms between them."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from calibnet.errors import DatasetError

ROOTS = ("robot", "joint")
"""Root elements of a whole description, and of a single joint, as in our own export."""


def transforms_of(robot: Element, path: Path) -> dict[str, Any]:
    """The fixed joints, as a list of transforms for `calibnet.datasets.calibration_files.transforms`.

    Moving joints are ignored, since their children have no fixed pose.

    Raises:
        DatasetError: it is an unexpanded xacro, or has no fixed joint.
    """
    found: list[dict[str, Any]] = []
    for joint in robot.iter("joint"):
        parent, child, origin = joint.find("parent"), joint.find("child"), joint.find("origin")
        if joint.get("type") != "fixed" or parent is None or child is None:
            continue
        said = {} if origin is None else origin.attrib
        triples = {"translation": said.get("xyz", "0 0 0").split(), "rpy_rad": said.get("rpy", "0 0 0").split()}
        found.append({"parent": parent.get("link", ""), "child": child.get("link", ""), **triples})
    texts = [word for one in found for value in one.values() for word in value]
    if any("xacro" in element.tag for element in robot.iter()) or any("$" in text for text in texts):
        raise DatasetError(f"Calibration {path} is a xacro; expand it: xacro {path.name} > robot.urdf.")
    if not found:
        raise DatasetError(f"Calibration {path} is a URDF without fixed joints; give one with camera and LiDAR.")
    return {"transforms": found}
