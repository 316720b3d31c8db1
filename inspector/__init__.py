"""Look into a running calibration: recordings, views and the command line.

The names of the Python interface are imported when first used, so that the command line starts quickly. Two lines put a
calibrated frame into a recording of one's own, with the layout that shows it::

    inspector.log_trace(recording, frame, trace, frame.camera_from_lidar)
    recording.send_blueprint(inspector.blueprint(frame, trace, frame.camera_from_lidar))
"""

from typing import TYPE_CHECKING

from calibnet.runtime.lazy import lazy_names

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
__getattr__, __dir__ = lazy_names("inspector", _MODULES)
