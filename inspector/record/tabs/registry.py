"""The viewer's tabs, in order. A new tab is a module beside this one, listed in `TABS`."""

from __future__ import annotations

from typing import Protocol

from inspector.record.contents import Contents
from inspector.record.observation import Layout, Observation
from inspector.record.subtree import Subtree
from inspector.record.tabs import cascade, cost_volumes, drive, exhibits, hourglass, overview, scene, watch
from inspector.record.tabs.views import View


class Tab(Protocol):
    """The interface of a tab: what it records and how it shows it; the modules here implement it.

    A tab may show entities of another, but each entity is logged by one tab only, except legends.

    Attributes:
        NAME: title in the viewer.
    """

    NAME: str

    def wanted(self, layout: Layout) -> bool:
        """Whether a recording has data for this tab; if not, its other functions are not called."""
        ...

    def log_once(self, rec: Subtree, layout: Layout) -> None:
        """Log what applies to all frames, with `Subtree.log_once`: legends, names and colours of curves."""
        ...

    def log(self, rec: Subtree, observation: Observation, contents: Contents) -> None:
        """Log one frame; the timelines are at the frame, before its first stage, and must be so again afterwards."""
        ...

    def view(self, layout: Layout) -> View:
        """The views of the tab, each of which has data; entities are named as they are logged."""
        ...


TABS: tuple[Tab, ...] = (overview, cascade, exhibits, cost_volumes, hourglass, scene, drive, watch)


def wanted_tabs(layout: Layout) -> list[Tab]:
    """The tabs that a recording has data for."""
    return [tab for tab in TABS if tab.wanted(layout)]
