from __future__ import annotations

import pytest
import torch

from calibnet.training import build
from calibnet.training.data import Source
from tests.support.scene import Scenes
from tests.support.tiny import TINY


@pytest.fixture
def tiny_world(monkeypatch: pytest.MonkeyPatch) -> Scenes:
    """Training builds a tiny network and opens these scenes, as if of the synthetic world: read anew each time."""
    scenes = Scenes()
    sources = [Source(scenes, 1.0, synthetic=True)]
    monkeypatch.setattr(build, "load_preset", lambda name: TINY)
    monkeypatch.setattr(build, "training_sources", lambda options: (sources, [Scenes(1)]))
    torch.set_num_threads(1)
    return scenes
