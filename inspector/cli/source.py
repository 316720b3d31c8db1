"""One kind of data at the command line: its options, and how it is opened."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from calibnet.datasets.published import PUBLISHED
from calibnet.errors import ConfigError
from inspector.cli.options import FOLDER

if TYPE_CHECKING:
    from calibnet.datasets import Sequence


@dataclass(frozen=True, kw_only=True)
class Source:
    """A kind of data.

    Attributes:
        name: name of its command.
        of: description for the middle of a sentence.
        note: further text of its help.
        parameters: options and arguments that say what to open; passed to ``open`` by name.
        open: opens the sequence; raises `CalibnetError`.
        given: whether its extrinsic is the one to correct rather than a reference, unless a miscalibration is asked
            for.
        one_mount: whether all its frames share one extrinsic.
    """

    name: str
    of: str
    note: str
    parameters: tuple[click.Parameter, ...]
    open: Callable[..., Sequence]
    given: bool = False
    one_mount: bool = True


def published(
    dataset: str,
    where: str,
    options: tuple[click.Parameter, ...],
    *,
    variable: str = "KITTI_ROOT",
    **more: Any,
) -> Source:
    """Define a published dataset, which lies below ``--root``.

    Args:
        dataset: a name of `calibnet.datasets.published.PUBLISHED`; `open_sequence` gets all options.
        where: its name and origin, for the message that asks for ``--root``.
        options: parameters besides ``--root``. An argument called ``number`` is the dataset's ``drive``, since
            ``--drive`` is an option of the run.
        variable: environment variable that replaces ``--root``.
        **more: other fields of the `Source`.
    """
    root_option = click.Option(
        ["--root"], type=FOLDER, envvar=variable, help=f"The dataset's folder.  [env: {variable}]"
    )

    def open_it(root: Path | None, **asked: Any) -> Sequence:
        from calibnet.datasets import open_sequence

        if root is None:
            raise ConfigError(
                f"No {where.partition(' ')[0]} folder is given: add --root DIR or set {variable} to where {where}; "
                "`calib-inspect demo` needs no data."
            )
        return open_sequence(dataset, root, **{"drive" if key == "number" else key: asked[key] for key in asked})

    of_it = PUBLISHED[dataset]
    return Source(
        name=of_it.command,
        parameters=(*options, root_option),
        open=open_it,
        one_mount=of_it.one_mount,
        **more,
    )


def open_folder(
    directory: Path, dataset: str, camera_frame: str | None, lidar_frame: str | None, **asked: Any
) -> Sequence:
    """Open a plain folder, or the folder of another package's dataset, which takes none of these options."""
    from calibnet.datasets import open_sequence
    from calibnet.datasets.calibration_files import FrameChoice

    frames = FrameChoice(camera_frame, lidar_frame)
    options = {**asked, "frames": frames if any(frames) else None}
    return open_sequence(dataset, directory, **{name: value for name, value in options.items() if value is not None})


def open_bag(files: tuple[Path, ...], camera_frame: str | None, lidar_frame: str | None, **asked: Any) -> Sequence:
    """Open a bag."""
    from calibnet.datasets.bag import Bag, BagOptions
    from calibnet.datasets.calibration_files import FrameChoice

    return Bag(files, BagOptions(frames=FrameChoice(camera_frame, lidar_frame), **asked))
