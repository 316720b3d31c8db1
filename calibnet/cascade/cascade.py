"""The five-stage cascade (paper section 3.5): project, estimate, correct, and again with the next network."""

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
from calibnet.datasets.frame import Frame, Frames
from calibnet.datasets.rig import RigCamera
from calibnet.drive.rig import RigEstimate, solve_rig
from calibnet.drive.solve import solve_drive
from calibnet.errors import CalibrationError, ConfigError, WeightsError
from calibnet.geometry import RANGES, invert
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
from calibnet.trace import MARGIN, CascadeTrace, DriveEstimate, StageTrace
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
        """Use ``Cascade.load`` unless the networks are already there.

        Args:
            stages: coarse to fine, all on one device.
            skipped: stages that were asked for and cannot run.
            common_error: covariance of what the networks get wrong in all frames of a drive alike; that of
                `calibnet.weights.manifest.Manifest` by default.
            wider: stages of wider ranges, coarse to fine, kept for calibrations that leave the first stage's range.
            coefficients: of the verdict, fitted to these networks; without them nothing is accepted.
            prior: what is known beforehand of the extrinsics that calibrations start from; nothing by default.
        """
        self.coefficients = coefficients or Coefficients()
        model = self.coefficients.covariance
        self.stages, self.wider = ([replace(one, covariance_model=model) for one in some] for some in (stages, wider))
        self.skipped = list(skipped)
        if not stages:
            reasons = " ".join(stage.reason for stage in skipped)
            raise WeightsError(f"No stage of the cascade can run. {reasons}".strip())
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
        """Load the weights of a preset, and its manifest, which says how they are used.

        Args:
            preset: name of a shipped preset.
            stages: numbers 1 (coarsest) to 5 (finest); all by default.
            folder: where the weights lie; the package's own by default.
            wider: keep the stages before the first one as well, for calibrations that leave its range.
            prior: what is known beforehand of the extrinsics that calibrations start from; nothing by default.

        Raises:
            ConfigError: there is no such preset or stage.
            WeightsError: no stage has weights, or a file cannot be used.
        """
        load_preset(preset)
        numbers = sorted(stages or range(1, len(RANGES) + 1))
        if not set(numbers) <= set(range(1, len(RANGES) + 1)):
            raise ConfigError(f"Stages are numbered 1 to {len(RANGES)}; {', '.join(map(str, numbers))} is asked for.")
        manifest = load_manifest(preset, folder)
        loaded, skipped = load_stages(numbers, preset, manifest, folder or PACKAGE)
        kept, _ = load_stages(range(1, numbers[0] if wider else 1), preset, manifest, folder or PACKAGE)
        return cls(loaded, skipped, manifest.common_error, kept, load_coefficients(manifest, folder), prior)

    @property
    def unjudged(self) -> str:
        """Why none of its results can be accepted; empty where they can."""
        classifier = self.coefficients.for_frame(self.stages[-1].range)
        return classifier if isinstance(classifier, str) else ""

    @property
    def numbers(self) -> tuple[int, ...]:
        """Of the stages, coarse to fine."""
        return tuple(stage.number for stage in self.stages)

    def only(self, number: int) -> Cascade:
        """The same with one of its stages alone, which cannot start again with wider ones.

        Coefficients of the verdict are fitted to what the last stage leaves, so nothing is accepted of any other.

        Raises:
            ConfigError: it has no such stage.
        """
        chosen = [stage for stage in self.stages if stage.number == number]
        if not chosen:
            raise ConfigError(f"Stage {number} is not loaded; there are {', '.join(map(str, self.numbers))}.")
        coefficients = self.coefficients if number == self.numbers[-1] else None
        return Cascade(chosen, self.skipped, self.common_error, (), coefficients, self.prior)

    def with_coefficients(self, coefficients: Coefficients) -> Cascade:
        """The same, judging by other coefficients."""
        return Cascade(self.stages, self.skipped, self.common_error, self.wider, coefficients, self.prior)

    def calibrate(self, frame: Frame, initial: Extrinsic, detail: bool = False) -> CascadeTrace:
        """Correct the extrinsic of one frame.

        Args:
            frame: image, scan and camera; its own extrinsic is not looked at.
            initial: ``camera_from_lidar`` to start from, 4x4.
            detail: keep cost volumes, activations and the rest of `StageDetail`.

        Raises:
            CalibrationError: too few LiDAR points fall into the image under ``initial``.
        """
        upright, start, pose_prior = self._uprighted(initial)
        clock = Clock(self.device)
        frame = prepared(frame, upright)
        clock("preparation")
        return upright.undo(self._calibrated(frame, start, pose_prior, clock, detail), initial)

    def explain(self, frame: Frame, initial: Extrinsic, lags: Search | None = None) -> Verdict:
        """The verdict on a frame with its causes: what, undone in the input, makes picture and scan fit.

        This runs stages up to thirty times, for frames whose verdict in `calibrate` is not accepted.

        Args:
            frame: image, scan and camera; its own extrinsic is not looked at.
            initial: ``camera_from_lidar`` to start from.
            lags: of the scan, that are tried as well, see `calibnet.judging.lag.lags`.
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
            frames: of one camera and LiDAR on one mount; each is read at least once, and some several times.
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
        """Correct the one pose of a rig whose cameras are known relative to each other.

        See `calibnet.drive.rig.solve_rig`.

        Args:
            cameras: of the rig, each with its frames.
            initial: ``rig_from_lidar`` to start from, 4x4; what is known beforehand is known of it.
            observer: as of `calibrate_drive`.
            tolerance: covariance ``[6, 6]`` of each camera's pose on the rig, the same in all directions; None for a
                rigid rig.

        Returns:
            The estimate; its ``camera_from_lidar`` is ``rig_from_lidar``, and its covariance in the rig's frame.

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
        """A drive or a rig solved with the stages, and where it leaves their range with the wider ones too; judged."""
        estimate = solve(self.stages)
        if wider := self._covering(initial, estimate.camera_from_lidar):
            estimate = solve([*wider, *self.stages])
        estimate = estimate.inflated(self.coefficients.inflation)
        classifier = self.coefficients.for_drive(self.stages[-1].range)
        return replace(estimate, verdict=judge_drive(estimate, initial, self.stages[0].range, classifier))

    def _calibrated(
        self, frame: Frame, start: Extrinsic, pose_prior: PosePrior | None, clock: Clock, detail: bool = False
    ) -> CascadeTrace:
        """A run on a prepared frame, from an extrinsic of its upright camera; with its verdict."""
        limit = self.stages[-1].match_error_limit_px
        with torch.inference_mode(), autocast(self.device):
            views = ImageViews(frame, clock)
            trace = CascadeTrace(start, self._run(self.stages, views, start, detail, pose_prior), clock.parts, limit)
            if wider := self._covering(start, trace.arrived):
                before = self._run(wider, views, start, pose_prior=pose_prior)
                stages = self._run(self.stages, views, before[-1].after, detail, pose_prior)
                trace = CascadeTrace(start, stages, clock.parts, limit, before)
            clock.skip()  # the stages time themselves
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
        """The verdict on a run, its covariance narrowed by what is known beforehand; arguments as of `judge`."""
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
        """Some stages, each from where the one before arrived."""
        branches = dict(zip((*self.stages, *self.wider), self.image_branches, strict=True))
        traces: list[StageTrace] = []
        for stage in stages:
            before = traces[-1].after if traces else initial
            traces.append(stage.correct(views.frame, views.of(stage, branches[stage]), before, detail, pose_prior))
        return tuple(traces)

    def _uprighted(self, initial: Extrinsic) -> tuple[Upright, Extrinsic, PosePrior | None]:
        """How the image is turned upright, and what the upright camera starts from and knows of it beforehand."""
        upright = Upright.of(initial, self.stages[0].range)
        pose_prior = self.prior.about(initial).turned(upright.rotation) if self.prior else None
        return upright, upright.extrinsic(initial), pose_prior

    def _covering(self, initial: Extrinsic, found: Extrinsic) -> list[Stage]:
        """The wider stages with which to start again from an initial extrinsic that turns out to be so far off.

        None where the first stage's range covers it; else from the stage whose range does, or from the widest of all.
        """
        miscalibration = initial @ invert(found)
        if not self.wider or self.stages[0].range.contains(miscalibration, MARGIN):
            return []
        covering = [number for number, stage in enumerate(self.wider) if stage.range.contains(miscalibration, MARGIN)]
        return self.wider[max(covering, default=0) :]
