"""Sources of frames: one module per source, each a `Sequence`, opened by name with `open_sequence`.

Importing this package is cheap; a source's module (and OpenCV with it) is
imported when a sequence of it is opened.
"""

from calibnet.datasets.frame import Frame, Sequence
from calibnet.datasets.registry import DATASETS, dataset_names, open_sequence
from calibnet.datasets.selection import PickedFrames, select_frames

__all__ = ["DATASETS", "Frame", "PickedFrames", "Sequence", "dataset_names", "open_sequence", "select_frames"]
