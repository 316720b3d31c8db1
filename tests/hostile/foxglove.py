"""MCAP files of Foxglove's schemas whose messages say what is not so."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.hostile.bags import small_frame
from tests.hostile.inputs import RUN
from tests.hostile.rows import BAD, FINE, Make, Row
from tests.support.foreign_mcap import ForeignMcap, write_foxglove

HUGE = 2**31 - 1
CHANGES: dict[str, tuple[str, dict[str, Any]]] = {
    "points of 2 billion bytes each": ("/lidar", {"point_stride": HUGE}),
    "points of no bytes": ("/lidar", {"point_stride": 0}),
    "points of a byte": ("/lidar", {"point_stride": 1}),
    "points without fields": ("/lidar", {"fields": []}),
    "a field behind the point": ("/lidar", {"fields": [{"name": n, "offset": HUGE, "type": 7} for n in "xyz"]}),
    "a field of no type": ("/lidar", {"fields": [{"name": n, "offset": 0, "type": 99} for n in "xyz"]}),
    "two fields called x": ("/lidar", {"fields": [{"name": "x", "offset": 4 * n, "type": 7} for n in range(3)]}),
    "a field without a name": ("/lidar", {"fields": [{"name": "", "offset": 0, "type": 7}]}),
    "no points": ("/lidar", {"data": ""}),
    "points in a pose": ("/lidar", {"pose": {"position": {"x": 1.0, "y": 0.0, "z": 0.0}}}),
    "points in a frame of escapes": ("/lidar", {"frame_id": "a\x1b[2J\nb"}),
    "a picture of noise": ("/cam/image", {"data": base64.b64encode(b"noise" * 99).decode()}),
    "an empty picture": ("/cam/image", {"data": ""}),
    "a camera of 4 billion pixels": ("/cam/calibration", {"width": HUGE, "height": HUGE}),
    "a camera of no size": ("/cam/calibration", {"width": 0, "height": 0}),
    "a camera of another size": ("/cam/calibration", {"width": 99}),
    "a camera of NaN": ("/cam/calibration", {"K": ["NaN"] * 9}),
    "a camera of 4 numbers": ("/cam/calibration", {"K": [1.0] * 4}),
    "a lens of a thousand numbers": ("/cam/calibration", {"D": [0.1] * 1000}),
    "a lens that there is not": ("/cam/calibration", {"distortion_model": "eye"}),
    "a lens called by an escape": ("/cam/calibration", {"distortion_model": "\x1b[2J"}),
    "transforms of NaN": ("/tf", {"translation": {"x": "NaN", "y": 0.0, "z": 0.0}}),
    "transforms without a turn": ("/tf", {"rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 0.0}}),
    "transforms of one frame": ("/tf", {"parent_frame_id": "lidar", "child_frame_id": "lidar"}),
    "transforms that are none": ("/tf", {"transforms": []}),
}
TIMES: dict[str, tuple[str, dict[str, Any]]] = {
    "a time of the year 292 billion": ("/cam/image", {"timestamp": {"seconds": 2**63 - 1, "nanos": 0}}),
    "a time before all": ("/lidar", {"timestamp": {"seconds": -(2**63), "nanos": -1}}),
}
JSON: dict[str, tuple[str, dict[str, Any]]] = {
    "a stride that is a word": ("/lidar", {"point_stride": "wide"}),
    "a stride that is a fraction": ("/lidar", {"point_stride": 16.5}),
    "a stride below nothing": ("/lidar", {"point_stride": -16}),
    "fields that are a number": ("/lidar", {"fields": 7}),
    "points that are no base64": ("/lidar", {"data": "\u00fc!"}),
    "points of null": ("/lidar", {"data": None}),
    "a camera of words": ("/cam/calibration", {"K": ["a"] * 9}),
    "a matrix that is a number": ("/cam/calibration", {"K": 3}),
    "a width of 400 digits": ("/cam/calibration", {"width": int("9" * 400)}),
    "a place that is a word": ("/tf", {"translation": {"x": "far", "y": 0.0, "z": 0.0}}),
    "an offset that is a word": ("/lidar", {"fields": [{"name": n, "offset": "a", "type": 7} for n in "xyz"]}),
    "transforms that are a word": ("/tf", {"transforms": "none"}),
    "a time of null": ("/cam/image", {"timestamp": None}),
}


class _Changed(ForeignMcap):
    """Writes the messages of one topic changed; of transforms, each of them."""

    def __init__(self, path: Path, encoding: str, topic: str, change: dict[str, Any]) -> None:
        super().__init__(path, encoding)
        self._topic, self._change = topic, change

    def write(self, topic: str, name: str, content: Any, at: float, definition: str = "") -> None:
        if topic == self._topic:
            if "transforms" in content and "transforms" not in self._change:
                content = {"transforms": [one | self._change for one in content["transforms"]]}
            else:
                content = content | self._change
        super().write(topic, name, content, at, definition)


def said(encoding: str, topic: str, change: dict[str, Any]) -> Make:
    """Calibrate a frame of a file in which one topic's messages are changed."""

    def made(root: Path) -> list[str]:
        write_foxglove(
            root / "bag.mcap", encoding, [small_frame()], bag=_Changed(root / "bag.mcap", encoding, topic, change)
        )
        return ["bag", "bag.mcap", *RUN]

    return made


def rows() -> Iterator[Row]:
    """Of both encodings."""
    for encoding in ("json", "protobuf"):
        yield Row(f"Foxglove's {encoding} that is whole", said(encoding, "", {}), FINE, ("Saved",))
        for what, (topic, change) in CHANGES.items():
            yield Row(f"Foxglove's {encoding}: {what}", said(encoding, topic, change), BAD, ("bag.mcap",))
        for what, (topic, change) in TIMES.items():
            yield Row(
                f"Foxglove's {encoding}: {what}", said(encoding, topic, change), BAD, ("/lidar", "different clocks")
            )
    for what, (topic, change) in JSON.items():
        yield Row(f"Foxglove's json: {what}", said("json", topic, change), BAD, ("bag.mcap",))
