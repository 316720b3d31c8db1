"""Reads a recording: settings, extrinsics and, on demand, the pictures of a frame.

Comparisons, checks, exports and reports read nothing else, so whoever has the ``.rrd`` can make them.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from calibnet.geometry import RANGES, CameraModel, MiscalibrationRange, PoseError, pose_error
from calibnet.geometry.types import Extrinsic
from calibnet.runtime.reading import parse_json
from calibnet.verdict import ACCEPTED, CANNOT_TELL, REJECTED, BadFrame, Verdict
from inspector import entities
from inspector.read.file import RecordingFile
from inspector.read.pictures import OverlayPoints, RecordedPictures
from inspector.read.tables import PROPERTIES, matrices, rows, static_row
from inspector.read.understood import RecordingError, camera_of, understood
from inspector.read.verdict import inferred_verdict, read_verdict
from inspector.record.contents import Coloring
from inspector.verdicts import of_frames

if TYPE_CHECKING:
    from pyarrow import RecordBatch
    from rerun.chunk import Chunk

SAME_MOUNT = 1e-6  # references of one mount differ by less, in metres and in entries of the rotation
PICTURES = (entities.IMAGE, entities.OVERLAY_MISCALIBRATED, entities.OVERLAY_CORRECTED)
OTHERS = {
    entities.RIG: "the recording of a rig; only report, export and pictures take one",
    entities.WATCH_TEXT: "a recording of watch; open it with rerun, or get its result from `watch --json`",
    entities.FAILURE: "the recording of a run that failed; open it with rerun to read why",
}
"""Recordings of calib-inspect that are not of a run, by an entity that each of them has."""


class RecordedStage(NamedTuple):
    """A stage that ran: 1 to 5, and the miscalibration it is for, for instance ``"5/0.5"``."""

    number: int
    range: str


@dataclass(frozen=True, eq=False)
class RecordedFrame:
    """The numbers of one frame, exactly as the run computed them.

    Attributes:
        index: the frame's number in its sequence.
        seconds: time since the sequence's first frame.
        source: name of its image file.
        camera: the frame's own camera, lens included.
        initial: initial ``camera_from_lidar``, 4x4.
        corrected: resulting ``camera_from_lidar``: that of the last stage, or the initial one where that is rejected.
        stages: ``camera_from_lidar`` after every stage by its number, coarse to fine.
        reference: the true ``camera_from_lidar``; None where unknown.
        verdict: verdict on the result; for a recording without verdicts, only whether the result was applied.
    """

    index: int
    seconds: float
    source: str
    camera: CameraModel
    initial: Extrinsic = field(repr=False)
    corrected: Extrinsic = field(repr=False)
    stages: dict[int, Extrinsic] = field(repr=False)
    reference: Extrinsic | None = field(repr=False)
    verdict: Verdict = field(repr=False)

    @property
    def rejected(self) -> bool:
        """Whether the result was rejected, so that the frame kept its initial extrinsic."""
        return self.verdict.word == REJECTED

    def error(self, camera_from_lidar: Extrinsic) -> PoseError | None:
        """Error of an extrinsic against the reference; None without one."""
        return None if self.reference is None else pose_error(camera_from_lidar, self.reference)


@dataclass(frozen=True, eq=False)
class RecordedRun:
    """A recorded run, whose pictures are read on demand.

    Attributes:
        path: the recording.
        title: for instance ``"kitti-odometry/04, miscalibrated within 5/0.5, seed 0"``.
        settings: the options that identify the run, such as ``sequence``, ``rig``, ``seed``, ``preset``.
        provenance: versions of ``calib_inspect``, ``torch`` and ``rerun``.
        weights: training record of every stage's weights, by its number, where known.
        stages: the stages that ran, coarse to fine.
        has_reference: whether the frames have a reference, and with it errors.
        frames: the complete frames, in order; at least one.
        skipped: frames that could not be used.
        drive: ``camera_from_lidar`` solved from all frames together; None where the run did not do that.
        drive_verdict: verdict on ``drive``; None without one, and in recordings without verdicts.
        given_verdict: verdict on the calibration that the run started from; None where it was not judged.
        warning: a sentence for the user if the file is cut off; else empty.
    """

    path: Path
    title: str
    settings: dict[str, Any]
    provenance: dict[str, Any]
    weights: dict[int, dict[str, Any]] = field(repr=False)
    stages: tuple[RecordedStage, ...]
    has_reference: bool
    frames: tuple[RecordedFrame, ...] = field(repr=False)
    skipped: tuple[BadFrame, ...] = field(repr=False)
    drive: Extrinsic | None = field(repr=False)
    drive_verdict: Verdict | None = field(repr=False)
    given_verdict: Verdict | None = field(repr=False)
    warning: str
    _file: RecordingFile = field(repr=False)

    @property
    def drive_error(self) -> PoseError | None:
        """Error of the drive's extrinsic; None where none was solved, or without a reference."""
        reference = self.frames[0].reference
        return None if self.drive is None or reference is None else pose_error(self.drive, reference)

    @property
    def believes_drive(self) -> bool:
        """Whether a drive was solved and not rejected."""
        return self.drive is not None and (self.drive_verdict is None or self.drive_verdict.word != REJECTED)

    @property
    def one_mount(self) -> bool:
        """Whether the references of all frames are the same; true without references."""
        references = [frame.reference for frame in self.frames if frame.reference is not None]
        return not references or float(np.ptp(references, axis=0).max()) < SAME_MOUNT

    @property
    def results(self) -> list[Extrinsic]:
        """The extrinsics that are not rejected; those of all frames, if all are."""
        return [one.corrected for one in self.frames if not one.rejected] or [one.corrected for one in self.frames]

    @property
    def frames_verdict(self) -> Verdict:
        """One verdict on all frames, see `inspector.verdicts.of_frames`."""
        verdicts = {frame.index: frame.verdict for frame in self.frames}
        return of_frames(verdicts, self.frames[0].initial, self.skipped)

    @property
    def verdict(self) -> Verdict:
        """The run's main verdict: on the given calibration, else on the drive, else on the frames.

        Nothing is accepted by a recording that is cut off, since the whole run may have found otherwise.
        """
        found = self.given_verdict or self.drive_verdict or self.frames_verdict
        if not self.warning or found.word != ACCEPTED:
            return found
        reason = "The recording is cut off, so what the whole run found is not known."
        return replace(found, word=CANNOT_TELL, reason=reason, advice="Record it again.")

    def image(self, index: int) -> bytes:
        """The frame's image as JPEG."""
        return self._pictures.image(index)

    def overlay(self, entity: str, index: int) -> OverlayPoints:
        """The points drawn over the frame's image, far to near.

        Args:
            entity: `entities.OVERLAY_MISCALIBRATED`, ``_CORRECTED``, ``_REFERENCE`` or `entities.overlay_stage`.
            index: the frame's number.
        """
        return self._pictures.overlay(entity, index)

    @property
    def _pictures(self) -> RecordedPictures:
        return RecordedPictures(self._file)

    def scalars(self, path: str) -> list[float]:
        """A curve's values, of every frame that has one, in order."""
        batches = (chunk.to_record_batch() for chunk in self.chunks(path))
        valued = [row for row in rows(batches) if row.get("Scalars:scalars")]  # the curve's style has no frame
        return [float(row["Scalars:scalars"][0]) for row in sorted(valued, key=lambda row: row[entities.FRAME])]

    def chunks(self, *paths: str) -> Iterator[Chunk]:
        """The recording's own chunks of some entities, see `RecordingFile.chunks`."""
        return self._file.chunks(*paths)


def read_run(path: Path) -> RecordedRun:
    """Read everything but the pictures.

    Raises:
        RecordingError: the file is missing, damaged, foreign, too old, or has no complete frame.
    """
    file = RecordingFile(path)
    with understood(path):
        return _run(path, file)


def _run(path: Path, file: RecordingFile) -> RecordedRun:
    tables = _read_tables(file)
    options, provenance = (static_row(tables[f"{PROPERTIES}/{name}"]) for name in (entities.RUN, entities.PROVENANCE))
    numbers, ranges = provenance.pop("stage_numbers", []), provenance.pop("stage_ranges", [])
    other = next((kind for entity, kind in OTHERS.items() if entity in tables and not numbers), None)
    if other:
        raise RecordingError(f"{path} is {other}.")
    if not provenance and not file.cut:
        raise RecordingError(
            f"{path} was made by an earlier calib-inspect, which did not record extrinsics as numbers; record it again."
        )
    (has_reference,) = provenance.pop("has_reference", [False])
    if sorted(set(numbers)) != numbers or not set(numbers) <= set(range(1, len(RANGES) + 1)):
        raise ValueError(f"stages {numbers}")
    frames = _frames(tables, numbers, bool(has_reference), file.cut, path) if numbers else ()
    if not frames:
        raise RecordingError(f"{path} ends before its first frame is complete; copy it again or record it again.")
    versions = {name: value for name, (value,) in provenance.items()}
    history = {} if file.cut else matrices(tables[entities.EXTRINSIC_DRIVE])  # its last row is the result
    weights = parse_json(versions.pop("weights", "{}"))
    settings = {name: value for name, (value,) in options.items()}
    Coloring(settings.get("color", Coloring.DEPTH))
    return RecordedRun(
        path=path,
        title=static_row(tables[PROPERTIES]).get("RecordingInfo:name", [path.stem])[0],
        settings=settings,
        provenance=versions,
        weights={int(number): dict(record) for number, record in weights.items()},
        stages=tuple(
            RecordedStage(number, str(MiscalibrationRange.parse(range_)))
            for number, range_ in zip(numbers, ranges, strict=True)
        ),
        has_reference=bool(has_reference),
        frames=frames,
        skipped=tuple(BadFrame(row[entities.FRAME], row["TextLog:text"][0]) for row in rows(tables[entities.SKIPPED])),
        drive=history[max(history)] if history else None,
        drive_verdict=_verdict(tables[entities.VERDICT_DRIVE], path),
        given_verdict=_verdict(tables[entities.VERDICT_GIVEN], path),
        warning=f"{path} is cut off; only its {len(frames)} complete frames are used." if file.cut else "",
        _file=file,
    )


def _read_tables(file: RecordingFile) -> dict[str, list[RecordBatch]]:
    """Chunks by entity; for a file that is cut off, pictures too, since a frame may lack one."""
    wanted = (
        "extrinsic/**",
        "verdict/**",
        entities.SKIPPED,
        *OTHERS,
        f"{PROPERTIES}/**",
        *(PICTURES if file.cut else ()),
    )
    tables: dict[str, list[RecordBatch]] = defaultdict(list)
    for chunk in file.chunks(*wanted):
        entity, batch = chunk.entity_path.lstrip("/"), chunk.to_record_batch()
        tables[entity].append(batch.select([entities.FRAME]) if entity in PICTURES else batch)
    return tables


def _verdict(batches: list[RecordBatch], path: Path) -> Verdict | None:
    """The verdict in static data; None without one."""
    text = static_row(batches).get(entities.VERDICT)
    return read_verdict(text[0], path) if text else None


def _frames(
    tables: dict[str, list[RecordBatch]], stages: list[int], has_reference: bool, cut: bool, path: Path
) -> tuple[RecordedFrame, ...]:
    """The complete frames."""
    initial = matrices(tables[entities.EXTRINSIC_INITIAL])
    after = {number: matrices(tables[entities.extrinsic_stage(number)]) for number in stages}
    # earlier recordings have only the stages; the last one's was the result
    corrected = after[max(stages)] | matrices(tables[entities.EXTRINSIC_CORRECTED])
    reference = matrices(tables[entities.EXTRINSIC_REFERENCE])
    pictures = [{row[entities.FRAME] for row in rows(tables[entity])} for entity in PICTURES] if cut else []
    verdicts = {row[entities.FRAME]: row[entities.VERDICT][0] for row in rows(tables[entities.VERDICT_FRAME])}
    cameras = {row[entities.FRAME]: row for row in rows(tables[entities.CAMERA])}
    needed = [initial, *after.values(), *([reference] if has_reference else []), *pictures]
    frames = []
    for index, row in sorted(cameras.items()):
        if not all(index in known for known in needed):
            continue
        of_stages = {number: matrices[index] for number, matrices in after.items()}
        frames.append(
            RecordedFrame(
                index=index,
                seconds=row[entities.TIME],
                source=row["source"][0],
                camera=camera_of(row, path),
                initial=initial[index],
                corrected=corrected[index],
                stages=of_stages,
                reference=reference.get(index),
                verdict=read_verdict(verdicts[index], path)
                if index in verdicts
                else inferred_verdict(initial[index], corrected[index], of_stages),
            )
        )
    return tuple(frames)
