"""Logs a calibration to a recording of the user's own, beside whatever else is in it.

    inspector.log_trace(recording, frame, trace, frame.camera_from_lidar)
    recording.send_blueprint(inspector.blueprint(frame, trace, frame.camera_from_lidar))

The stream stays the user's: this module never opens, flushes or closes it, or changes how Rerun treats errors.
"""

from __future__ import annotations

from collections.abc import Sequence

import rerun as rr
import rerun.blueprint as rrb

from calibnet.datasets.frame import Frame
from calibnet.errors import ConfigError
from calibnet.geometry.types import Extrinsic
from calibnet.trace import CascadeTrace
from inspector.record.contents import Coloring, Contents, Detail
from inspector.record.frame import log_frame
from inspector.record.observation import Layout, Observation
from inspector.record.subtree import Subtree
from inspector.record.tabs.blueprint import make_blueprint
from inspector.record.tabs.registry import Tab, wanted_tabs

EVERYTHING = Contents.of(Detail.FULL)


def log_trace(
    recording: rr.RecordingStream,
    frame: Frame,
    trace: CascadeTrace,
    reference: Extrinsic | None = None,
    prefix: str = "",
    contents: Contents = EVERYTHING,
) -> None:
    """Log one calibrated frame and its trace, with the entities of a recording of ``calib-inspect``.

    The timelines ``frame``, ``time`` and ``step`` are set to this frame and stay there, so that what is logged next
    belongs to it as well. Legends and names of curves are logged with the first frame below a prefix.

    Args:
        recording: any stream; its properties are not changed.
        frame: the calibrated frame.
        trace: trace from `calibnet.cascade.cascade.Cascade.calibrate`, which has cost volumes only with
            ``detail=True``.
        reference: the true ``camera_from_lidar``, 4x4; None if unknown.
        prefix: entity path above everything, for instance one for each camera of a car.
        contents: what to log of the frame.

    Raises:
        ConfigError: points are to be coloured by error, but there is no reference.
    """
    observation = _observe(frame, trace, reference, contents)
    layout, rec = Layout.of(observation, contents), Subtree(recording, prefix)
    tabs = wanted_tabs(layout)
    for tab in tabs:
        tab.log_once(rec, layout)
    log_frame(rec, observation, contents)
    for tab in tabs:
        tab.log(rec, observation, contents)


def blueprint(
    frame: Frame,
    trace: CascadeTrace,
    reference: Extrinsic | None = None,
    prefix: str = "",
    tabs: Sequence[str] | None = None,
    contents: Contents = EVERYTHING,
) -> rrb.Blueprint:
    """The layout for the data of `log_trace`, whose ``root_container`` can be put among other views.

    Args:
        frame: any of the logged frames.
        trace: its trace, which determines the stages and cost volumes to show.
        reference: as for `log_trace`.
        prefix: as for `log_trace`.
        tabs: names of the tabs to show, such as ``["Overview", "3D"]``; all that have data if empty.
        contents: as for `log_trace`.

    Raises:
        ConfigError: a name is not that of a tab, or the tab has no data.
    """
    layout = Layout.of(_observe(frame, trace, reference, contents), contents)
    return make_blueprint(layout, _named(tabs, layout) if tabs else None, prefix)


def _observe(frame: Frame, trace: CascadeTrace, reference: Extrinsic | None, contents: Contents) -> Observation:
    if contents.color is Coloring.ERROR and reference is None:
        raise ConfigError("Points cannot be coloured by error without a reference; give a reference or another color.")
    return Observation(frame, trace, reference)


def _named(names: Sequence[str], layout: Layout) -> list[Tab]:
    known = {tab.NAME: tab for tab in wanted_tabs(layout)}
    for name in names:
        if name not in known:
            raise ConfigError(f"{name!r} is not a tab of this trace; choose from {', '.join(known)}.")
    return [known[name] for name in names]
