"""A bag as a sequence of frames: finds topics, pairs images and scans by their stamps, and reads the calibration."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.bag import calibration
from calibnet.datasets.bag.messages import IMAGES, POINTS, columns_of, levels_of
from calibnet.datasets.bag.moments import STILL_M, motion, periods, standing, stillest
from calibnet.datasets.bag.recording import BagRecording, Stamped
from calibnet.datasets.bag.topics import found_topic
from calibnet.datasets.calibration_files import BY_NAME, FrameChoice, Wanted
from calibnet.datasets.clouds.columns import CloudError, points_of
from calibnet.datasets.clouds.plausibility import of_scan
from calibnet.datasets.clouds.scans import clean_points, full_scale_of
from calibnet.datasets.folder import DEPTHS_LOOKED_AT
from calibnet.datasets.frame import Frame
from calibnet.datasets.images.development import Development, ImageError, Levels
from calibnet.datasets.images.lens import Lens
from calibnet.datasets.images.plausibility import bit_depth, mosaic
from calibnet.datasets.pairing import MAX_TIME_DIFFERENCE_MS, WORTH_A_WARNING_MS
from calibnet.datasets.plausibility import refuse
from calibnet.datasets.selection import evenly_spaced
from calibnet.errors import DatasetError


@dataclass(frozen=True)
class BagOptions:
    """Options for reading a bag.

    Attributes:
        image: topic of the images; None to find it, as for the other topics.
        points: topic of the point clouds.
        info: topic of the camera's calibration.
        guess: file with the initial extrinsic, the camera, or both, to use instead of the bag's.
        camera: name of the camera, if ``guess`` has several.
        frames: names of the coordinate frames; by default those of the messages.
        every: seconds from one frame to the next; None for about 40 frames.
        accumulate: number of scans to accumulate at a standstill, for scanners with a non-repeating pattern.
        max_time_difference: largest time between an image and its scan, in milliseconds.
        by_recording_time: pair by the times of recording, if the clocks of camera and LiDAR differ.
    """

    image: str | None = None
    points: str | None = None
    info: str | None = None
    guess: Path | None = None
    camera: str | None = None
    frames: FrameChoice = BY_NAME
    every: float | None = None
    accumulate: int = 1
    max_time_difference: float | None = None
    by_recording_time: bool = False


@dataclass(frozen=True)
class Moment:
    """An image and its scans, by their recording times."""

    image: Stamped
    scans: tuple[Stamped, ...]


class Bag:
    """Frames of one camera and one LiDAR in a bag; a `calibnet.datasets.frame.Sequence`."""

    def __init__(self, paths: Sequence[Path], options: BagOptions = BagOptions()) -> None:
        """Open a bag.

        Args:
            paths: a ``.bag``, ``.db3`` or ``.mcap`` file, a ROS 2 bag's folder, or several files of ROS 1.
            options: options for reading it.

        Raises:
            DatasetError: it cannot be read, a topic is missing or ambiguous, nothing pairs, or camera or guess are
                unknown.
        """
        self._bag, self._options = BagRecording(paths), options
        self.image = found_topic(self._bag, options.image, IMAGES, "image", "images")
        self.points = found_topic(self._bag, options.points, POINTS, "points", "point clouds")
        images, scans = (
            [one.as_recorded() if options.by_recording_time else one for one in self._bag.times(topic)]
            for topic in (self.image, self.points)
        )
        first_image = self._bag.message(self.image).content
        first_scan = self._bag.message(self.points).content
        frames = FrameChoice(
            options.frames.camera or str(first_image.header.frame_id).lstrip("/") or None,
            options.frames.lidar or str(first_scan.header.frame_id).lstrip("/") or None,
        )
        looked_at = list[NDArray[np.uint8]]()
        self._development = Development()
        with suppress(ImageError):  # each frame reports its own error
            first = levels_of(first_image)
            self._development = Development.of([first] if first.dtype == np.uint8 else self._some_levels(images))
            looked_at = [self._development(first)]
        size = looked_at[0].shape[1::-1] if looked_at else None
        wanted = Wanted(options.camera, options.frames, size)
        camera, self.camera_from_lidar, self._remarks = calibration.read(
            self._bag, self.image, frames, options.info, options.guess, wanted
        )
        if camera.is_pinhole or any(one.shape[:2] != (camera.height, camera.width) for one in looked_at):
            looked_at = []
        self._lens = Lens.of(camera, self.camera_from_lidar, looked_at)
        self.name = f"bag/{Path(self._bag.paths[0]).stem}"
        self.rig = f"{self.image}, {self.points}"
        self._full_scale = full_scale_of(self._intensities(scans))
        self.moments, notes = self._moments(images, scans)
        self.notes = (*notes, *self._lens.notes)

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.moments)

    def __iter__(self) -> Iterator[Frame]:
        """Read the frames in order."""
        return (self[position] for position in range(len(self)))

    def __getitem__(self, position: int) -> Frame:
        """Read one frame.

        Raises:
            DatasetError: one of its messages is damaged, or has content that cannot be right.
            IndexError: there is no such position.
        """
        position = range(len(self))[position]
        moment, camera = self.moments[position], self._lens.camera
        where = f"{self._bag}, {self.image} at {moment.image.seconds:.3f} s"
        try:
            taken = self._development(levels_of(self._bag.message(self.image, moment.image.recorded).content))
        except ImageError as error:
            raise DatasetError(f"The image of {where} {error}.") from None
        if taken.shape[:2] != (camera.height, camera.width):
            raise DatasetError(
                f"The image of {where} is {taken.shape[1]}x{taken.shape[0]} but its calibration is for "
                f"{camera.width}x{camera.height}; give the topic of the images that were calibrated."
            )
        points = np.concatenate([self._scan(scan) for scan in moment.scans])
        image, original, faces = self._lens(taken)
        remarks = refuse([bit_depth(taken), mosaic(taken)], f"Image of {where}")
        remarks += refuse(of_scan(points), f"Scan of {where}")
        return Frame(
            index=position,
            timestamp=moment.image.seconds - self.moments[0].image.seconds,
            image=image,
            points=points,
            camera=self._lens.pinhole,
            camera_from_lidar=self.camera_from_lidar,
            source=where,
            remarks=self._remarks + remarks,
            original=original,
            faces=faces,
        )

    def _some_levels(self, images: Sequence[Stamped]) -> list[Levels]:
        """Some images spread over the bag, as stored."""
        found = list[Levels]()
        for position in evenly_spaced(len(images), DEPTHS_LOOKED_AT):
            with suppress(ImageError):
                found.append(levels_of(self._bag.message(self.image, images[position].recorded).content))
        return found

    def _scan(self, at: Stamped) -> NDArray[np.float32]:
        """Clean points ``[N, 4]`` of one message."""
        return clean_points(self._raw(at), Path(f"{self._bag}, {self.points}"), self._full_scale)

    def _raw(self, at: Stamped) -> NDArray[np.float32]:
        try:
            return points_of(columns_of(self._bag.message(self.points, at.recorded).content))
        except CloudError as error:
            raise DatasetError(f"The scan of {self._bag}, {self.points} at {at.seconds:.3f} s: {error}.") from None

    def _intensities(self, scans: list[Stamped]) -> NDArray[np.float32]:
        return np.concatenate([self._raw(scans[position])[:, 3] for position in evenly_spaced(len(scans), 4)])

    def _moments(self, images: list[Stamped], scans: list[Stamped]) -> tuple[list[Moment], tuple[str, ...]]:
        """The frames: the stillest scan of each period, with the nearest image."""
        most = self._options.max_time_difference or MAX_TIME_DIFFERENCE_MS
        images = sorted(images, key=lambda one: one.seconds)
        scans = sorted(scans, key=lambda one: one.seconds)
        taken = np.array([one.seconds for one in images])
        swept = np.array([one.seconds for one in scans])
        nearest = np.abs(swept[:, None] - taken[_around(taken, swept)])
        image_of = _around(taken, swept)[np.arange(len(scans)), nearest.argmin(axis=1)]
        apart = 1000 * nearest.min(axis=1)
        paired = np.flatnonzero(apart <= most)
        if not len(paired):
            raise DatasetError(
                f"No scan of {self.points} has an image of {self.image} within {most:g} ms, the nearest is "
                f"{apart.min():,.0f} ms away; give a larger --max-time-difference or, if camera and LiDAR "
                "have different clocks, --by-recording-time."
            )

        def between(one: int, other: int) -> float:
            return motion(self._raw(scans[one]), self._raw(scans[other]))

        def moved(position: int) -> float:
            other = position + 1 if position + 1 < len(scans) else position - 1
            return between(position, other) if other >= 0 else np.inf

        moments, apart_still, apart_moving = list[Moment](), list[float](), list[float]()
        for period in periods(swept[paired], self._options.every):
            position, motion_there = stillest(paired[period].tolist(), moved)
            is_still = motion_there <= STILL_M
            (apart_still if is_still else apart_moving).append(float(apart[position]))
            together = self._options.accumulate if is_still else 1
            chosen = [scans[one] for one in standing(position, together, len(scans), between)]
            moments.append(Moment(images[image_of[position]], tuple(chosen)))
        notes = [
            f"{self.image} ({len(images)}) and {self.points} ({len(scans)}): {len(moments)} frames, "
            f"{len(apart_still)} of them at a standstill, image and scan up to "
            f"{max(apart_still + apart_moving, default=0.0):.0f} ms apart."
        ]
        if self._options.accumulate > 1:
            counts = sorted(len(one.scans) for one in moments)
            notes.append(f"{counts[0]} to {counts[-1]} scans accumulated per frame, and only at a standstill.")
        if self._options.by_recording_time:
            notes.append(
                "Paired by when they were recorded, up to 0.1 s after they were taken; trust standstills only."
            )
        elif (longest := max(apart_moving, default=0.0)) > WORTH_A_WARNING_MS:
            away = longest / 1000 * 50 / 3.6 * 100
            notes.append(f"At 50 km/h that is {away:.0f} cm; record at a standstill if possible.")
        return moments, tuple(notes)


def _around(taken: NDArray[np.float64], swept: NDArray[np.float64]) -> NDArray[np.int64]:
    """``[N, 2]``: the images before and after each scan."""
    after = np.clip(np.searchsorted(taken, swept), 0, len(taken) - 1)
    return np.stack([np.maximum(after - 1, 0), after], axis=1)
