"""Trained methods: the networks of another paper, run from wide to narrow ranges, as a `Calibrator`."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import ClassVar

from calibnet.datasets.frame import Frame
from calibnet.geometry import RANGES, MiscalibrationRange, stages_within
from calibnet.geometry.types import Extrinsic
from calibnet.methods.card import MethodCard
from calibnet.methods.learned.counting import multiply_adds
from calibnet.methods.learned.networks import NETWORKS
from calibnet.methods.learned.stage import MethodStage
from calibnet.methods.learned.weights import load_method_stage, missing
from calibnet.runtime.clock import Clock
from calibnet.trace import CascadeTrace, StageTrace
from calibnet.weights.files import read_record, weights_path


class LearnedMethod:
    """A method with networks; subclasses name their weights."""

    NAME: ClassVar[str]

    def __init__(self, range_: MiscalibrationRange, weights: Path | None = None) -> None:
        """Load the networks for miscalibrations within ``range_``.

        A method whose paper runs several networks in sequence runs those that the folder ``weights`` has, from the one
        for ``range_`` to the narrowest. Any other method runs the one for ``range_``.

        Raises:
            WeightsError: ``weights`` is not given, or has no network for the range; the message says how to make one.
        """
        self.range = range_
        numbers = stages_within(range_)
        if weights is None:
            raise missing(self.NAME, RANGES[numbers[0] - 1], None)
        wanted = numbers if NETWORKS.load(self.NAME).CASCADED else numbers[:1]
        found = [load_method_stage(self.NAME, RANGES[number - 1], weights) for number in wanted]
        if found[0] is None:
            raise missing(self.NAME, RANGES[wanted[0] - 1], weights)
        self.stages: list[MethodStage] = [stage for stage in found if stage is not None]
        self.weights = weights

    @cached_property
    def card(self) -> MethodCard:
        """The cost of the networks, and their training data."""
        networks = [stage.network for stage in self.stages]
        paths = [weights_path(self.NAME, stage.range, self.weights) for stage in self.stages]
        return MethodCard.trained(
            sum(parameter.numel() for network in networks for parameter in network.parameters()),
            sum(stage.settings.looks * multiply_adds(stage.network) for stage in self.stages),
            map(read_record, paths),
        )

    def calibrate(self, frame: Frame, initial: Extrinsic, detail: bool = False) -> CascadeTrace:
        """See `calibnet.calibrator.Calibrator.calibrate`; with ``detail``, with the networks' exhibits."""
        clock = Clock(self.stages[0].device)
        view = self.stages[0].view(frame, clock)
        traces: list[StageTrace] = []
        for stage in self.stages:
            before = traces[-1].after if traces else initial
            traces.append(stage.correct(frame, view, before, detail))
        return CascadeTrace(initial, tuple(traces), clock.parts)


class RegNetMethod(LearnedMethod):
    """RegNet (2017)."""

    NAME = "regnet"


class CalibNetMethod(LearnedMethod):
    """CalibNet (2018)."""

    NAME = "calibnet"


class LCCNetMethod(LearnedMethod):
    """LCCNet (2021)."""

    NAME = "lccnet"


class CalibFormerMethod(LearnedMethod):
    """After CalibFormer (2024)."""

    NAME = "calibformer"
