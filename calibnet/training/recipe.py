"""All settings of how a stage is trained, in one value: `RECIPE`.

Settings of a single run (data, budget, seed, initial weights) are in `calibnet.training.options` instead. A pair of
numbers has the smallest and the largest value of a uniform draw. A share of frames, scans or images is a probability.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from typing import Any

from calibnet.geometry import RANGES, MiscalibrationRange
from calibnet.methods.learned.config import MethodConfig
from calibnet.network.config import NetworkConfig
from calibnet.training.augmentation_recipe import CameraRecipe, ImageRecipe, ScanRecipe
from calibnet.training.options import TrainingOptions

WIDEST, WIDE, MIDDLE, NARROW, NARROWEST = RANGES


@dataclass(frozen=True)
class SampleRecipe:
    """The size of a sample, and which samples are usable."""

    sizes: tuple[tuple[int, int], ...] = ((160, 512), (192, 448), (224, 384))
    """Heights and widths of the input, pixels, of which each batch has one; all are scaled so that the first has the
    area of the stage's image."""
    size_shares: tuple[float, ...] = (0.5, 0.2, 0.3)
    """Probability of each size."""
    fewest_visible_cells: int = 40
    """Smallest number of cells of the finest scale with a visible LiDAR point; a sample with fewer is drawn again."""
    attempts: int = 100
    """Draws after which training gives up on a sample."""
    hiding_px: int = 4
    """Side, in pixels, of the squares in which the nearest LiDAR point may hide farther ones from the camera."""
    hidden_factor: float = 1.2
    """A point is hidden if its depth is at least this factor times the depth of the nearest, plus `hidden_margin_m`."""
    hidden_margin_m: float = 1.0
    """Metres; see `hidden_factor`."""


@dataclass(frozen=True)
class StageDraws:
    """Which miscalibrations one stage is trained on."""

    stage: MiscalibrationRange
    """The stage, by its range."""
    range: MiscalibrationRange
    """Range of the uniform draws."""
    residual_share: float
    """Share of the samples with a residual instead of a uniform draw, in a run with weights of the stages before."""


@dataclass(frozen=True)
class DrawRecipe:
    """Which miscalibrations are drawn; `calibnet.training.draws` says why those of the last stages are wider."""

    wider: tuple[StageDraws, ...] = (
        StageDraws(MIDDLE, MiscalibrationRange(5.0, 0.9), 0.4),
        StageDraws(NARROW, MiscalibrationRange(2.0, 0.5), 0.4),
        StageDraws(NARROWEST, MiscalibrationRange(1.5, 0.35), 0.4),
    )
    """Stages whose draws are wider than their own range."""
    residual_share: float = 0.7
    """`StageDraws.residual_share` of all other stages, which are drawn from their own range."""
    own_residual_share: float = 0.4
    """`residual_share` in a run without stages before, in which residuals are those of the stage's own first look."""
    eased_share: float = 0.3
    """Share of the uniform draws that are made smaller, as a stage must also learn when to correct little."""
    eased_least: float = 0.03
    """Smallest factor on rotation and translation of these; each factor is drawn between it and 1."""
    residuals: int = 200
    """Number of training frames on which residuals are measured when a run starts."""
    residual_stretch: tuple[float, float] = (0.7, 1.8)
    """Factor on a residual: on frames never trained on, residuals are larger than on those they were measured on."""
    lost_rotation: float = 3.0
    """Residuals with a larger rotation than this multiple of the stage's range are left out as lost frames. The limit
    is generous, as a stage corrects too little of errors larger than all it was trained on."""
    lost_translation: float = 6.0
    """Such a limit for the translation."""

    def of(self, stage: MiscalibrationRange) -> StageDraws:
        """The draws of a stage."""
        own = StageDraws(stage, stage, self.residual_share)
        return next((draws for draws in self.wider if draws.stage == stage), own)


@dataclass(frozen=True)
class FeatureRecipe:
    """When the features train alone, without the pose: in the warm-up and in some of the batches after it.

    LiDAR images are then displaced at random. Miscalibrations are centred on zero, so "the match is where the cell is"
    is a good guess; features learn it from the borders of the image and the ground near the car, and do not unlearn it.
    The displacement makes it a bad guess.
    """

    warm_up: int = 6000
    """Number of samples of the warm-up; each costs a third of a later one. A run that starts from weights has none."""
    warm_up_most: float = 1 / 3
    """Largest share of a budget in samples that the warm-up takes."""
    warm_up_variety: float = 0.5
    """Share of scans and images that are augmented, and of synthetic draws that are kept, when the warm-up begins; it
    grows to 1."""
    warm_up_shift_px: float = 40.0
    """Largest displacement of the LiDAR image in x and in y during the warm-up."""
    shift_px: float = 24.0
    """Largest displacement in batches after the warm-up that train features alone."""
    every: int = 3
    """After the warm-up, the last of this many batches trains features alone; with 0 none does."""
    pose_ramp: int = 2000
    """Number of samples after the warm-up over which the losses of the pose fade in."""


@dataclass(frozen=True)
class LossRecipe:
    """Weights of the terms of the hybrid loss, and weights within the terms."""

    matching: float = 2.0
    """Weight of the cross-entropy of the true cell."""
    feature_share: float = 0.5
    """Share of the features' cosines in the matching loss; the rest is that of the aggregated volumes."""
    displacement: float = 0.3
    """Weight of the displacements' negative log-likelihood (of errors in pixels)."""
    pose: float = 2.0
    """Weight of the translation's error, per metre."""
    quaternion: float = 15.0
    """Weight of the rotation's error, per radian."""
    points: float = 0.5
    """Weight of the logarithm of 1 + the points' mean error in metres."""
    linear_m: float = 1.0
    """Error of the translation, metres, beyond which its cost grows only logarithmically, so that a few hopeless
    samples do not dominate a batch."""
    depth_bands_m: tuple[float, ...] = (6.0, 9.0, 13.0, 20.0, 35.0)
    """Limits of the bands of depth that count alike in the matching loss, however many cells each has: translations
    show in near cells, which are few."""
    rarest_band: float = 0.02
    """Share of the cells below which a band counts less than the others, so that no cell weighs too much."""
    displacement_balance: float = 0.5
    """Strength, 0..1, of the same balance in the displacement loss; the pose is solved from all cells together."""


@dataclass(frozen=True)
class OptimizerRecipe:
    """Settings of the optimizer. The peak of the learning rate is an option of the run."""

    rate_ramp: float = 0.03
    """Share of the budget in which the learning rate rises to its peak; then it decays along a cosine."""
    rate_start: float = 1e-3
    """Head start of the rise, as a share of the budget, so that the rate of the first step is not 0."""
    final_rate: float = 0.02
    """Final learning rate, relative to its peak."""
    pretrained_rate: float = 0.3
    """Learning rate of the pretrained image encoder, relative to that of the other weights."""
    frozen_levels: int = 2
    """Number of pretrained levels that stay frozen: they detect edges with any camera, and cost most to train."""
    weight_decay: float = 1e-4
    """Weight decay of AdamW."""
    gradient_norm: float = 1.0
    """Norm to which the gradient of a step is clipped."""
    average_decay: float = 0.995
    """Decay of the moving average of the weights, which is what is validated and written."""


@dataclass(frozen=True)
class PaceRecipe:
    """How often progress is reported and saved; this does not change the weights."""

    report_seconds: float = 5.0
    """Seconds of training between lines of progress."""
    checkpoint_seconds: float = 30.0
    """Seconds of training between checkpoints."""
    checkpoints: bool = True
    """Whether checkpoints are written; a run of a minute needs none."""
    validation_seconds: float = 600.0
    """Seconds of training between validations."""
    validation_draws: int = 4
    """Number of miscalibrations of every validation frame."""


@dataclass(frozen=True)
class Step:
    """One stage's turn in `train --all`."""

    range: MiscalibrationRange
    """The stage."""
    share: float
    """Share of the whole budget."""
    neighbour: MiscalibrationRange | None
    """Range of the stage whose weights it starts from; None for the first step, which learns the features."""
    learning_rate: float
    """Learning rate, relative to that of the first step."""


@dataclass(frozen=True)
class Recipe:
    """How a stage is trained."""

    camera: CameraRecipe = field(default_factory=CameraRecipe)
    scan: ScanRecipe = field(default_factory=ScanRecipe)
    picture: ImageRecipe = field(default_factory=ImageRecipe)  # the name in records of weights
    sample: SampleRecipe = field(default_factory=SampleRecipe)
    draws: DrawRecipe = field(default_factory=DrawRecipe)
    features: FeatureRecipe = field(default_factory=FeatureRecipe)
    losses: LossRecipe = field(default_factory=LossRecipe)
    optimizer: OptimizerRecipe = field(default_factory=OptimizerRecipe)
    pace: PaceRecipe = field(default_factory=PaceRecipe)
    schedule: tuple[Step, ...] = (
        # the middle range first: most true displacements lie within the finest window, so every scale learns to match
        Step(MIDDLE, 0.55, None, 1.0),
        Step(WIDEST, 0.12, MIDDLE, 0.6),
        Step(WIDE, 0.08, MIDDLE, 0.6),
        # the middle range again, on the residuals of the stages before it
        Step(MIDDLE, 0.06, MIDDLE, 0.5),
        Step(NARROW, 0.11, MIDDLE, 0.6),
        Step(NARROWEST, 0.08, NARROW, 0.4),
    )
    """The steps of `train --all`, in order."""

    def of_run(self, options: TrainingOptions, config: NetworkConfig | MethodConfig) -> Recipe:
        """The recipe with the warm-up of one run, and without training features alone if the network does not."""
        features = self.features
        if not config.trains_features:  # networks with losses of the pose alone: other papers', and the ablation
            return replace(self, features=replace(features, warm_up=0, every=0))
        wanted = options.warm_up if options.warm_up is not None else 0 if options.initialize else features.warm_up
        most = int(features.warm_up_most * options.samples) if options.samples else wanted
        return replace(self, features=replace(features, warm_up=min(wanted, most)))


RECIPE = Recipe()
"""The recipe that `calib-inspect train` follows."""


def changed_knobs(recipe: Recipe, usual: Recipe) -> dict[str, Any]:
    """The settings in which a recipe differs from the usual one, by name (``losses.pose``), with its values."""
    ours, theirs = (_flat(asdict(one)) for one in (recipe, usual))
    return {name: value for name, value in ours.items() if value != theirs[name]}


def _flat(values: dict[str, Any]) -> dict[str, Any]:
    """Settings by ``part.name``; those outside the parts, such as the schedule, by their own names."""
    parts = {name: part for name, part in values.items() if isinstance(part, dict)}
    knobs = {f"{name}.{knob}": value for name, part in parts.items() for knob, value in part.items()}
    return knobs | {name: value for name, value in values.items() if name not in parts}
