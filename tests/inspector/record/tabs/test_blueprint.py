"""The layout: its tabs, and that no view is without data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest
import rerun.blueprint as rrb

from inspector.record.contents import Coloring, Contents, Detail, Part
from inspector.record.observation import Grid, Layout, StageLayout
from inspector.record.tabs.blueprint import make_blueprint
from inspector.record.tabs.views import COLORED_BY

GRIDS = (Grid(8, 20, 64, 9), Grid(16, 10, 32, 9))


def layout(has_reference: bool = True, contents: Contents | None = None) -> Layout:
    stages = (StageLayout(3, "5/0.5", GRIDS), StageLayout(5, "1/0.1", GRIDS))
    return Layout(stages, has_reference, contents or Contents.of(Detail.FULL))


def walk(part: Any) -> Iterator[Any]:
    yield part
    for child in getattr(part, "contents", []) if isinstance(part, rrb.Container) else []:
        yield from walk(child)


def tabs(blueprint: rrb.Blueprint) -> Any:
    return blueprint.root_container


def names(blueprint: rrb.Blueprint) -> list[str]:
    return [str(part.name) for part in walk(tabs(blueprint)) if isinstance(part, rrb.View)]


@pytest.mark.parametrize("with_drive", [False, True])
def test_tabs_are_in_their_order_and_a_drive_has_one_more(with_drive: bool) -> None:
    parts = tabs(make_blueprint(replace(layout(), with_drive=with_drive))).contents
    expected = [
        "Overview",
        "Cascade",
        "Cost volumes",
        "Hourglass",
        "3D",
        *(["Whole drive as one"] if with_drive else []),
    ]
    assert [str(part.name) for part in parts] == expected


def test_every_stage_and_scale_has_its_views() -> None:
    views = names(make_blueprint(layout()))
    for stage in ("stage 3 (±5°/0.5 m)", "stage 5 (±1°/0.1 m)"):
        assert f"After {stage}" in views
    won = ["displacement that won", "true displacement", "peak probability", "matching scores"]
    for part in (*won, "decided, before", "share on the truth, after", "channels before"):
        assert sum(part in name for name in views) == 4, part


@pytest.mark.parametrize(
    ("has_reference", "contents", "absent"),
    [
        (False, Contents.of(Detail.FULL), ("eference", "otation error", "ranslation error", "true", "iscalibrated")),
        (True, Contents.of(Detail.OVERVIEW), ("matching scores", "sliders", "a tile a displacement")),
        (True, Contents.of(Detail.CUSTOM, frozenset({Part.SCENE})), ("After", "error", "hourglass", "displacement")),
        (
            True,
            Contents.of(Detail.CUSTOM, frozenset({Part.CURVES})),
            ("oloured through", "After", "sliders"),
        ),
    ],
)
def test_no_view_without_data(has_reference: bool, contents: Contents, absent: tuple[str, ...]) -> None:
    views = names(make_blueprint(layout(has_reference, contents)))
    assert views
    assert not [name for name in views if any(text in name for text in absent)]


def test_a_run_without_details_has_no_empty_tabs() -> None:
    bare = Layout((StageLayout(3, "5/0.5", ()),), True, Contents.of(Detail.FULL))
    assert [str(part.name) for part in tabs(make_blueprint(bare)).contents] == ["Overview", "Cascade", "3D"]


@pytest.mark.parametrize("coloring", Coloring)
def test_the_legend_is_that_of_the_colours(coloring: Coloring) -> None:
    views = names(make_blueprint(layout(contents=Contents.of(Detail.FULL, color=coloring))))
    assert COLORED_BY[coloring] in views
    assert not [COLORED_BY[other] for other in Coloring if other is not coloring and COLORED_BY[other] in views]


def test_below_a_prefix_every_path_of_every_view_has_it() -> None:
    plain, moved = (
        tabs(make_blueprint(replace(layout(), with_drive=True), prefix=prefix)) for prefix in ("", "/car/left")
    )
    assert (plain.name, moved.name) == (None, "car/left")
    pairs = list(zip(walk(plain), walk(moved), strict=True))
    views = [(one, other) for one, other in pairs if isinstance(one, rrb.View)]
    assert len(views) > 30
    for one, other in views:
        assert other.origin == f"/car/left/{one.origin.lstrip('/')}".rstrip("/")
        assert set(other.visualizer_overrides) == {f"/car/left{path}" for path in one.visualizer_overrides}
    assert queries(moved, "Rotation error [deg]") == [
        "$origin/**",
        "- /car/left/error/rotation/corrected",
        "- /car/left/error/rotation/initial",
    ]
    result = "Result (on “step”: every stage)"
    assert queries(moved, result) == ["/car/left/image", "/car/left/overlay/current/**"]
    assert queries(moved, "Yaw off the reference [deg]") == ["$origin/**"]


def queries(root: Any, name: str) -> list[str]:
    return next(list(part.contents) for part in walk(root) if part.name == name)
