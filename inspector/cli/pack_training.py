"""``calib-inspect pack-training``: training frames in a few files, for training elsewhere."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import click

from calibnet.training.options import TrainingOptions
from inspector.cli.options import FOLDER, SEED, SIZE, NumberRange
from inspector.cli.output import make_console


@click.command("pack-training")
@click.option("--data", multiple=True, metavar="DATASET:DIR[:SEQ]", help="Real frames, as in train. Repeatable.")
@click.option("--validate", multiple=True, metavar="DATASET:DIR[:SEQ]", help="Frames to leave out.")
@click.option(
    "--synthetic",
    type=NumberRange(0, 1),
    default=TrainingOptions.synthetic,
    show_default=True,
    help="Share of synthetic frames, as in train.",
)
@click.option("--scenes", type=click.IntRange(1), default=500, show_default=True, help="Synthetic scenes to pack.")
@click.option("--scene-cache", type=FOLDER, help="Folder for rendered scenes.  [default: the temporary folder]")
@click.option(
    "--after", type=FOLDER, help="Folder of weights whose residuals to measure and pack too, which takes minutes."
)
@click.option("--preset", default="compact", show_default=True, help="Network of the weights of --after.")
@click.option("--seed", type=SEED, default=0, show_default=True, help="Seed of all random numbers.")
@click.option("--output", "out", type=FOLDER, required=True, help="Folder of the parts.")
@click.option("--max-size", type=SIZE, default="30MiB", show_default=True, help="Largest size of a part.")
def pack_training(
    data: tuple[str, ...],
    validate: tuple[str, ...],
    synthetic: float,
    scenes: int,
    scene_cache: Path | None,
    after: Path | None,
    preset: str,
    seed: int,
    out: Path,
    max_size: int,
) -> None:
    """Pack training frames into a few files that `train --packed` reads.

    For machines with a GPU but little storage. Writes images and scans at the resolution that training needs, including
    synthetic scenes, in parts of limited size, each of which can be used without the others.

    \b
    calib-inspect pack-training --data kitti-raw:KITTI/raw --data folder:RIGS --output packed
    calib-inspect train --packed packed --range 5/0.5 --minutes 8 --batch 64 --workers 15
    """  # noqa: D301 - click knows a paragraph that must not be wrapped by this character
    from rich.progress import track

    from calibnet.training.packing import pack_training as pack

    options = TrainingOptions(
        preset,
        range="",
        output="",
        data=list(data),
        validate=list(validate),
        synthetic=synthetic,
        scenes=scenes,
        scene_cache=str(scene_cache) if scene_cache else None,
        after=str(after) if after else None,
        seed=seed,
    )
    console = make_console()

    def tracked(places: Iterable[tuple[int, int]]) -> Iterable[tuple[int, int]]:
        return track(list(places), "Packing", console=console)

    parts = pack(options, out, max_size, tracked)
    console.print(f"{parts} {'part' if parts == 1 else 'parts'} in {out}")
