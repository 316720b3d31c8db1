"""A tab is one object that keeps to `Tab`, and one name in the registry."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from inspector.record.contents import Contents, Part
from inspector.record.observation import Layout, Observation
from inspector.record.subtree import Subtree
from inspector.record.tabs import registry
from inspector.record.tabs.blueprint import make_blueprint
from inspector.record.tabs.registry import TABS, Tab
from inspector.record.tabs.views import View

Read = Callable[..., list[tuple[Any, Any]]]


class Brightness:
    """A tab with one curve, the image's mean brightness, where curves are wanted."""

    NAME = "Brightness"

    def wanted(self, layout: Layout) -> bool:
        return Part.CURVES in layout.contents.parts

    def log_once(self, rec: Subtree, layout: Layout) -> None:
        rec.log_once("brightness", rr.SeriesLines(names="mean"))

    def log(self, rec: Subtree, observation: Observation, contents: Contents) -> None:
        rec.log("brightness", rr.Scalars(float(observation.frame.image.mean())))

    def view(self, layout: Layout) -> View:
        return rrb.TimeSeriesView(origin="/brightness", name=self.NAME)


@pytest.fixture
def toy(monkeypatch: pytest.MonkeyPatch) -> Tab:
    tab = Brightness()
    monkeypatch.setattr(registry, "TABS", (*TABS, tab))
    return tab


def test_a_registered_tab_is_recorded_and_shown(
    toy: Tab, record: Callable[..., Any], read: Read, fakes: Any, tmp_path: Path
) -> None:
    file = tmp_path / "toy.rrd"
    record(file, detail="custom", parts=("curves",), stages=(5,))
    recorded = {frame: value.as_py() for frame, value in read(file, "brightness", "Scalars:scalars")}
    assert recorded == {index: [fakes.make_frame(index).image.mean()] for index in range(3)}
    assert "Brightness" in shown_names(file)


def test_a_tab_that_is_not_wanted_leaves_no_trace(toy: Tab, record: Callable[..., Any], tmp_path: Path) -> None:
    file = tmp_path / "toy.rrd"
    record(file, length=1, detail="custom", parts=("overlays",), stages=(5,))
    assert "/brightness" not in {
        str(column.entity_path) for column in RrdReader(file).store().schema().component_columns()
    }
    assert "Brightness" not in shown_names(file)


def test_a_tabs_views_follow_its_entities_below_a_prefix(toy: Tab) -> None:
    (view,) = make_blueprint(
        Layout((), False, Contents(frozenset({Part.CURVES}), False)), [toy], "left"
    ).root_container.contents
    assert view.origin == "/left/brightness"


def shown_names(file: Path) -> set[str]:
    """Names of all views and containers of the layout that a recording brings along."""
    reader, names = RrdReader(file), set()
    (blueprint,) = reader.blueprints()
    for chunk in reader.store(store=blueprint).stream():
        batch = chunk.to_record_batch()
        for component in set(batch.schema.names) & {"ViewBlueprint:display_name", "ContainerBlueprint:display_name"}:
            names |= {name for row in batch[component].to_pylist() for name in row or ()}
    return names


@pytest.mark.parametrize("tab", TABS, ids=lambda tab: tab.NAME)
def test_a_tabs_title_is_its_name(tab: Tab, full_layout: Layout) -> None:
    assert tab.wanted(full_layout)
    assert tab.view(full_layout).name == tab.NAME


@pytest.fixture
def full_layout() -> Layout:
    from inspector.record.contents import Detail
    from inspector.record.observation import Grid, StageLayout

    return Layout(
        (StageLayout(3, "5/0.5", (Grid(8, 20, 64, 9),), ("Masks",), ("Score",)),),
        True,
        Contents.of(Detail.FULL),
        with_drive=True,
        with_watch=True,
    )
