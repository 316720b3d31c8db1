"""Names of a report's files in its folder, shared by the report and by pages that link to it."""

from __future__ import annotations

import itertools
from pathlib import Path

from calibnet.verdict import REJECTED

PAGE, METRICS, RECORDING = "index.html", "metrics.json", "recording.rrd"
PICTURES = "pictures"
"""Folder of the pictures."""
VIEWER = "viewer"
"""Folder of the web viewer's files, if they are kept beside the page."""
EXAMPLES = ("worst", "median", "best")
"""Names of the frames that are shown; a frame with several names appears once, under the last one."""
ALONE, AS_ONE, CORRECTED = "this frame alone", "whole drive as one", "corrected"
LEFT = f"{REJECTED} and left as it was"
"""What pictures show: a frame's own result, where another leads; that; its own alone; and one that is not believed."""


def picture_file(example: str, shown: str) -> str:
    """Path of the picture of an example frame, relative to the report's folder."""
    return f"{PICTURES}/{example}_{shown.replace(' ', '-')}.jpg"


def result_picture(folder: Path) -> str | None:
    """The picture that shows the result of a report, or else what it had, preferably of the median frame; or None."""
    kinds = itertools.product((AS_ONE, CORRECTED, LEFT), ("median", "best", "worst"))
    files = (picture_file(example, shown) for shown, example in kinds)
    return next((file for file in files if (folder / file).is_file()), None)
