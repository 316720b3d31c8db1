"""The five-stage cascade (paper section 3.5): each stage projects the scan, estimates and corrects the pose."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import torch

from calibnet.cascade.image_views import ImageViews, image_branches
from calibnet.cascade.loading import SkippedStage, load_stages
from calibnet.cascade.prepared import PreparedFrames, prepared
from calibnet.cascade.stage import Stage
from calibnet.cascade.upright import Upright
from calibnet.cascade.wider import covering
from calibnet.datasets.frame import Frame, Frames
from calibnet.datasets.rig import RigCamera
from calibnet.drive.rig import RigEstimate, solve_rig
from calibnet.drive.solve import solve_drive
from calibnet.errors import CalibrationError, ConfigError, WeightsError
from calibnet.geometry import RANGES
from calibnet.geometry.prior import PosePrior, Prior
from calibnet.geometry.types import Extrinsic, Matrix6
from calibnet.judging.causes import Measure, Search, match_error_of
from calibnet.judging.coefficients import Coefficients, load_coefficients
from calibnet.judging.drive import judge_drive
from calibnet.judging.judge import judge
from calibnet.judging.lag import reach_of
from calibnet.network.config import load_preset
from calibnet.runtime.clock import Clock
from calibnet.runtime.precision import autocast
from calibnet.trace import CascadeTrace, DriveEstimate, StageTrace
from calibnet.verdict import ACCEPTED, Verdict
from calibnet.weights.manifest import PACKAGE, Manifest, load_manifest

AnyEstimate = TypeVar("AnyEstimate", bound=DriveEstimate)


class Cascade:
    """The stages that have weights, coarse to fine; a stage without them is skipped, never guessed."""

    def __init__(
        self,
        stages: Sequence[Stage],
        skipped: Sequence[SkippedStage] = (),
        common_error: Matrix6 | None = None,
        wider: Sequence[Stage] = (),
        coefficients: Coefficients | None = None,
        prior: Prior | None = None,
    ) -> None:
        """Make a cascade of loaded stages; `load` loads them.

        Args:
            stages: coarse to fine, all on one device.
            skipped: requested stages that cannot run.
            common_error: covariance of the networks' common error; that of an empty `Manifest` by default.
            wider: stages of wider ranges, coarse to fine, for calibrations that leave the first stage's range.
            coefficients: coefficients of the verdict, fitted to these networks; without them nothing is accepted.
            prior: prior on the initial extrinsics; none by default.
        """
        self.coefficients = coefficients or Coefficients()
        model = self.coefficients.covariance
        self.stages, self.wider = ([replace(one, covariance_model=model) for one in some] for some in (stages, wider))
        self.skipped = list(skipped)
        if not stages:
            raise WeightsError(" ".join(["No stage of the cascade can run.", *(stage.reason for stage in skipped)]))
        self.common_error = Manifest("").common_error if common_error is None else common_error
        self.prior = prior or Prior()
        self.device = stages[0].device
        self.image_branches = image_branches([stage.network for stage in (*stages, *wider)])

    @classmethod
    def load(
        cls,
        preset: str = "compact",
        stages: tuple[int, ...] | None = None,
        folder: Path | None = None,
        wider: bool = False,
        prior: Prior | None = None,
    ) -> Cascade:
        """Load the weights of a preset and their manifest.

        Args:
            preset: name of a shipped preset.
            stages: numbers 1 (coarsest) to 5 (finest); all by default.
            folder: folder of the weights; the package's own by default.
            wider: whether to load the wider stages as well, for calibrations that leave the first stage's range.
            prior: prior on the initial extrinsics; none by default.

        Raises:
            ConfigError: there is no such preset or stage.
            WeightsError: no stage has weights, or a file cannot be used.
        """
        load_preset(preset)
        numbers = sorted(stages or range(1, len(RANGES) + 1))
        if not set(numbers) <= set(range(1, len(RANGES) + 1)):
            raise ConfigError(
                f"Stages {', '.join(map(str, numbers))} are not all within 1 to {len(RANGES)}; give numbers of stages."
            )
        manifest = load_manifest(preset, folder)
        loaded, skipped = load_stages(numbers, preset, manifest, folder or PACKAGE)
        beyond, _ = load_stages(range(1, numbers[0] if wider else 1), preset, manifest, folder or PACKAGE)
        return cls(loaded, skipped, manifest.common_error, beyond, load_coefficients(manifest, folder), prior)

    @property
    def unjudged(self) -> str:
        """Reason why none of its results can be accepted; empty if they can."""
        classifier = self.coefficients.for_frame(self.stages[-1].range)
        return classifier if isinstance(classifier, str) else ""

    @property
    def numbers(self) -> tuple[int, ...]:
        """Numbers of the stages, coarse to fine."""
        return tuple(stage.number for stage in self.stages)

    def only(self, number: int) -> Cascade:
        """A cascade of one of its stages only, which cannot start again with wider ones.

        Coefficients of the verdict are fitted to results of the last stage, so no result of another stage is accepted.

        Raises:
            ConfigError: it has no such stage.
        """
        chosen = [stage for stage in self.stages if stage.number == number]
        if not chosen:
            raise ConfigError(f"Stage {number} is not loaded; choose from {', '.join(map(str, self.numbers))}.")
        coefficients = self.coefficients if number == self.numbers[-1] else None
        return Cascade(chosen, self.skipped, self.common_error, (), coefficients, self.prior)

    def with_coefficients(self, coefficients: Coefficients) -> Cascade:
        """The cascade with other coefficients of the verdict."""
        return Cascade(self.stages, self.skipped, self.common_error, self.wider, coefficients, self.prior)

    def calibrate(self, frame: Frame, initial: Extrinsic, detail: bool = False) -> CascadeTrace:
        """Correct the extrinsic of one frame.

        Args:
            frame: image, scan and camera; its own extrinsic is not used.
            initial: ``camera_from_lidar`` to start from, 4x4.
            detail: whether to keep cost volumes, activations and the rest of `StageDetail`.

        Raises:
            CalibrationError: too few LiDAR points are inside the image under ``initial``.
        """
        upright, start, pose_prior = self._uprighted(initial)
        clock = Clock(self.device)
        frame = prepared(frame, upright)
        clock("preparation")
        return upright.undo(self._calibrated(frame, start, pose_prior, clock, detail), initial)

    def explain(self, frame: Frame, initial: Extrinsic, lags: Search | None = None) -> Verdict:
        """The verdict on a frame with causes: faults that, undone in the input, make image and scan fit.

        This runs stages up to thirty times, for frames whose verdict in `calibrate` is not accepted.

        Args:
            frame: image, scan and camera; its own extrinsic is not used.
            initial: ``camera_from_lidar`` to start from.
            lags: search for a lag of the scan, see `calibnet.judging.lag.lags`.
        """
        upright, start, pose_prior = self._uprighted(initial)
        frame, clock = prepared(frame, upright), Clock(self.device)

        def calibrated(frame: Frame, start: Extrinsic) -> CascadeTrace:
            return self._calibrated(frame, start, pose_prior, clock)

        try:
            trace = calibrated(frame, start)
        except CalibrationError:
            trace = None
        verdict = None if trace is None else trace.verdict
        if verdict is None or verdict.word != ACCEPTED:
            lag = None if lags is None else (lags, reach_of(calibrated, self.coefficients.lens))
            verdict = self._judged(frame, start, trace, pose_prior, match_error_of(self.stages[0]), lag)
        return upright.real(verdict)

    def calibrate_drive(
        self, frames: Frames, initial: Extrinsic, observer: Callable[[int, int], None] | None = None
    ) -> DriveEstimate:
        """Correct the one extrinsic that all frames of a drive share; see `calibnet.drive.solve.solve_drive`.

        Args:
            frames: frames of one camera and LiDAR on one mount; each is read at least once, and some several times.
            initial: ``camera_from_lidar`` to start from, 4x4.
            observer: called before each frame is read and at the end, with how many are read so far, and in all.

        Raises:
            CalibrationError: no frame could be calibrated.
            ValueError: there are no frames.
        """
        upright, start, pose_prior = self._uprighted(initial)
        frames = PreparedFrames(frames, upright)

        def solve(stages: Sequence[Stage]) -> DriveEstimate:
            return solve_drive(stages, frames, start, self.common_error, observer, pose_prior)

        return upright.real(self._solved(solve, start))

    def calibrate_rig(
        self,
        cameras: Sequence[RigCamera],
        initial: Extrinsic,
        observer: Callable[[int, int], None] | None = None,
        tolerance: Matrix6 | None = None,
    ) -> RigEstimate:
        """Correct the pose of a rig whose cameras are known relative to each other (`calibnet.drive.rig.solve_rig`).

        Args:
            cameras: cameras of the rig, each with its frames.
            initial: ``rig_from_lidar`` to start from, 4x4, to which the prior applies.
            observer: as for `calibrate_drive`.
            tolerance: covariance ``[6, 6]`` of each camera's pose on the rig, the same in all directions; None for a
                rigid rig.

        Returns:
            The estimate, whose ``camera_from_lidar`` is ``rig_from_lidar``, with the covariance in the rig's frame.

        Raises:
            CalibrationError: no frame of any camera could be calibrated.
            DatasetError: none could be read.
        """
        upright = [Upright.of(camera.camera_from_rig @ initial, self.stages[0].range) for camera in cameras]
        turned = [
            RigCamera(one.name, PreparedFrames(one.frames, turn), turn.extrinsic(one.camera_from_rig))
            for one, turn in zip(cameras, upright, strict=True)
        ]
        pose_prior = self.prior.about(initial) if self.prior else None

        def solve(stages: Sequence[Stage]) -> RigEstimate:
            return solve_rig(stages, turned, initial, self.common_error, observer, pose_prior, tolerance)

        estimate = self._solved(solve, initial)
        found = tuple(turn.real(one) for one, turn in zip(estimate.cameras, upright, strict=True))
        return replace(estimate, cameras=found)

    def _solved(self, solve: Callable[[Sequence[Stage]], AnyEstimate], initial: Extrinsic) -> AnyEstimate:
        """Solve a drive or a rig with the stages, again with the wider ones if it leaves their range, and judge it."""
        estimate = solve(self.stages)
        if wider := covering(self.stages[0], self.wider, initial, estimate.camera_from_lidar):
            estimate = solve([*wider, *self.stages])
        estimate = estimate.inflated(self.coefficients.inflation)
        classifier = self.coefficients.for_drive(self.stages[-1].range)
        lens, searched = self.coefficients.drive_lens, self.stages[0].range
        return estimate.judged(judge_drive(estimate, initial, searched, classifier, lens))

    def _calibrated(
        self, frame: Frame, start: Extrinsic, pose_prior: PosePrior | None, clock: Clock, detail: bool = False
    ) -> CascadeTrace:
        """Run and judge a prepared frame, from an extrinsic of its upright camera."""
        limit = self.stages[-1].match_error_limit_px
        with torch.inference_mode(), autocast(self.device):
            views = ImageViews(frame, clock)
            trace = CascadeTrace(start, self._run(self.stages, views, start, detail, pose_prior), clock.parts, limit)
            if wider := covering(self.stages[0], self.wider, start, trace.arrived):
                before = self._run(wider, views, start, pose_prior=pose_prior)
                stages = self._run(self.stages, views, before[-1].after, detail, pose_prior)
                trace = CascadeTrace(start, stages, clock.parts, limit, before)
            clock.skip()  # stages measure their own time
            trace = replace(trace, verdict=self._judged(frame, start, trace, pose_prior))
            clock("verdict")
        return trace

    def _judged(
        self,
        frame: Frame,
        start: Extrinsic,
        trace: CascadeTrace | None,
        pose_prior: PosePrior | None,
        match_error: Measure | None = None,
        lag: tuple[Search, Measure] | None = None,
    ) -> Verdict:
        """The verdict on a run, with its covariance reduced by the prior; arguments as for `judge`."""
        verdict = judge(frame, start, trace, self.coefficients, match_error, lag, self.prior.words)
        if pose_prior is None or verdict.covariance is None:
            return verdict
        return replace(verdict, covariance=pose_prior.narrowed(verdict.covariance, verdict.camera_from_lidar))

    def _run(
        self,
        stages: Sequence[Stage],
        views: ImageViews,
        initial: Extrinsic,
        detail: bool = False,
        pose_prior: PosePrior | None = None,
    ) -> tuple[StageTrace, ...]:
        """Run some stages, each from the result of the one before."""
        branches = dict(zip((*self.stages, *self.wider), self.image_branches, strict=True))
        traces: list[StageTrace] = []
        for stage in stages:
            before = traces[-1].after if traces else initial
            traces.append(stage.correct(views.frame, views.of(stage, branches[stage]), before, detail, pose_prior))
        return tuple(traces)

    def _uprighted(self, initial: Extrinsic) -> tuple[Upright, Extrinsic, PosePrior | None]:
        """How the image is turned upright, and the initial extrinsic and prior of the upright camera."""
        upright = Upright.of(initial, self.stages[0].range)
        pose_prior = self.prior.about(initial).turned(upright.rotation) if self.prior else None
        return upright, upright.extrinsic(initial), pose_prior
