"""Measures drives: solves each from all its frames, from seeded miscalibrations, and summarises the errors."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from calibnet.calibrator import DriveCalibrator
from calibnet.datasets import Sequence
from calibnet.errors import CalibrationError
from calibnet.evaluation.claims import Claims
from calibnet.evaluation.coverage import Coverage, squared_error
from calibnet.evaluation.metrics import Metrics
from calibnet.geometry import MiscalibrationRange, pose_error, sample_miscalibration
from calibnet.verdict import DRIVE_TOLERANCES, REJECTED, Tolerance

FEWEST_FRAMES = 2
"""Fewest frames of a drive."""


@dataclass(frozen=True)
class DriveMetrics:
    """Errors of drives.

    Attributes:
        estimate: errors of the extrinsics solved from all frames, after alignment of edges if there was any.
        networks: errors of the networks alone; None if no edges were aligned, when they would be the same.
        coverage: how the stated covariances of drives that are not rejected compare with their errors.
        verdicts: number of drives with each verdict.
        claims: how many are certain of the coarser tolerance, and how many wrongly.
    """

    estimate: Metrics
    networks: Metrics | None
    coverage: Coverage | None = None
    verdicts: dict[str, int] = field(default_factory=dict)
    claims: Claims | None = None


def evaluate_drives(
    calibrator: DriveCalibrator,
    sequences: list[Sequence],
    range_: MiscalibrationRange,
    repeats: int,
    seed: int,
    observer: Callable[[str, int, int], None] | None = None,
) -> DriveMetrics | None:
    """Errors of ``repeats`` estimates of every drive; those that fail keep their initial error.

    Args:
        calibrator: the calibrator to measure.
        sequences: the drives; sequences without a common mount (`shares_mount`) are left out.
        range_: range of the miscalibrations.
        repeats: miscalibrations per drive.
        seed: seed of the miscalibrations.
        observer: called with the name of a drive, the number of its frames that are read, and their total.

    Returns:
        The errors; None if no sequence is a drive.
    """
    errors, of_networks, squares, words, aligned = [], [], [], Counter[str](), False
    claimed = list[Tolerance | None]()
    for number, sequence in enumerate(sequences):
        if not shares_mount(sequence):
            continue
        reference = sequence[0].camera_from_lidar
        for repeat in range(repeats):
            delta = sample_miscalibration(range_, np.random.default_rng([seed, number, repeat, 1]))
            estimate, within = delta @ reference, None
            networks = estimate

            def told(read: int, total: int, name: str = sequence.name) -> None:
                if observer is not None:
                    observer(name, read, total)

            with contextlib.suppress(CalibrationError):  # counts with its initial error
                solved = calibrator.calibrate_drive(sequence, estimate, told)
                estimate, networks = solved.camera_from_lidar, (solved.networks or solved).camera_from_lidar
                aligned = aligned or solved.networks is not None
                if solved.verdict is not None:
                    words[solved.verdict.word] += 1
                    within = solved.verdict.within
                    if solved.verdict.word != REJECTED:
                        squares.append(squared_error(estimate, reference, solved.covariance))
            errors.append(pose_error(estimate, reference))
            claimed.append(within)
            of_networks.append(pose_error(networks, reference))
    if not errors:
        return None
    networks_alone = Metrics.of(of_networks) if aligned else None
    claims = Claims.of(DRIVE_TOLERANCES[-1], zip(claimed, errors, strict=True))
    return DriveMetrics(Metrics.of(errors), networks_alone, Coverage.of(squares), dict(words), claims)


def shares_mount(sequence: Sequence) -> bool:
    """Whether the first, middle and last frames have the same extrinsic, as frames of a drive do."""
    if len(sequence) < FEWEST_FRAMES:
        return False
    some = {0, len(sequence) // 2, len(sequence) - 1}
    extrinsics = [sequence[position].camera_from_lidar for position in some]
    return all(np.allclose(extrinsic, extrinsics[0], atol=1e-9) for extrinsic in extrinsics)
