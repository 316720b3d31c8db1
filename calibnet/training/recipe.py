"""Every knob of how a stage is trained, in one value: `RECIPE`.

What one run is given (data, budget, seed, where it starts) is in `calibnet.training.options` instead. A pair holds the
least and the largest value of a uniform draw; a share of frames, scans or pictures is the probability of it for each.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from typing import Any

from calibnet.geometry import RANGES, MiscalibrationRange
from calibnet.methods.learned.config import MethodConfig
from calibnet.network.config import NetworkConfig
from calibnet.training.augmentation_recipe import CameraRecipe, PictureRecipe, ScanRecipe
from calibnet.training.options import TrainingOptions

WIDEST, WIDE, MIDDLE, NARROW, NARROWEST = RANGES


@dataclass(frozen=True)
class SampleRecipe:
    """What a sample is."""

    sizes: tuple[tuple[int, int], ...] = ((160, 512), (192, 448), (224, 384))
    """Heights and widths of the input, pixels, one drawn for each batch; scaled until the first one has the area of the
    stage's image."""
    size_shares: tuple[float, ...] = (0.5, 0.2, 0.3)
    """Shares of the batches that have these sizes."""
    fewest_visible_cells: int = 40
    """Cells of the finest scale with a visible LiDAR point that a sample has at least; another is drawn otherwise."""
    attempts: int = 100
    """Draws after which training gives up on a sample."""
    hiding_px: int = 4
    """Side of the squares of pixels in whose nearest LiDAR point a farther one may be hidden from the camera."""
    hidden_factor: float = 1.2
    """A point is hidden if its depth is this factor times the nearest one's, plus `hidden_margin_m`, or more."""
    hidden_margin_m: float = 1.0
    """See `hidden_factor`; metres."""


@dataclass(frozen=True)
class StageDraws:
    """Which miscalibrations one stage is trained on."""

    stage: MiscalibrationRange
    """The stage, by its range."""
    range: MiscalibrationRange
    """Range of its uniform draws."""
    residual_share: float
    """Share of the samples with a residual instead of a uniform draw, in a run that knows the stages before."""


@dataclass(frozen=True)
class DrawRecipe:
    """Which miscalibrations are drawn; `calibnet.training.draws` says why the last stages are drawn wider."""

    wider: tuple[StageDraws, ...] = (
        StageDraws(MIDDLE, MiscalibrationRange(5.0, 0.9), 0.4),
        StageDraws(NARROW, MiscalibrationRange(2.0, 0.5), 0.4),
        StageDraws(NARROWEST, MiscalibrationRange(1.5, 0.35), 0.4),
    )
    """Stages drawn wider than their own range."""
    residual_share: float = 0.7
    """`StageDraws.residual_share` of all other stages, which are drawn from their own range."""
    own_residual_share: float = 0.4
    """The same in a run without stages before, whose residuals are what the stage's own first look leaves."""
    eased_share: float = 0.3
    """Share of the uniform draws made smaller, as a stage must also know when to stop."""
    eased_least: float = 0.03
    """Least factor on the rotation and on the translation of such a draw; each is drawn between it and 1."""
    residuals: int = 200
    """Training frames on which residuals are measured when a run starts."""
    residual_stretch: tuple[float, float] = (0.7, 1.8)
    """Factor on a residual: frames never trained on leave more behind than those it was measured on."""
    lost_rotation: float = 3.0
    """Residuals of a larger rotation, as a multiple of the stage's range, are lost frames and left out. It is generous,
    as a stage corrects less than it should of what is larger than all it has seen."""
    lost_translation: float = 6.0
    """The same of the translation."""

    def of(self, stage: MiscalibrationRange) -> StageDraws:
        """What is drawn for a stage."""
        own = StageDraws(stage, stage, self.residual_share)
        return next((draws for draws in self.wider if draws.stage == stage), own)


@dataclass(frozen=True)
class FeatureRecipe:
    """When the features train alone, without the pose: in the warm-up and in some of the batches after it.

    Their LiDAR images are displaced at random then. Miscalibrations scatter around none, so "the match is where the
    cell is" is a good guess, which features pick up from the image's borders and the ground near the car, and keep; the
    displacement makes it a bad one.
    """

    warm_up: int = 6000
    """Samples of the warm-up, each of which costs a third of a later one. A run that starts from weights has none."""
    warm_up_most: float = 1 / 3
    """Share of a budget in samples that the warm-up takes at most."""
    warm_up_variety: float = 0.5
    """Share of scans and pictures augmented, and of synthetic draws kept, as the warm-up begins; 1 as it ends."""
    warm_up_shift_px: float = 40.0
    """Displacement of the LiDAR image in x and in y, at most, in the warm-up."""
    shift_px: float = 24.0
    """The same in the batches after it that train features alone."""
    every: int = 3
    """After the warm-up the last one of so many batches trains features alone; 0: none does."""
    pose_ramp: int = 2000
    """Samples after the warm-up over which the losses of the pose fade in."""


@dataclass(frozen=True)
class LossRecipe:
    """Weights of the hybrid loss's terms, and what counts how much within a term."""

    matching: float = 2.0
    """Weight of the cross-entropy of the true cell."""
    feature_share: float = 0.5
    """Share of the matching loss asked of the features' cosines; the rest is asked of the aggregated volumes."""
    displacement: float = 0.3
    """Weight of the displacements' negative log-likelihood (of errors in pixels)."""
    pose: float = 2.0
    """Weight of the translation's error, per metre."""
    quaternion: float = 15.0
    """Weight of the rotation's error, per radian."""
    points: float = 0.5
    """Weight of the logarithm of 1 + the points' mean error in metres."""
    linear_m: float = 1.0
    """Error of the translation, metres, beyond which its cost grows as the logarithm does: a few hopeless samples must
    not drown the rest of a batch."""
    depth_bands_m: tuple[float, ...] = (6.0, 9.0, 13.0, 20.0, 35.0)
    """Depths between bands that count alike in the matching loss, however many cells each holds: shifts show in near
    cells, which are few."""
    rarest_band: float = 0.02
    """Share of the cells below which a band counts less than the others: few cells would be heard too loud."""
    displacement_balance: float = 0.5
    """How much the bands count alike in the displacement loss, 0..1: the pose is solved from all cells together."""


@dataclass(frozen=True)
class OptimizerRecipe:
    """How weights follow from losses. The peak of the learning rate is an option of the run."""

    rate_ramp: float = 0.03
    """Share of the budget in which the learning rate rises to its peak; then it falls as a cosine does."""
    rate_start: float = 1e-3
    """Share of the budget that the rising rate is ahead by, so that the first step has one."""
    final_rate: float = 0.02
    """What the learning rate falls to, relative to its peak."""
    pretrained_rate: float = 0.3
    """Learning rate, relative to the others', of what was learned on a million pictures."""
    frozen_levels: int = 2
    """Pretrained levels left as they are: they see edges on any camera, and cost most to train."""
    weight_decay: float = 1e-4
    """Weight decay of AdamW."""
    gradient_norm: float = 1.0
    """Norm that the gradient of a step is cut to."""
    average_decay: float = 0.995
    """Share of the averaged weights that a step keeps; they are what is validated and written."""


@dataclass(frozen=True)
class PaceRecipe:
    """What happens how often; nothing of it changes the weights."""

    report_seconds: float = 5.0
    """Seconds of training between lines of progress."""
    checkpoint_seconds: float = 30.0
    """Seconds of training between checkpoints."""
    checkpoints: bool = True
    """Whether there are any; a run of a minute needs none."""
    validation_seconds: float = 600.0
    """Seconds of training between validations."""
    validation_draws: int = 4
    """Miscalibrations of every validation frame."""


@dataclass(frozen=True)
class Step:
    """One stage's turn in `train --all`."""

    range: MiscalibrationRange
    """The stage."""
    share: float
    """Share of the whole budget."""
    neighbour: MiscalibrationRange | None
    """Stage whose weights it starts from; None for the first step, which learns the features."""
    learning_rate: float
    """Relative to the first step's."""


@dataclass(frozen=True)
class Recipe:
    """How a stage is trained."""

    camera: CameraRecipe = field(default_factory=CameraRecipe)
    scan: ScanRecipe = field(default_factory=ScanRecipe)
    picture: PictureRecipe = field(default_factory=PictureRecipe)
    sample: SampleRecipe = field(default_factory=SampleRecipe)
    draws: DrawRecipe = field(default_factory=DrawRecipe)
    features: FeatureRecipe = field(default_factory=FeatureRecipe)
    losses: LossRecipe = field(default_factory=LossRecipe)
    optimizer: OptimizerRecipe = field(default_factory=OptimizerRecipe)
    pace: PaceRecipe = field(default_factory=PaceRecipe)
    schedule: tuple[Step, ...] = (
        # the middle range first: most of the truth lies within the finest window there, so every scale learns to match
        Step(MIDDLE, 0.55, None, 1.0),
        Step(WIDEST, 0.12, MIDDLE, 0.6),
        Step(WIDE, 0.08, MIDDLE, 0.6),
        # and again, now that there are stages before it whose errors it can be shown
        Step(MIDDLE, 0.06, MIDDLE, 0.5),
        Step(NARROW, 0.11, MIDDLE, 0.6),
        Step(NARROWEST, 0.08, NARROW, 0.4),
    )
    """The steps of `train --all`, in order."""

    def of_run(self, options: TrainingOptions, config: NetworkConfig | MethodConfig) -> Recipe:
        """The recipe as it acts in one run: how long its warm-up is, and whether features train alone at all."""
        features = self.features
        if not config.trains_features:  # other networks, and the paper's ablation: the pose's losses alone
            return replace(self, features=replace(features, warm_up=0, every=0))
        wanted = options.warm_up if options.warm_up is not None else 0 if options.initialize else features.warm_up
        most = int(features.warm_up_most * options.samples) if options.samples else wanted
        return replace(self, features=replace(features, warm_up=min(wanted, most)))


RECIPE = Recipe()
"""The recipe that `calib-inspect train` follows."""


def changed_knobs(recipe: Recipe, usual: Recipe) -> dict[str, Any]:
    """The knobs in which a recipe differs from another, by name (``losses.pose``), with the recipe's values."""
    ours, theirs = (_flat(asdict(one)) for one in (recipe, usual))
    return {name: value for name, value in ours.items() if value != theirs[name]}


def _flat(values: dict[str, Any]) -> dict[str, Any]:
    """Knobs by ``part.name``; what is no part, such as the schedule, by its own name."""
    parts = {name: part for name, part in values.items() if isinstance(part, dict)}
    knobs = {f"{name}.{knob}": value for name, part in parts.items() for knob, value in part.items()}
    return knobs | {name: value for name, value in values.items() if name not in parts}
