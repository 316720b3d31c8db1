"""The layout: its tabs, and that no view is without data."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
import rerun.blueprint as rrb

from inspector.blueprint import make_blueprint
from inspector.observation import Detail, Grid, Layout, StageLayout

GRIDS = (Grid(8, 20, 64), Grid(16, 10, 32))


def layout(has_reference: bool = True, detail: Detail = Detail.FULL) -> Layout:
    return Layout((StageLayout(3, "5/0.5", GRIDS), StageLayout(5, "1/0.1", GRIDS)), has_reference, detail)


def walk(part: Any) -> Iterator[Any]:
    yield part
    for child in getattr(part, "contents", []) if isinstance(part, rrb.Container) else []:
        yield from walk(child)


def tabs(blueprint: rrb.Blueprint) -> Any:
    return blueprint.root_container


def names(blueprint: rrb.Blueprint) -> list[str]:
    return [str(part.name) for part in walk(tabs(blueprint)) if isinstance(part, rrb.View)]


def test_tabs_are_those_of_the_design() -> None:
    parts = tabs(make_blueprint(layout())).contents
    assert [str(part.name) for part in parts] == ["Overview", "Cascade", "Cost volumes", "Hourglass", "3D"]


def test_every_stage_and_scale_has_its_views() -> None:
    views = names(make_blueprint(layout()))
    for stage in ("stage 3 (±5°/0.5 m)", "stage 5 (±1°/0.1 m)"):
        assert f"After {stage}" in views
    assert sum("whole cost volume" in name for name in views) == 4
    assert sum("before the hourglass" in name for name in views) == 4


@pytest.mark.parametrize(
    ("has_reference", "detail", "absent"),
    [
        (False, Detail.FULL, ("eference", "error", "true", "iscalibrated")),
        (True, Detail.OVERVIEW, ("whole cost volume",)),
    ],
)
def test_no_view_without_data(has_reference: bool, detail: Detail, absent: tuple[str, ...]) -> None:
    views = names(make_blueprint(layout(has_reference, detail)))
    assert views
    assert not [name for name in views if any(text in name for text in absent)]


def test_a_run_without_details_has_no_empty_tabs() -> None:
    bare = Layout((StageLayout(3, "5/0.5", ()),), True, Detail.FULL)
    assert [str(part.name) for part in tabs(make_blueprint(bare)).contents] == ["Overview", "Cascade", "3D"]
