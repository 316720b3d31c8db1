"""``calib-inspect train``: trains one stage of the cascade, or all, within a budget of time or samples."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import click

from calibnet.geometry import RANGES
from calibnet.methods.learned.networks import NETWORKS
from calibnet.network.heads import HEADS
from calibnet.training.ablations import ABLATIONS, ablation_folder
from calibnet.training.options import TrainingOptions
from calibnet.training.recipe import RECIPE
from inspector.cli.options import FOLDER, RANGE, SEED, NumberRange
from inspector.cli.output import OUTPUT_FILE, make_console, overwrite_option
from inspector.cli.training_console import ConsoleObserver, Observers

if TYPE_CHECKING:
    from rich.console import Console

    from calibnet.geometry import MiscalibrationRange
    from calibnet.training.progress import Observer


@click.command()
@click.option("--preset", default="compact", show_default=True, help="Network to train.")
@click.option("--method", type=click.Choice(NETWORKS.names()), help="Train this network of another paper instead.")
@click.option(
    "--ablation",
    type=click.Choice(list(ABLATIONS)),
    help="Train this row of the paper's ablation, the preset without one of its modules, into a subfolder of --output.",
)
@click.option(
    "--image-encoder",
    type=click.Choice(["own", "efficientnet-lite0"]),
    help="Image encoder instead of the preset's: own starts from random weights, the other one from ImageNet weights.",
)
@click.option("--head", type=click.Choice(HEADS.names()), help="Pose head to train instead of the preset's.")
@click.option("--range", "range_", type=RANGE, help="Stage to train: 20/1.5, 10/1, 5/0.5, 2/0.2 or 1/0.1.")
@click.option(
    "--all",
    "every_stage",
    is_flag=True,
    help="Train all five stages one after the other, within --minutes or --samples in total. Stages whose weights are"
    " in --output are skipped.",
)
@click.option(
    "--data",
    multiple=True,
    metavar="DATASET:DIR[:SEQ]",
    help="Real frames, for instance kitti-raw:DIR or folder:DIR. Repeatable.",
)
@click.option("--packed", type=FOLDER, help="Folder written by pack-training, instead of --data and --synthetic.")
@click.option(
    "--on-device",
    is_flag=True,
    help="Make the samples on the GPU, whose memory must hold all frames; --workers then only draw random numbers.",
)
@click.option(
    "--validate",
    multiple=True,
    metavar="DATASET:DIR[:SEQ]",
    help="Held-out frames, which are never trained on even if --data contains them.",
)
@click.option(
    "--synthetic",
    type=NumberRange(0, 1),
    default=TrainingOptions.synthetic,
    show_default=True,
    help="Share of samples from the synthetic world.",
)
@click.option(
    "--scenes",
    type=click.IntRange(1),
    default=TrainingOptions.scenes,
    show_default=True,
    help="Number of synthetic scenes, each rendered once.",
)
@click.option("--scene-cache", type=FOLDER, help="Folder for rendered scenes.  [default: the temporary folder]")
@click.option("--minutes", type=NumberRange(0, min_open=True), help="Budget of training time, over all resumed runs.")
@click.option(
    "--samples",
    type=click.IntRange(1),
    help="Budget of samples instead of time, which makes the run exactly repeatable.",
)
@click.option(
    "--batch", type=click.IntRange(1), default=TrainingOptions.batch, show_default=True, help="Samples per step."
)
@click.option(
    "--learning-rate",
    type=NumberRange(0, min_open=True),
    help=f"Peak of the cosine schedule.  [default: {TrainingOptions.learning_rate:g}, for --method its own]",
)
@click.option(
    "--warm-up",
    type=click.IntRange(0),
    help="Samples at the start that train the features alone, at most a third of --samples.  "
    f"[default: {RECIPE.features.warm_up}, none with --initialize]",
)
@click.option(
    "--workers",
    type=click.IntRange(0),
    default=TrainingOptions.workers,
    show_default=True,
    help="Number of processes that prepare samples.",
)
@click.option(
    "--uniform",
    is_flag=True,
    help="Draw miscalibrations from the range only, for comparisons; always the case with --method.",
)
@click.option("--seed", type=SEED, default=TrainingOptions.seed, show_default=True, help="Seed of all random numbers.")
@click.option(
    "--initialize",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Weights of a neighbouring stage to start from.",
)
@click.option(
    "--train-image-branch",
    is_flag=True,
    help="Also train the image branch of an initialised stage, except its finest pretrained levels.  "
    "[default: frozen, as all stages share it]",
)
@click.option(
    "--whole-images",
    is_flag=True,
    help="Train a stage whose image is larger than the preset's input on whole images instead of crops: slower, but "
    "more accurate.",
)
@click.option(
    "--after",
    type=FOLDER,
    help="Folder with the weights of the stages before: most miscalibrations are then drawn from their residuals, and"
    " from those of the first look of --initialize if that is this stage.",
)
@click.option(
    "--output", type=FOLDER, default=Path("runs"), show_default=True, help="Folder for the checkpoint and the weights."
)
@click.option("--resume", is_flag=True, help="Continue from the checkpoint in --output.")
@click.option(
    "--save",
    type=OUTPUT_FILE,
    metavar="FILE.rrd",
    help="Also log losses and figures to a recording.",
)
@overwrite_option
def train(
    preset: str,
    method: str | None,
    ablation: str | None,
    image_encoder: str | None,
    head: str | None,
    range_: MiscalibrationRange | None,
    every_stage: bool,
    data: tuple[str, ...],
    packed: Path | None,
    on_device: bool,
    validate: tuple[str, ...],
    synthetic: float,
    scenes: int,
    scene_cache: Path | None,
    minutes: float | None,
    samples: int | None,
    batch: int,
    learning_rate: float | None,
    warm_up: int | None,
    workers: int,
    uniform: bool,
    seed: int,
    initialize: Path | None,
    train_image_branch: bool,
    whole_images: bool,
    after: Path | None,
    output: Path,
    resume: bool,
    save: Path | None,
) -> None:
    """Train one stage of the cascade, or all of them, and write the weights.

    Uses CUDA and several GPUs if available. Writes a checkpoint twice a minute; --resume continues an interrupted run.

    \b
    calib-inspect train --range 5/0.5 --minutes 60 \\
      --data kitti-raw:KITTI/raw --data folder:RIGS --validate kitti-raw:KITTI/raw:2011_09_26/0048
    calib-inspect train --all --minutes 600 --resume --data kitti-raw:KITTI/raw --data folder:RIGS
    calib-inspect train --method lccnet --range 5/0.5 --samples 10000 --batch 64 --packed PARTS --output METHODS
    """  # noqa: D301 - click knows a paragraph that must not be wrapped by this character
    if (minutes is None) == (samples is None):
        raise click.UsageError("Give either --minutes or --samples, the budget of the run.")

    if (range_ is not None) == every_stage:
        raise click.UsageError("Give either --range, the stage to train, or --all.")

    if method and (every_stage or ablation or image_encoder or head):
        raise click.UsageError(
            "--method trains one network as its paper describes; leave out --all, --ablation, --image-encoder and "
            "--head."
        )
    if ablation and every_stage:
        raise click.UsageError("--ablation trains one stage; give --range instead of --all.")

    if (method or ablation) and range_ not in RANGES:
        raise click.UsageError(
            f"--range {range_} is not the range of a stage; choose from {', '.join(map(str, RANGES))}."
        )

    from calibnet.training.schedule import all_stages

    if ablation:
        output = ablation_folder(output, ablation)

    options = TrainingOptions(
        preset=method or preset,
        ablation=ablation,
        image_encoder=image_encoder,
        uniform=uniform,
        head=head,
        range=str(range_ or ""),
        output=str(output),
        data=list(data),
        packed=str(packed) if packed else None,
        on_device=on_device,
        validate=list(validate),
        synthetic=synthetic,
        scenes=scenes,
        minutes=minutes,
        samples=samples,
        batch=batch,
        learning_rate=learning_rate or usual_rate(method),
        warm_up=warm_up,
        seed=seed,
        workers=workers,
        initialize=str(initialize) if initialize else None,
        train_image_branch=train_image_branch,
        whole_images=whole_images,
        after=str(after) if after else None,
        scene_cache=str(scene_cache) if scene_cache else None,
    )

    console = make_console()
    steps = all_stages(options, RECIPE) if every_stage else [options]
    if not steps:
        console.print(f"All five stages have their weights in {output}; remove those to train again.")
    for number, step in enumerate(steps, start=1):
        if every_stage:
            console.print(f"Stage ±{step.range}, {number} of {len(steps)} to go, in {step.output}", style="bold")
        train_stage(step, console, save and step_file(save, step, output) if every_stage else save, resume)
    if every_stage:
        console.print(
            "Before any of their results is accepted, the verdict has to be fitted to them: "
            f"calib-inspect fit-verdict --weights {output} --data …",
        )


def usual_rate(method: str | None) -> float:
    """The default learning rate."""
    return float(NETWORKS.load(method).LEARNING_RATE) if method else TrainingOptions.learning_rate


def train_stage(options: TrainingOptions, console: Console, save: Path | None, resume: bool) -> None:
    """Train one stage, with progress on the console and, if asked for, in a recording."""
    from calibnet.training.build import build
    from calibnet.training.trainer import Trainer

    training = build(options, RECIPE)  # first, since a training that cannot begin must leave no recording
    observers: list[Observer] = [ConsoleObserver(console)]
    with ExitStack() as closing:
        if save is not None:
            from inspector.record.training import TrainingLog

            observers.append(closing.enter_context(TrainingLog(save, f"{options.preset} ±{options.range}")))
        path = Trainer(training, Observers(observers), resume).run()
    console.print(f"Weights with their training record: {path}")


def step_file(save: Path, step: TrainingOptions, output: Path) -> Path:
    """File of the recording of one step of --all, named after the step's range and folder."""
    parts = [save.stem, *Path(step.output).relative_to(output).parts, step.range.replace("/", "-")]
    return save.with_stem("-".join(parts))
