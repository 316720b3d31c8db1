"""A trained network of another paper as a stage, with the interface of `calibnet.cascade.stage.Stage`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import torch
from torch import Tensor

from calibnet.cascade.around import extended, projected
from calibnet.cascade.stage import View
from calibnet.datasets.frame import Frame
from calibnet.datasets.images.files import resize_image
from calibnet.exhibit import Exhibit
from calibnet.geometry import MiscalibrationRange, PinholeCamera
from calibnet.geometry.types import Extrinsic
from calibnet.methods.learned.network import MethodNetwork
from calibnet.network.batch import make_batch
from calibnet.runtime.clock import Clock
from calibnet.runtime.precision import autocast
from calibnet.trace import StageTrace
from calibnet.weights.manifest import StageSettings


@dataclass(frozen=True)
class MethodStage:
    """A network of a method as a stage.

    Attributes:
        number: 1 (coarsest) to 5 (finest), by its range.
        range: the range that it was trained for.
        network: the network in evaluation mode.
        settings: number of looks, and gain; the image always has the network's input size.
    """

    number: int
    range: MiscalibrationRange
    network: MethodNetwork
    settings: StageSettings = field(default_factory=StageSettings)

    @property
    def device(self) -> torch.device:
        """The device of the network."""
        return next(self.network.parameters()).device

    def camera(self, frame: Frame) -> PinholeCamera:
        """The camera of the frame's image at this stage: with the area of the input and the frame's aspect."""
        config = self.network.config
        return frame.camera.fitted(config.input_height, config.input_width, config.scales[-1])

    def view(self, frame: Frame, clock: Callable[[str], None] = lambda part: None) -> View:
        """The frame's image at this stage's size."""
        image = torch.from_numpy(resize_image(frame.image, self.camera(frame))).permute(2, 0, 1)[None]
        clock("resize")
        return View(image.to(self.device), [])

    def correct(self, frame: Frame, view: View, before: Extrinsic, detail: bool = False) -> StageTrace:
        """Run all looks of the method at a frame, each from the result of the one before.

        Args:
            frame: scan and camera; its own extrinsic is not used.
            view: its image from `view`.
            before: the extrinsic to correct.
            detail: keep the exhibits of the first look.

        Raises:
            CalibrationError: see `look`.
        """
        look = trace = self.look(frame, view, before, detail)
        for _ in range(self.settings.looks - 1):
            look = self.look(frame, view, look.after)
            trace = trace.followed_by(look)
        return trace

    @torch.inference_mode()
    def look(self, frame: Frame, view: View, before: Extrinsic, detail: bool = False) -> StageTrace:
        """Project the scan under an extrinsic, and correct it once; for the arguments see `correct`.

        Raises:
            CalibrationError: too few LiDAR points fall into the image, or the network gives no finite correction.
        """
        clock, camera, name = (
            Clock(self.device),
            self.camera(frame),
            f"{self.network.NAME}'s network of {self.range.label}",
        )
        lidar = projected(frame, before, camera, self.network.config.scales, name)
        clock("projection")
        inputs = make_batch(view.image, [lidar], [camera.matrix])
        with autocast(self.device):
            output = self.network(inputs)
        clock("network")
        correction = extended(output.correction[0], self.settings.gain, frame, name)
        return StageTrace(
            number=self.number,
            range=self.range,
            camera=camera,
            before=before,
            after=correction @ before,
            correction=correction,
            milliseconds=clock.parts,
            exhibits=exhibits(output.shown) if detail else (),
        )


def exhibits(shown: dict[str, Tensor]) -> tuple[Exhibit, ...]:
    """The exhibits of a network's output for a batch of one."""
    return tuple(Exhibit(name, maps[0].float().cpu().numpy()) for name, maps in shown.items())
