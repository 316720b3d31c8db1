"""The layout of the viewer: the tabs of a recording side by side, with all panels collapsed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import rerun.blueprint as rrb

from inspector import entities
from inspector.record.observation import Layout
from inspector.record.subtree import below
from inspector.record.tabs.registry import Tab, wanted_tabs
from inspector.record.tabs.views import View

FRAMES_PER_SECOND = 10.0
"""Playback speed in frames per second, that of KITTI's scanner."""


def make_blueprint(
    layout: Layout,
    tabs: Sequence[Tab] | None = None,
    prefix: str = "",
    timeline: str = entities.FRAME,
    following: bool = False,
) -> rrb.Blueprint:
    """The layout of a recording, or of the part of a recording below a prefix.

    Args:
        layout: what the recording contains.
        tabs: tabs to show; None for all that have data.
        prefix: prefix of the entity paths.
        timeline: timeline to select in the viewer.
        following: whether to show the newest data until the user chooses a time.
    """
    shown = wanted_tabs(layout) if tabs is None else tabs
    root = rrb.Tabs(*(tab.view(layout) for tab in shown), active_tab=0, name=prefix.strip("/") or None)
    if root.name:
        move_below(root, prefix)
    return rrb.Blueprint(
        root,
        rrb.TimePanel(
            state="collapsed",
            timeline=timeline,
            fps=FRAMES_PER_SECOND,
            play_state="Following" if following else None,
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
        auto_layout=False,
    )


def move_below(part: View, prefix: str) -> None:
    """Put a prefix before every entity path of views that are not shown yet."""
    if isinstance(part, rrb.Container):
        for child in part.contents:
            move_below(child, prefix)
        return
    part.origin = _absolute(prefix, str(part.origin))
    contents: Any = part.contents
    expressions = [contents] if isinstance(contents, str) else contents
    part.contents = [_query_below(prefix, expression) for expression in expressions]
    part.visualizer_overrides = {
        _absolute(prefix, str(entity)): overrides for entity, overrides in part.visualizer_overrides.items()
    }


def _query_below(prefix: str, expression: str) -> str:
    """One expression of a view's contents, for instance ``"- /error/rotation/corrected"``."""
    sign, _, path = expression.rpartition(" ")
    moved = path if path.startswith("$origin") else _absolute(prefix, path)
    return f"{sign} {moved}" if sign else moved


def _absolute(prefix: str, path: str) -> str:
    return f"/{below(prefix, path)}".rstrip("/")
