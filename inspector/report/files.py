"""Names of a report's files in its folder, for whoever writes them and for whoever shows a report from elsewhere."""

from __future__ import annotations

from pathlib import Path

from calibnet.verdict import REJECTED

PAGE, METRICS, RECORDING = "index.html", "metrics.json", "recording.rrd"
PICTURES = "pictures"
"""Folder of the examples' pictures."""
VIEWER = "viewer"
"""Folder of the web viewer's files, where they are kept beside the page."""
EXAMPLES = ("worst", "median", "best")
"""Frames that are shown; one that is several of them appears once, under a later name."""
ALONE, AS_ONE, CORRECTED = "this frame alone", "whole drive as one", "corrected"
LEFT = f"{REJECTED} and left as it was"
"""What pictures show: a frame's own result, where another leads; that; its own alone; and one that is not believed."""


def picture_file(example: str, shown: str) -> str:
    """The picture of an example frame, below the report's folder."""
    return f"{PICTURES}/{example}_{shown.replace(' ', '-')}.jpg"


def result_picture(folder: Path) -> str | None:
    """The picture of a report that shows its result best: on the middle frame, or on another one; None without any."""
    files = (picture_file(example, shown) for shown in (AS_ONE, CORRECTED) for example in ("median", "best", "worst"))
    return next((file for file in files if (folder / file).is_file()), None)
