"""The options of one training run: what is trained, on which data, for how long."""

from __future__ import annotations

from dataclasses import dataclass, field

from calibnet.network.config import Head


@dataclass(frozen=True)
class TrainingOptions:
    """The options of a run, as checkpoints and the weights' record contain them; paths and ranges are texts.

    How a stage is trained is the same in all runs, and in `calibnet.training.recipe`.
    """

    preset: str
    """Name of the network: a preset of ours, or a method of `calibnet.methods.learned.networks.NETWORKS`."""
    range: str
    """Stage to train, as degrees and metres: ``5/0.5``."""
    output: str
    """Folder of checkpoint, weights and manifest."""
    data: list[str] = field(default_factory=list)
    """Real frames to train on, each ``DATASET:FOLDER[:SEQUENCE]``."""
    packed: str | None = None
    """Folder of frames packed beforehand (`calibnet.training.packed`), instead of ``data`` and ``synthetic``."""
    on_device: bool = False
    """Whether samples are made on the device that trains (`calibnet.training.on_device`), which then keeps all
    frames."""
    validate: list[str] = field(default_factory=list)
    """Held-out frames, in the same form as ``data``; never trained on."""
    synthetic: float = 0.4
    """Share of the samples that come from the synthetic world, 0..1."""
    scenes: int = 4000
    """Synthetic scenes, each rendered once."""
    minutes: float | None = None
    """Budget of training time, over all resumed runs."""
    samples: int | None = None
    """Budget of samples; a run with it is exactly repeatable."""
    batch: int = 8
    """Samples per step, in each process."""
    learning_rate: float = 1e-3
    """Peak of the learning rate."""
    seed: int = 0
    """Seed of all random numbers."""
    workers: int = 1
    """Number of processes that prepare samples."""
    initialize: str | None = None
    """Weights file of a stage to start from."""
    train_image_branch: bool = False
    """Whether an initialised stage also trains the image branch. If it is frozen, all stages share it, and it is
    computed once per frame."""
    whole_images: bool = False
    """Whether a stage whose image is larger than the preset's input is trained on whole images instead of crops of that
    size. A sample costs as many times more as the image has more pixels, and shows what the stage sees in use."""
    after: str | None = None
    """Folder of the weights of the stages before, whose residuals are then many of the miscalibrations."""
    scene_cache: str | None = None
    """Folder of the rendered scenes; by default one in the temporary folder."""
    head: Head | None = None
    """Pose head, instead of the preset's."""
    ablation: str | None = None
    """Row of the paper's ablation, see `calibnet.training.ablations`: the preset without one of its modules."""
    image_encoder: str | None = None
    """Image encoder instead of the preset's; ``own`` starts from random weights, as other papers' networks do here."""
    uniform: bool = False
    """Whether miscalibrations are drawn from the range alone, without residuals (also those packed with the frames) and
    without wider draws: for comparisons, in which all networks should see the same."""
    warm_up: int | None = None
    """Number of samples that first train the features alone; by default as in the recipe, and 0 for an initialised
    stage."""
