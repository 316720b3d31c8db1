"""Each part of the wall time is told once."""

import pytest
import torch

from calibnet.runtime import clock as module
from calibnet.runtime.clock import Clock


def test_what_is_timed_elsewhere_is_skipped(monkeypatch: pytest.MonkeyPatch):
    moments = iter([0.0, 1.0, 5.0, 7.0, 7.5])
    monkeypatch.setattr(module.time, "perf_counter", lambda: next(moments))
    clock = Clock(torch.device("cpu"))
    clock("resize")
    clock.skip()
    clock("resize")
    clock("image_features")
    assert clock.parts == {"resize": 3000.0, "image_features": 500.0}
