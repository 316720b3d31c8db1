"""The methods in the table of `calibnet.evaluation.bench`: the cascade, with any weights, and other methods."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from calibnet.calibrator import Calibrator
from calibnet.cascade.cascade import Cascade
from calibnet.evaluation.bench import BenchMethod
from calibnet.evaluation.counting import count
from calibnet.geometry import RANGES, MiscalibrationRange, PinholeCamera, stages_within
from calibnet.methods.card import MethodCard
from calibnet.methods.registry import CASCADE, METHODS, accepts, open_method
from calibnet.network.network import CalibrationNetwork
from calibnet.weights import read_record, weights_path


def bench_methods(
    names: tuple[str, ...], ours: dict[str, Path], options: dict[str, Any], preset: str = "compact"
) -> list[BenchMethod]:
    """The rows of the table, by name.

    Args:
        names: names of methods; ``all`` for every method.
        ours: further rows of the cascade: names, and folders of weights.
        options: options of other methods; each is given those that it accepts.
        preset: preset of the cascade.

    Raises:
        ConfigError: there is no such method.
    """
    chosen = (CASCADE, *METHODS.names()) if "all" in names else names
    cascade = partial(MeasuredCascade.within, preset)
    found = [
        BenchMethod(name, partial(cascade, None) if name == CASCADE else partial(_open, name, options))
        for name in chosen
    ]
    return found + [BenchMethod(label, partial(cascade, folder)) for label, folder in ours.items()]


def _open(name: str, options: dict[str, Any], range_: MiscalibrationRange) -> Calibrator:
    maker = METHODS.load(name)
    return open_method(name, range_, **{option: value for option, value in options.items() if accepts(maker, option)})


class MeasuredCascade(Cascade):
    """The cascade with a card, which has its cost."""

    card: MethodCard

    @classmethod
    def within(cls, preset: str, folder: Path | None, range_: MiscalibrationRange) -> MeasuredCascade:
        """The stages that ``evaluate`` runs for a range, with the weights of a folder or those of the package."""
        cascade = cls.load(preset, stages_within(range_), folder, wider=True)
        assert isinstance(cascade, cls)
        cascade.card = cascade_card(cascade, preset, folder)
        return cascade


def cascade_card(cascade: Cascade, preset: str, folder: Path | None) -> MethodCard:
    """The cost of all stages for one frame, and the data that their records say they were trained on.

    Every stage counts with its image size and its largest number of looks. The parameters of an image branch that
    stages share count once, and its multiply-adds once for each image size.
    """
    parameters = multiply_adds = 0
    branches, views = set[int](), set[tuple[int, float]]()
    for stage, branch in zip(cascade.stages, cascade.image_branches, strict=False):
        config, size = stage.network.config, stage.settings.image_size
        plain = CalibrationNetwork(config, stage.range).eval()  # packed layers are not counted
        input_ = PinholeCamera(config.input_width, config.input_height, np.eye(3))
        input_ = input_.fitted(size * config.input_height, size * config.input_width, config.scales[-1])
        image, *others = count(plain, input_.height, input_.width)
        parameters += sum(cost.parameters for cost in others)
        multiply_adds += stage.settings.looks * sum(cost.multiply_adds for cost in others)
        if branch not in branches:
            parameters += image.parameters
        if (branch, size) not in views:
            multiply_adds += image.multiply_adds
        branches.add(branch)
        views.add((branch, size))
    paths = [weights_path(preset, RANGES[number - 1], folder) for number in cascade.numbers]
    return MethodCard.trained(parameters, multiply_adds, map(read_record, paths))
