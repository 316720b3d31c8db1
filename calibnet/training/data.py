"""What to train on: data given as ``DATASET:ROOT[:SEQUENCE]``, the synthetic world, and their shares."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Iterator
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from calibnet.datasets import Frame, Sequence, dataset_names
from calibnet.datasets.discovery import find_sequences
from calibnet.errors import ConfigError, DatasetError
from calibnet.geometry import PinholeCamera
from calibnet.runtime.whole_file import write_whole
from calibnet.training.samples import Source


def open_data(spec: str) -> list[Sequence]:
    """All sequences, of all cameras, that ``DATASET:ROOT[:SEQUENCE]`` stands for.

    ``kitti-raw:DIR`` is every drive under DIR, ``kitti-raw:DIR:2011_09_26/0048`` one of them,
    ``kitti-object:DIR:train`` a split, ``folder:DIR`` a plain folder or a folder of them.

    Raises:
        ConfigError: the text is not of this form.
        DatasetError: there is nothing to read there.
    """
    dataset, _, rest = spec.partition(":")
    root_text, _, name = rest.partition(":")
    if dataset not in dataset_names() or not root_text:
        raise ConfigError(
            f"Data {spec!r} is not of the form DATASET:FOLDER[:SEQUENCE] with DATASET one of "
            f"{', '.join(dataset_names())}."
        )
    root = Path(root_text)
    if not root.is_dir():
        raise DatasetError(f"There is no folder {root}; {spec!r} names it as training data.")
    found = list(find_sequences(dataset, root, name))
    if not found:
        raise DatasetError(
            f"Nothing of dataset {dataset} is found for {spec!r}; check the folder and the sequence's name."
        )
    return found


class SyntheticPool:
    """A ``Sequence`` of unrelated synthetic scenes, each rendered once and then read from disk."""

    caches = True

    def __init__(self, size: int, seed: int, folder: Path | None = None) -> None:
        self.size, self.seed = size, seed
        self.folder = folder or Path(tempfile.gettempdir()) / "calib-inspect-scenes"
        self.name, self.rig = f"synthetic/{seed}", "synthetic world, random rigs"

    def __len__(self) -> int:
        return self.size

    def __iter__(self) -> Iterator[Frame]:
        return (self[position] for position in range(self.size))

    def __getitem__(self, position: int) -> Frame:
        """Scene ``position``; rendered if no earlier run left it in the folder."""
        path = self.folder / f"{self.seed}-{position:06d}.npz"
        if path.exists():
            try:
                return _unpack(path)
            except (ValueError, OSError, KeyError, EOFError, BadZipFile):  # cut short: draw it again
                path.unlink(missing_ok=True)
        from calibnet.datasets.synthetic import sample_frame

        frame = sample_frame(self.seed * 1_000_000 + position)
        write_whole(path, _pack(frame))
        return frame


def _pack(frame: Frame) -> bytes:
    buffer = io.BytesIO()
    np.savez(
        buffer,
        image=frame.image,
        points=frame.points,
        matrix=frame.camera.matrix,
        camera_from_lidar=frame.camera_from_lidar,
    )
    return buffer.getvalue()


def _unpack(path: Path) -> Frame:
    with np.load(path, allow_pickle=False) as file:
        image = file["image"]
        camera = PinholeCamera(image.shape[1], image.shape[0], file["matrix"])
        return Frame(0, 0.0, image, file["points"], camera, file["camera_from_lidar"], str(path))


def training_sources(
    data: list[str], validate: list[str], synthetic_share: float, scenes: int, seed: int, cache: Path | None
) -> tuple[list[Source], list[Sequence]]:
    """Sources of training samples and the validation sequences, which training never draws from.

    A real sequence is drawn with the square root of its length: single frames of rare sensors count
    more than the hundredth of one street. Together they have ``1 - synthetic_share``.

    Raises:
        ConfigError: there is nothing to train on.
    """
    validation = [sequence for spec in validate for sequence in open_data(spec)]
    held_out = {sequence.name for sequence in validation}
    real = [sequence for spec in data for sequence in open_data(spec) if sequence.name not in held_out]
    sources: list[Source] = []
    if real and synthetic_share < 1:
        roots = np.sqrt([len(sequence) for sequence in real])
        weights = (1 - synthetic_share) * roots / roots.sum()
        sources = [Source(sequence, float(weight)) for sequence, weight in zip(real, weights, strict=True)]
    if synthetic_share > 0:
        sources.append(Source(SyntheticPool(scenes, seed, cache), synthetic_share))
    if not sources:
        raise ConfigError("There is nothing to train on: give --data, or a --synthetic share above 0.")
    return sources, validation
