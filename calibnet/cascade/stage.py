"""One stage of the cascade: its network, and how it is used on a frame (paper section 3.5)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from calibnet.cascade.around import extended, projected
from calibnet.cascade.faces import join_looks
from calibnet.cascade.stage_detail import stage_detail
from calibnet.datasets.frame import Frame
from calibnet.datasets.images.files import resize_image
from calibnet.errors import CalibrationError
from calibnet.geometry import RANGES, MiscalibrationRange, PinholeCamera, transform
from calibnet.geometry.prior import PosePrior
from calibnet.geometry.types import Extrinsic, Transform
from calibnet.judging.covariance import CovarianceModel
from calibnet.network.batch import Cut, make_batch
from calibnet.network.displacement import DisplacementField, expected_error
from calibnet.network.network import CalibrationNetwork
from calibnet.runtime.clock import Clock, after_each
from calibnet.runtime.precision import autocast
from calibnet.trace import Matches, StageTrace
from calibnet.weights.manifest import StageSettings


class View(NamedTuple):
    """A frame's image at a stage's input size, ``[1, 3, H, W]``, and the features of its image branch.

    For a wide lens, ``faces`` has a view of each face, and image and features are those of the first.
    """

    image: Tensor
    features: list[Tensor]
    faces: tuple[View, ...] = ()


@dataclass(frozen=True)
class Stage:
    """One network of the cascade.

    Attributes:
        number: 1 (coarsest) to 5 (finest).
        range: range that the network was trained for.
        network: the network, in evaluation mode.
        settings: its image size, looks and gain.
        match_error_limit_px: largest match error at which the stage is believed, in pixels of its image.
        covariance_model: model of the measured covariance of its results.
    """

    number: int
    range: MiscalibrationRange
    network: CalibrationNetwork
    settings: StageSettings = field(default_factory=StageSettings)
    match_error_limit_px: float = math.inf
    covariance_model: CovarianceModel = field(default_factory=CovarianceModel)

    @property
    def device(self) -> torch.device:
        """Device of the network."""
        return next(self.network.parameters()).device

    def camera(self, frame: Frame) -> PinholeCamera:
        """The camera of this stage's image of a frame."""
        config, size = self.network.config, self.settings.image_size
        return frame.camera.fitted(size * config.input_height, size * config.input_width, config.scales[-1])

    @torch.inference_mode()
    def view(
        self, frame: Frame, clock: Callable[[str], None] = lambda part: None, of_this_size: View | None = None
    ) -> View:
        """The frame's image as this stage sees it.

        Args:
            frame: the frame, faces included.
            clock: called with ``"resize"`` and ``"image_features"``.
            of_this_size: another stage's view of the frame at the same size, to save resizing.
        """
        if frame.faces:
            known = of_this_size.faces if of_this_size else [None] * len(frame.faces)
            seen = zip(frame.faces, known, strict=True)
            faces = tuple(self.view(frame.through(face), clock, one) for face, one in seen)
            return View(*faces[0][:2], faces)
        with autocast(self.device):
            image = of_this_size.image if of_this_size else self._resized(frame)
            clock("resize")
            view = View(image, self.network.features.image(image))
            clock("image_features")
        return view

    def _resized(self, frame: Frame) -> Tensor:
        """The image ``[1, 3, H, W]`` at this stage's size, on its device."""
        image = torch.from_numpy(resize_image(frame.image, self.camera(frame)))
        return image.permute(2, 0, 1)[None].to(self.device)

    def correct(
        self, frame: Frame, view: View, before: Extrinsic, detail: bool = False, pose_prior: PosePrior | None = None
    ) -> StageTrace:
        """Look at a frame repeatedly, each time from the previous result, until the next stage can take over.

        The finest stage, which no other follows, uses all its looks.

        Args:
            frame: scan and camera; its own extrinsic is not used.
            view: its image, as `view` gives it.
            before: the extrinsic to correct.
            detail: whether to keep the intermediate results of the first look.
            pose_prior: prior on the extrinsic.

        Raises:
            CalibrationError: the first look fails, see `look`.
        """
        look = trace = self.look(frame, view, before, detail, pose_prior)
        for _ in range(self.settings.looks - 1):
            if self.is_settled(look.correction):
                break
            try:
                look = self.look(frame, view, look.after, pose_prior=pose_prior)
            except CalibrationError:  # too few points are left in the image, so the previous result is kept
                break
            trace = trace.followed_by(look)
        return trace

    @torch.inference_mode()
    def look(
        self, frame: Frame, view: View, before: Extrinsic, detail: bool = False, pose_prior: PosePrior | None = None
    ) -> StageTrace:
        """Project the scan under an extrinsic, and correct it once; arguments as for `correct`.

        For a wide lens, the corrections from all its faces are joined to one.

        Raises:
            CalibrationError: too few LiDAR points are inside the image, or the network's correction is not finite.
        """
        if frame.faces:
            trace = self._look_at_faces(frame, view, before, detail)
        else:
            trace = self._look(frame, view, before, detail)
        return trace if pose_prior is None else with_prior(trace, pose_prior, self.covariance_model)

    def _look_at_faces(self, frame: Frame, view: View, before: Extrinsic, detail: bool) -> StageTrace:
        """Join one look through each face that shows enough of the scan."""
        looks, failure = list[StageTrace](), None
        for face, of_face in zip(frame.faces, view.faces, strict=True):
            turn = transform(face.face_from_camera, np.zeros(3))
            try:
                look = self._look(frame.through(face), of_face, turn @ before, detail and not looks)
            except CalibrationError as error:
                failure = error
                continue
            looks.append(look.rotated(face.face_from_camera.T))
        if not looks and failure is not None:
            raise failure
        return join_looks(looks, self.match_error_limit_px, self.covariance_model)

    def _look(self, frame: Frame, view: View, before: Extrinsic, detail: bool) -> StageTrace:
        clock, camera, name = Clock(self.device), self.camera(frame), f"stage {self.number}"
        lidar = projected(frame, before, camera, self.network.config.scales, name)
        clock("projection")
        cut = Cut.of([lidar])
        inputs = make_batch(view.image, [lidar], [camera.matrix], cut)
        with autocast(self.device), after_each(self.network.boxes, clock):
            output = self.network(inputs, view.features, keep_activations=detail)
        correction = extended(output.pose.correction[0], self.settings.gain, frame, name)
        information = output.pose.information
        return StageTrace(
            number=self.number,
            range=self.range,
            camera=camera,
            before=before,
            after=correction @ before,
            correction=correction,
            milliseconds=clock.parts,
            information=None if information is None else information[0].double().cpu().numpy(),
            detail=stage_detail(self.network.config, lidar, cut, output) if detail else None,
            match_error_px=float(expected_error(output.field, inputs.cells[0])[0]),
            matches=matches_of(output.field, inputs.cells[0]),
        )

    def is_settled(self, correction: Transform) -> bool:
        """Whether the next stage can take over, since the correction of a look is within that stage's range."""
        following = RANGES[RANGES.index(self.range) + 1 :] if self.range in RANGES else RANGES[-1:]
        return bool(following) and following[0].contains(correction)


def with_prior(look: StageTrace, pose_prior: PosePrior, model: CovarianceModel) -> StageTrace:
    """A look whose correction is fused with the user's prior; its information stays that of the network.

    The network's correction is weighted by its measured covariance, which is larger than the one that it states.
    """
    correction = pose_prior.corrected(look.correction, model.weight(look), look.before)
    return replace(look, correction=correction, after=correction @ look.before)


def matches_of(found: DisplacementField, cells: Tensor) -> Matches:
    """The matches of a batch of one, of the cells ``[1, 3, h, w]`` that hold a point."""
    occupied = cells[0, 2] > 0

    def picked(grid: Tensor) -> NDArray[np.float32]:
        return grid[0].float()[:, occupied].T.contiguous().cpu().numpy()

    return Matches(picked(cells), picked(found.displacement), picked(found.log_scale.exp()))
