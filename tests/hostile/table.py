"""All rows, and what they need around them."""

from __future__ import annotations

import contextlib
import itertools
import os
from collections.abc import Iterator
from typing import Any
from unittest import mock

from tests.hostile import (
    calibrations,
    clouds,
    features,
    fleets,
    foxglove,
    guesses,
    kinds,
    messages,
    names,
    odd,
    options,
    outputs,
    pictures,
    recordings,
    texts,
    training,
    weights,
)

ROWS = list(
    itertools.chain(
        calibrations.rows(),
        clouds.rows(),
        pictures.rows(),
        texts.rows(),
        recordings.rows(),
        weights.rows(),
        outputs.rows(),
        names.rows(),
        options.rows(),
        fleets.rows(),
        features.rows(),
        foxglove.rows(),
        guesses.rows(),
        kinds.rows(),
        messages.rows(),
        training.rows(),
        odd.rows(),
    )
)


@contextlib.contextmanager
def prepared() -> Iterator[None]:
    """No display, no KITTI folder, and a cascade that costs nothing where a row does not bring weights of its own."""
    from calibnet.cascade.cascade import Cascade
    from tests.support.fakes import FakeCascade

    real = Cascade.load

    def load(preset: str = "compact", stages: Any = None, folder: Any = None, *more: Any, **named: Any) -> Any:
        if folder is not None or preset != "compact":
            return real(preset, stages, folder, *more, **named)
        return FakeCascade(stages or (1, 2, 3, 4, 5))

    clean = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    clean.pop("KITTI_ROOT", None)
    with mock.patch.object(Cascade, "load", staticmethod(load)), mock.patch.dict(os.environ, clean, clear=True):
        recordings.prepare()
        yield
