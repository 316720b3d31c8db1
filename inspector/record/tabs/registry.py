"""The viewer's tabs, in their order. A new one is a module beside this one, and its name in `TABS`."""

from __future__ import annotations

from typing import Protocol

from inspector.record.contents import Contents
from inspector.record.observation import Layout, Observation
from inspector.record.subtree import Subtree
from inspector.record.tabs import cascade, cost_volumes, drive, exhibits, hourglass, overview, scene, watch
from inspector.record.tabs.views import View


class Tab(Protocol):
    """What a tab records and how it shows it; the modules here are tabs themselves.

    A tab may show entities of another, but each entity is logged by one alone; legends may be logged by several.

    Attributes:
        NAME: its title in the viewer.
    """

    NAME: str

    def wanted(self, layout: Layout) -> bool:
        """Whether a recording has anything for this tab; if not, no other function of it is called."""
        ...

    def log_once(self, rec: Subtree, layout: Layout) -> None:
        """Log with `Subtree.log_once` what holds for all frames: legends, names and colours of curves."""
        ...

    def log(self, rec: Subtree, observation: Observation, contents: Contents) -> None:
        """Log one frame; the timelines stand at it, before its first stage, and must stand there again afterwards."""
        ...

    def view(self, layout: Layout) -> View:
        """The views of the tab, of which each has data; entities are named as they are logged."""
        ...


TABS: tuple[Tab, ...] = (overview, cascade, exhibits, cost_volumes, hourglass, scene, drive, watch)


def wanted_tabs(layout: Layout) -> list[Tab]:
    """The tabs that a recording has data for."""
    return [tab for tab in TABS if tab.wanted(layout)]
