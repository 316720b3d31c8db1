"""What a dataset promises: `check_dataset`."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Callable

import numpy as np

from calibnet.conformance.requirement import require, require_rigid
from calibnet.datasets.frame import Frame, Sequence, index_of


def check_dataset(open_: Callable[[], Sequence]) -> None:
    """Hold a sequence of a dataset to the promises of `Sequence` and `Frame`.

    Args:
        open_: opens the same sequence at every call; a short one, for all its frames are read.

    Raises:
        AssertionError: one of them is not kept; the sentence says which.
    """
    sequence = open_()
    require(isinstance(sequence, Sequence), "A sequence has name, rig, __len__, __getitem__ and __iter__.")
    require(isinstance(sequence.name, str) and bool(sequence.name), "The sequence has no name.")
    require(isinstance(sequence.rig, str) and bool(sequence.rig), f"{sequence.name} has no rig.")
    require(len(sequence) > 0, f"{sequence.name} has no frames.")
    frames = list(sequence)
    require(len(frames) == len(sequence), f"{sequence.name} has {len(sequence)} frames and yields {len(frames)}.")
    for frame in frames:
        check_frame(frame)
    _check_order(frames)
    for position, frame in enumerate(frames):
        told = index_of(sequence, position)
        require(told == frame.index, f"Frame {frame.index} has the number {told} before it is read, see `Numbered`.")
    _check_reading(sequence, frames)
    _same(frames[0], open_()[0], "opened again")


def check_frame(frame: Frame) -> None:
    """Hold one frame to the promises of `Frame`: shapes, types, units and axes."""
    name = f"frame {frame.index}"
    require(bool(frame.source), f"The source of {name} is empty; messages name it.")
    require(frame.image.dtype == np.uint8, f"The image of {name} is {frame.image.dtype} and not uint8.")
    size = (frame.camera.height, frame.camera.width, 3)
    require(frame.image.shape == size, f"The image of {name} is {frame.image.shape}, its camera says {size}.")
    matrix = frame.camera.matrix
    require(matrix.shape == (3, 3) and matrix.dtype == np.float64, f"The camera matrix of {name} is not 3x3 float64.")
    require(bool((matrix[2] == [0, 0, 1]).all()), f"The last row of the camera matrix of {name} is not 0 0 1.")
    require(min(frame.camera.focal) > 0, f"The focal lengths of {name} are not positive.")
    points = frame.points
    require(points.dtype == np.float32, f"The points of {name} are {points.dtype} and not float32.")
    require(points.ndim == 2 and points.shape[1] == 4, f"The points of {name} are {points.shape} and not [N, 4].")
    require(len(points) > 0, f"The scan of {name} is empty.")
    require(bool(np.isfinite(points).all()), f"Points of {name} are not finite.")
    intensity = points[:, 3]
    require(0 <= intensity.min() <= intensity.max() <= 1, f"Intensities of {name} are outside 0..1.")
    require(frame.camera_from_lidar.dtype == np.float64, f"The extrinsic of {name} is not float64.")
    require_rigid(frame.camera_from_lidar, f"the extrinsic of {name}")


def _check_order(frames: list[Frame]) -> None:
    indices, times = [frame.index for frame in frames], [frame.timestamp for frame in frames]
    require(all(one < two for one, two in itertools.pairwise(indices)), f"Indices are not ascending: {indices}.")
    require(times[0] == 0.0, f"The first frame is at {times[0]} s and not at 0.")
    require(times == sorted(times), f"Times are not ascending: {times}.")


def _check_reading(sequence: Sequence, frames: list[Frame]) -> None:
    """Check reading by position: from either end, repeatedly, and not beyond the end."""
    for position, frame in enumerate(frames):
        _same(frame, sequence[position], f"read at position {position}")
    _same(frames[-1], sequence[-1], "read at position -1")
    first = sequence[0]
    before = copy.deepcopy(first)
    first.image[:] = 255 - first.image
    first.points[:] = 0
    _same(before, sequence[0], "read after another reading of it was changed")
    try:
        sequence[len(sequence)]
    except IndexError:
        return
    require(False, f"Position {len(sequence)} of {len(sequence)} frames raises no IndexError.")


def _same(one: Frame, other: Frame, when: str) -> None:
    same = one.index == other.index and one.timestamp == other.timestamp and one.source == other.source
    same = same and np.array_equal(one.image, other.image) and np.array_equal(one.points, other.points)
    require(same and np.array_equal(one.camera_from_lidar, other.camera_from_lidar), f"A frame differs when {when}.")
