"""One trained network of another paper's method, used on a frame as `calibnet.cascade.stage.Stage` is."""

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
    """A network of a method.

    Attributes:
        number: 1 (coarsest) to 5 (finest), by its range.
        range: what it was trained for.
        network: in evaluation mode.
        settings: looks and gain; the image always has the network's size.
    """

    number: int
    range: MiscalibrationRange
    network: MethodNetwork
    settings: StageSettings = field(default_factory=StageSettings)

    @property
    def device(self) -> torch.device:
        """Where the network lies."""
        return next(self.network.parameters()).device

    def camera(self, frame: Frame) -> PinholeCamera:
        """The camera of this stage's image of a frame: of the input's area, in the frame's aspect."""
        config = self.network.config
        return frame.camera.fitted(config.input_height, config.input_width, config.scales[-1])

    def view(self, frame: Frame, clock: Callable[[str], None] = lambda part: None) -> View:
        """The frame's image as this stage sees it."""
        image = torch.from_numpy(resize_image(frame.image, self.camera(frame))).permute(2, 0, 1)[None]
        clock("resize")
        return View(image.to(self.device), [])

    def correct(self, frame: Frame, view: View, before: Extrinsic, detail: bool = False) -> StageTrace:
        """Look at a frame, and again from where that arrives, as often as the method does.

        Args:
            frame: scan and camera; its own extrinsic is not looked at.
            view: its image, as `view` gives it.
            before: the extrinsic to correct.
            detail: keep what the network has to show of the first look.

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
        """Project the scan under an extrinsic, and correct that once; arguments as of `correct`.

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
    """What a network has to show of a batch of one."""
    return tuple(Exhibit(name, maps[0].float().cpu().numpy()) for name, maps in shown.items())
