"""Look into a running calibration: recordings, views and the command line.

What a Python user needs is here by name and loaded when it is first used, so that the command line starts quickly.
Two lines put a calibrated frame into a recording of one's own, with the layout that shows it::

    inspector.log_trace(recording, frame, trace, frame.camera_from_lidar)
    recording.send_blueprint(inspector.blueprint(frame, trace, frame.camera_from_lidar))
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from inspector.record.contents import Coloring as Coloring
    from inspector.record.contents import Contents as Contents
    from inspector.record.contents import Detail as Detail
    from inspector.record.contents import Part as Part
    from inspector.record.user_stream import blueprint as blueprint
    from inspector.record.user_stream import log_trace as log_trace

_MODULES = {
    "Coloring": "inspector.record.contents",
    "Contents": "inspector.record.contents",
    "Detail": "inspector.record.contents",
    "Part": "inspector.record.contents",
    "blueprint": "inspector.record.user_stream",
    "log_trace": "inspector.record.user_stream",
}

__all__ = sorted(_MODULES)


def __getattr__(name: str) -> Any:
    """Load a name of the package at its first use."""
    if name not in _MODULES:
        raise AttributeError(f"module 'inspector' has no attribute {name!r}")
    return getattr(import_module(_MODULES[name]), name)


def __dir__() -> list[str]:
    """The names, loaded or not."""
    return list(__all__)
