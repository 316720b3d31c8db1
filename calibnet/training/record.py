"""Records how weights were made: in the header of their file, and in their entry of the manifest."""

from __future__ import annotations

import subprocess
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import torch

from calibnet.training.build import Training
from calibnet.training.recipe import RECIPE, changed_knobs
from calibnet.training.validation import ValidationFigures
from calibnet.weights.manifest import Manifest, StageEntry, load_manifest, manifest_path

ENCODER_LICENCE = "EfficientNet-Lite0 (Apache-2.0)"
"""Name and licence of the pretrained image encoder."""


def training_record(
    training: Training, samples: int, minutes: float, figures: ValidationFigures | None
) -> dict[str, Any]:
    """Options, samples, minutes, commit, validation figures and changed settings of a finished run, as JSON."""
    options = training.options
    rigs = sorted({source.sequence.rig for source in training.samples.frames.sources if not source.synthetic})
    described = asdict(options) | {
        "output": None,
        "scene_cache": None,
        "data": _without_folders(options.data),
        "validate": _without_folders(options.validate),
        "packed": options.packed and Path(options.packed).name,
        "initialize": options.initialize and Path(options.initialize).name,
        "after": options.after and Path(options.after).name,
    }
    return {
        "options": {key: value for key, value in described.items() if value is not None},
        "recipe": _changes(training),
        "samples": samples,
        "rigs": rigs,
        "minutes": round(minutes, 1),
        "device": training.fabric.device.type,
        "torch": torch.__version__,
        "commit": _commit(),
        "validation": figures._asdict() if figures else None,
        "licence_note": licence_note(rigs, training),
    }


def licence_note(rigs: list[str], training: Training) -> str:
    """Which licences apply to the weights: those of the real frames, and of the weights that the run started from."""
    frames = (
        f"Trained on frames of {', '.join(rigs)}, whose licences apply." if rigs else "Trained on synthetic scenes."
    )
    options, config, before = training.options, training.stage.network.config, training.inherited_licence
    if options.initialize:
        return before if frames in before else f"{frames} Started from {Path(options.initialize).name}: {before}"
    return frames if config.image_encoder == "own" else f"{frames} The image branch started from {ENCODER_LICENCE}."


def manifest_with(training: Training, weights: Path, samples: int, figures: ValidationFigures | None) -> Manifest:
    """The manifest now in the output folder, with the entry of the stage just trained.

    In a folder without one, it starts from the settings that ship with the package, without their runs.
    """
    preset, folder = training.options.preset, weights.parent
    manifest = load_manifest(preset, folder)
    if not manifest_path(preset, folder).is_file():
        stages = (replace(entry, run="", recipe="", validation={}) for entry in manifest.stages)
        manifest = replace(manifest, stages=tuple(stages))
    return manifest.with_stage(
        StageEntry(
            training.stage.range,
            weights.name,
            training.stage.settings,
            run=folder.name,
            recipe=recipe_sentence(training, samples),
            validation=dict(figures._asdict()) if figures else {},
        )
    )


def recipe_sentence(training: Training, samples: int) -> str:
    """A sentence on what a run started from, on what it trained and how long, without folders of this machine."""
    options, config, draws = training.options, training.stage.network.config, training.samples.draws
    if options.initialize:
        path, output = Path(options.initialize), Path(options.output)
        start = str(path.relative_to(output) if path.is_relative_to(output) else path.name)
        if config.share_image_branch:
            start += f", image branch {'trained' if options.train_image_branch else 'frozen'}"
    else:
        start = "random weights" if config.image_encoder == "own" else config.image_encoder
    data = _without_folders(options.data)
    if options.packed:
        data = ["packed frames"]
    elif options.synthetic > 0:
        data += [f"{options.synthetic:.0%} synthetic scenes" if data else "synthetic scenes"]
    parts = [f"from {start}", f"{samples:,} samples of {', '.join(data)}"]
    if draws.residuals:
        parts.append(f"{draws.residual_share:.0%} of the miscalibrations are what earlier looks leave")
    parts += [f"{name} {value}" for name, value in _changes(training).items()]
    return "; ".join(parts)


def _changes(training: Training) -> dict[str, Any]:
    """The settings in which the run's recipe differs from the usual one."""
    usual = RECIPE.of_run(training.options, training.stage.network.config)
    return changed_knobs(training.recipe, usual)


def _without_folders(specs: list[str]) -> list[str]:
    """``DATASET:ROOT[:SEQUENCE]`` with only the last part of the root, to leave out folders of this machine."""
    parts = [spec.split(":", 2) for spec in specs]
    return [":".join([dataset, Path(root).name, *name]) for dataset, root, *name in parts]


def _commit() -> str | None:
    result = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=Path(__file__).parent, capture_output=True, text=True, check=False
    )
    return result.stdout.strip() or None
