"""The five-range cascade (paper section 3.5): project, estimate, correct, and again with the next network."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from calibnet.cascade.image_views import View, image_branches, image_views
from calibnet.cascade.stage_detail import stage_detail
from calibnet.datasets.frame import Frame, Frames
from calibnet.drive.solve import solve_drive
from calibnet.errors import CalibrationError, ConfigError, WeightsError
from calibnet.geometry import RANGES, MiscalibrationRange, PinholeCamera, is_finest
from calibnet.geometry.types import Extrinsic
from calibnet.network.batch import LidarInput, lidar_input
from calibnet.network.config import load_preset
from calibnet.network.convolution import pack
from calibnet.network.displacement import expected_error
from calibnet.network.network import CalibrationNetwork, NetworkInputs
from calibnet.runtime.clock import Clock
from calibnet.runtime.precision import autocast, fastest
from calibnet.trace import CascadeTrace, DriveEstimate, StageTrace
from calibnet.weights import load_network, weights_path

MINIMUM_CELLS = 20
"""Cells with a LiDAR point below which a pose of six parameters would be a guess."""


@dataclass(frozen=True)
class Stage:
    """One network of the cascade."""

    number: int
    range: MiscalibrationRange
    network: CalibrationNetwork


@dataclass(frozen=True)
class SkippedStage:
    """A stage that will not run, and why."""

    number: int
    range: MiscalibrationRange
    reason: str


class Cascade:
    """The stages that have weights, coarse to fine; a stage without them is skipped, never guessed."""

    def __init__(
        self, stages: list[Stage], skipped: list[SkippedStage] | None = None, looks: int | None = None
    ) -> None:
        """Use ``Cascade.load`` unless the networks are already there; ``looks`` a stage are its preset's by default."""
        self.stages, self.skipped, self.looks = stages, skipped or [], looks
        if not stages:
            reasons = " ".join(stage.reason for stage in self.skipped)
            raise WeightsError(f"No stage of the cascade can run. {reasons}".strip())
        self.device = next(stages[0].network.parameters()).device
        self.image_branches = image_branches([stage.network for stage in stages])

    @classmethod
    def load(
        cls, preset: str = "compact", stages: tuple[int, ...] | None = None, folder: Path | None = None
    ) -> Cascade:
        """Load the weights of a preset.

        Args:
            preset: name of a shipped preset.
            stages: numbers 1 (coarsest) to 5 (finest); all by default.
            folder: where the weights lie; the package's own by default.

        Raises:
            ConfigError: there is no such preset or stage.
            WeightsError: no stage has weights, or a file cannot be used.
        """
        load_preset(preset)
        numbers = sorted(stages or range(1, len(RANGES) + 1))
        if not set(numbers) <= set(range(1, len(RANGES) + 1)):
            raise ConfigError(f"Stages are numbered 1 to {len(RANGES)}; {', '.join(map(str, numbers))} is asked for.")
        loaded, skipped = [], []
        device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
        for number in numbers:
            range_ = RANGES[number - 1]
            path = weights_path(preset, range_, folder)
            if path.is_file():
                network = load_network(path).to(device)
                if network.range != range_:
                    raise WeightsError(f"{path} holds the weights of range {network.range}; give it its own name back.")
                pack(network, fastest(device))
                loaded.append(Stage(number, range_, network))
            else:
                reason = (
                    f"Stage {number} ({range_.label}) of preset {preset} has no "
                    f"weights: train it with `calib-inspect train --preset {preset} --range {range_}`."
                )
                skipped.append(SkippedStage(number, range_, reason))
        return cls(loaded, skipped)

    def calibrate(self, frame: Frame, initial: Extrinsic, detail: bool = False) -> CascadeTrace:
        """Correct the extrinsic of one frame.

        Args:
            frame: image, scan and camera; its own extrinsic is not looked at.
            initial: ``camera_from_lidar`` to start from, 4x4.
            detail: keep cost volumes, activations and the rest of `StageDetail`.

        Raises:
            CalibrationError: too few LiDAR points fall into the image under ``initial``.
        """
        clock = Clock(self.device)
        networks, extrinsic, traces = [stage.network for stage in self.stages], initial, []
        with torch.inference_mode(), autocast(self.device):
            views = image_views(networks, self.image_branches, frame, clock)
            for stage, branch in zip(self.stages, self.image_branches, strict=True):
                camera = stage.network.input_camera(frame.camera)
                view = views[branch, camera.width, camera.height]
                look = trace = self._run(stage, frame, camera, view, extrinsic, detail)
                for _ in range((self.looks or stage.network.looks) - 1):
                    if stage.network.is_settled(look.correction):
                        break
                    look = self._run(stage, frame, camera, view, look.after, False)
                    trace = trace.followed_by(look)
                extrinsic = trace.after
                traces.append(trace)
        return CascadeTrace(initial, tuple(traces), clock.parts, match_error_limit(self.stages[-1]))

    def calibrate_drive(
        self, frames: Frames, initial: Extrinsic, observer: Callable[[int, int], None] | None = None
    ) -> DriveEstimate:
        """Correct the one extrinsic that all frames of a drive share.

        Each stage corrects what all frames together make of it, and again on the scans projected anew. Until the
        end some frames from all over the drive are enough; the last pass sees them all. What the finest stage leaves
        is aligned without training (`calibnet.alignment`) on some frames from all over the drive.
        One frame is in memory at a time, and 4 MB of each that is aligned.

        Args:
            frames: of one camera and LiDAR on one mount; read once in the last pass, some of them before.
            initial: ``camera_from_lidar`` to start from, 4x4.
            observer: called before each frame with the number of frames read and to be read, over all passes.

        Raises:
            CalibrationError: no frame could be calibrated.
            ValueError: there are no frames.
        """
        alone = [(stage.range, Cascade([stage], looks=1)) for stage in self.stages]
        return solve_drive(alone, frames, initial, observer)

    def _run(
        self,
        stage: Stage,
        frame: Frame,
        camera: PinholeCamera,
        view: View,
        before: Extrinsic,
        detail: bool,
    ) -> StageTrace:
        clock = Clock(self.device)
        lidar = lidar_input(frame.points, before, camera, stage.network.config.volume_scales)
        occupied = int((lidar.cells[0][2] > 0).sum())
        if occupied < MINIMUM_CELLS:
            raise CalibrationError(
                f"Only {occupied} cells of frame {frame.index} ({frame.source}) hold a LiDAR point before stage "
                f"{stage.number}; check that the extrinsic maps LiDAR points (x forward, y left, z up) into the camera "
                "(x right, y down, z forward)."
            )
        clock("projection")
        inputs = self._inputs(view.image, lidar.without_top(lidar.empty_rows), camera)
        output = stage.network(inputs, view.features, keep_activations=detail, clock=clock)
        correction = stage.network.correction(output)
        if not np.isfinite(correction).all():
            raise CalibrationError(
                f"Stage {stage.number} found no finite correction for frame {frame.index} ({frame.source}); "
                "train its weights again if this happens on every frame."
            )
        return StageTrace(
            stage.number,
            stage.range,
            camera,
            before,
            correction @ before,
            correction,
            clock.parts,
            None if output.pose.information is None else output.pose.information[0].double().cpu().numpy(),
            stage_detail(stage.network.config, lidar, output) if detail else None,
            float(expected_error(output.field, inputs.cells[0])[0]),
        )

    def _inputs(self, image: Tensor, lidar: LidarInput, camera: PinholeCamera) -> NetworkInputs:
        def batch(array: NDArray[np.float32]) -> Tensor:
            return torch.from_numpy(array)[None].to(self.device)

        intrinsics = camera.matrix.astype(np.float32)
        return NetworkInputs(image, batch(lidar.image), batch(intrinsics), [batch(cells) for cells in lidar.cells])


def match_error_limit(stage: Stage) -> float:
    """Expected error of matches, in pixels, beyond which a stage's answer is not believed.

    Only the finest stage judges: the others' matches are coarse anyway, and the next stage looks again.
    """
    return stage.network.config.largest_match_error if is_finest(stage.range) else math.inf
