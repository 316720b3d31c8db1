"""What a weights file says about where it comes from."""

from __future__ import annotations

import subprocess
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch

from calibnet.training.validation import ValidationFigures

if TYPE_CHECKING:
    from calibnet.training.options import TrainingOptions


def training_record(
    options: TrainingOptions, samples: int, minutes: float, device: str, figures: ValidationFigures | None
) -> dict[str, Any]:
    """Data, minutes, samples, seed, commit and validation figures, as JSON."""
    described = asdict(options) | {"output": None, "scene_cache": None}
    for key in ("data", "validate"):  # datasets are named, the machine's folders are not
        described[key] = [_without_folder(spec) for spec in described[key]]
    for key in ("initialize", "after"):
        if described[key]:
            described[key] = Path(described[key]).name
    return {
        "options": {key: value for key, value in described.items() if value is not None},
        "samples": samples,
        "minutes": round(minutes, 1),
        "device": device,
        "torch": torch.__version__,
        "commit": _commit(),
        "validation": figures._asdict() if figures else None,
        "licence_note": "Trained on KITTI (CC BY-NC-SA 3.0), nuScenes, RELLIS-3D and other frames, the image branch "
        "of compact from EfficientNet-Lite0 (Apache-2.0): see docs/weights.md.",
    }


def _without_folder(spec: str) -> str:
    dataset, _, rest = spec.partition(":")
    root, _, name = rest.partition(":")
    return ":".join(part for part in (dataset, Path(root).name, name) if part)


def _commit() -> str | None:
    result = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=Path(__file__).parent, capture_output=True, text=True, check=False
    )
    return result.stdout.strip() or None
