"""What decides a training run."""

from __future__ import annotations

from dataclasses import dataclass, field

from calibnet.network.config import Head


@dataclass(frozen=True)
class TrainingOptions:
    """Everything that decides a run; stored in its checkpoints and in the weights' record."""

    preset: str
    range: str
    output: str  # folder of checkpoint and weights
    data: list[str] = field(default_factory=list)
    validate: list[str] = field(default_factory=list)
    synthetic: float = 0.4  # share of the samples that come from the synthetic world
    scenes: int = 4000  # synthetic scenes, each rendered once
    minutes: float | None = None  # budget: of training time, over all resumed runs
    samples: int | None = None  # budget: of samples; a run with it is exactly repeatable
    batch: int = 8
    learning_rate: float = 1e-3
    seed: int = 0
    workers: int = 1
    initialize: str | None = None  # weights file of a neighbouring stage
    train_image_branch: bool = False  # of an initialised stage; frozen, all stages share it, computed once a frame
    after: str | None = None  # folder of the stages before, whose errors are most of the miscalibrations drawn
    scene_cache: str | None = None
    head: Head | None = None  # of the pose, instead of the preset's
    warm_up: int | None = None  # samples that first train the features alone; by default none for an initialised stage
