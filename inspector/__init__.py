"""Look into a running calibration: recordings, views and the command line.

From Python, one calibration goes into a recording of one's own::

    inspector.log_trace(recording, frame, trace, frame.camera_from_lidar)
    recording.send_blueprint(inspector.blueprint(frame, trace, frame.camera_from_lidar))

Names are imported when they are first used: the package itself loads nothing, so that the command line starts quickly.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from inspector.record.contents import Coloring, Contents, Detail, Part
    from inspector.record.user_stream import blueprint, log_trace

__all__ = ["Coloring", "Contents", "Detail", "Part", "blueprint", "log_trace"]

_HOMES = dict.fromkeys(("Coloring", "Contents", "Detail", "Part"), "inspector.record.contents")
_HOMES |= dict.fromkeys(("blueprint", "log_trace"), "inspector.record.user_stream")


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
