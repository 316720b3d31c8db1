"""From frames with a known fault of the lens to the odds by which it is named."""

from __future__ import annotations

from dataclasses import asdict, fields, replace

import numpy as np
import pytest

from calibnet.cascade import Cascade, Stage
from calibnet.errors import CalibrationError
from calibnet.evaluation.corruptions import camera_faults, image_faults
from calibnet.evaluation.lens_fit import (
    CLASSES,
    LATE,
    PITCH,
    TOO_WEAK,
    WRONG_NAMES,
    DriveLensStream,
    LensStream,
    fit_lens,
)
from calibnet.evaluation.verdict_runs import VerdictRun
from calibnet.geometry import RANGES
from calibnet.judging.drive_lens import DriveLensPredictors
from calibnet.judging.lens_causes import BENT, CENTER, FOCAL
from calibnet.judging.lens_predictors import LensPredictors
from tests.support.scene import Scenes
from tests.support.tiny import tiny_network

NAMES = [one.name for one in fields(LensPredictors)]
SHOWS = {"focal-length": "fine_focal_gain", "principal-point": "fine_center_gain", "distorted": "coarse_radial_gain"}
"""The predictor of each fault that `lens_runs` raises; all others are noise."""


OF_DRIVES = [one.name for one in fields(DriveLensPredictors)]
SHOWS_IN_DRIVES = {"focal-length": "focal_gain", "principal-point": "center_gain", "distorted": "radial_gain"}


def lens_runs(
    count: int, shown: float, seed: int = 0, names: list[str] = NAMES, shows: dict[str, str] = SHOWS
) -> list[VerdictRun]:
    """Runs of which half have a fault that one predictor shows, by so many deviations of its noise."""
    generator, made = np.random.default_rng(seed), []
    for number in range(count):
        fault = "none" if number % 2 else list(shows)[number // 2 % 3]
        said = {name: float(generator.normal()) for name in names}
        if fault in shows:
            said[shows[fault]] += shown
        made.append(
            VerdictRun(number, f"drive {number % 5}", number, fault, "", 1.0, 9.0, True, said, [0.0] * 6, None, 1.0)
        )
    return made


def test_each_fault_is_told_by_the_predictor_that_shows_it() -> None:
    odds, figures = fit_lens(lens_runs(600, 6.0))
    for fault, predictor in SHOWS.items():
        weights = odds.weights[CLASSES[fault]]
        assert max(weights, key=lambda name: weights[name]) == predictor
        numbers = dict.fromkeys(NAMES, 0.0) | {predictor: 6.0}
        assert odds(LensPredictors(**numbers))[CLASSES[fault]] > 0.9
    assert sum(odds(LensPredictors(**dict.fromkeys(NAMES, 0.0))).values()) < 0.2
    assert (figures.runs, figures.sequences, figures.faulty) == (600, 5, 300)
    assert figures.right > 0.9 and figures.wrong < 0.05


def test_so_many_are_named_that_few_are_named_wrongly() -> None:
    odds, figures = fit_lens(lens_runs(600, 2.0))
    wrong = figures.wrong * figures.faulty + figures.named_without * (figures.runs - figures.faulty)
    assert wrong == int(WRONG_NAMES * figures.runs), "as many as may be, and no more"
    assert 0.2 < figures.right < 0.9 and 0 < odds.named_from < 1


def test_too_few_runs_of_a_fault_are_a_sentence_and_runs_that_tell_nothing_do_not_count() -> None:
    runs = [run if run.fault != "distorted" else replace(run, predictors=None) for run in lens_runs(120, 3.0)]
    with pytest.raises(CalibrationError, match=r"\(60 none, 20 focal-length, 20 principal-point, 0 distortion\)"):
        fit_lens(runs)
    with pytest.raises(CalibrationError, match="Make more runs"):
        fit_lens([])


def test_the_faults_of_the_stream_are_of_the_lens_and_strong_enough() -> None:
    stages = [Stage(number, RANGES[number - 1], tiny_network(seed=number, stage=number)) for number in (3, 4, 5)]
    stream = LensStream(Cascade(stages), [Scenes(2)], 0)
    faults = [*camera_faults(), *image_faults([])]
    kept = [fault for fault in faults if stream.has(fault)]
    assert {CLASSES[fault.name] for fault in kept} == {FOCAL, CENTER, BENT}
    dropped = {(fault.name, fault.strength) for fault in faults if fault.name in CLASSES and not stream.has(fault)}
    assert dropped == {*TOO_WEAK, PITCH}
    made = [run for number in range(8) if (run := stream.run(number)) is not None]
    assert {run.fault for run in made} > {"none"} and {run.fault for run in made} <= {"none", *CLASSES}
    assert all(run.predictors is None or list(run.predictors) == NAMES for run in made)
    assert any(run.predictors for run in made) and asdict(stream.run(3) or made[0]) == asdict(stream.run(3) or made[0])


def test_drives_have_faults_of_the_lens_that_a_frame_hides_and_late_scans() -> None:
    stages = [Stage(number, RANGES[number - 1], tiny_network(seed=number, stage=number)) for number in (3, 4, 5)]
    stream = DriveLensStream(Cascade(stages), [Scenes(6)], 0)
    drawn = [stream.drawn_fault(stream.sequences[0], np.random.default_rng(seed)) for seed in range(60)]
    assert {fault.name for fault in drawn} == {*CLASSES, LATE}
    strengths = {(fault.name, fault.strength) for fault in drawn}
    assert PITCH in strengths and not strengths & set(TOO_WEAK)
    made = [run for number in range(4) if (run := stream.run(number)) is not None and run.predictors]
    assert made and all(list(run.predictors or ()) == OF_DRIVES for run in made)
