"""The picture under the maps: where it lies, and that it is what the stage saw."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import rerun as rr
from PIL import Image

from inspector.record.contents import Contents, Detail
from inspector.record.observation import Observation
from inspector.record.pictures.underlay import BRIGHTNESS, log_underlays
from inspector.record.subtree import Subtree

Read = Callable[..., list[tuple[Any, Any]]]


@pytest.mark.parametrize("on_its_head", [False, True])
def test_the_picture_lies_under_the_cells_as_the_stage_saw_it(
    fakes: ModuleType, read: Read, tmp_path: Path, on_its_head: bool
) -> None:
    frame = fakes.make_frame(0)
    image = np.zeros_like(frame.image)
    image[: image.shape[0] // 2, : image.shape[1] // 2] = 200  # bright in its upper left quarter
    trace = fakes.FakeCascade().calibrate(frame, frame.camera_from_lidar)
    stage = trace.stages[0]
    if on_its_head:
        stage = replace(stage, upright=np.diag([-1.0, -1.0, 1.0]))
    observation = Observation(replace(frame, image=image), replace(trace, stages=(stage,)), None)

    stream = rr.RecordingStream("mine")
    stream.save(tmp_path / "one.rrd")
    rec = Subtree(stream)
    rec.set_frame(0, 0.0)
    log_underlays(rec, observation, Contents.of(Detail.FULL))
    stream.disconnect()

    for scale in stage.detail.scales:
        entity = f"stage_{stage.number}/scale_{scale.stride}/picture"
        ((_, blob),) = read(tmp_path / "one.rrd", entity, "EncodedImage:blob")
        ((_, factor),) = read(tmp_path / "one.rrd", entity, "Transform3D:scale")
        shown = np.asarray(Image.open(io.BytesIO(bytes(blob.as_py()[0])))).astype(float)
        if on_its_head:
            shown = shown[::-1, ::-1]
        height, width = shown.shape
        np.testing.assert_allclose(shown[5 : height // 2 - 5, 5 : width // 2 - 5], 200 * BRIGHTNESS, atol=4)
        assert max(shown[height // 2 + 5 :].max(), shown[:, width // 2 + 5 :].max()) < 12
        across, down, _ = np.ravel(factor.as_py())
        assert (across * width, down * height) == pytest.approx(
            (stage.camera.width / scale.stride, stage.camera.height / scale.stride)
        )
