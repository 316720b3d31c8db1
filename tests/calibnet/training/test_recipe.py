from __future__ import annotations

import ast
import json
from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import pytest

from calibnet.geometry import RANGES, MiscalibrationRange
from calibnet.training import augmentation_recipe, recipe
from calibnet.training.options import TrainingOptions
from calibnet.training.recipe import RECIPE, Recipe, Step, changed_knobs
from tests.support.tiny import TINY

FOLDER = Path(recipe.__file__).parent
PARTS = [field.name for field in fields(Recipe) if is_dataclass(getattr(RECIPE, field.name))]


def knobs() -> Iterator[tuple[str, str]]:
    """The parts of the recipe and the names of their knobs."""
    for part in PARTS:
        yield from ((part, field.name) for field in fields(getattr(RECIPE, part)))


@pytest.mark.parametrize("module", [recipe, augmentation_recipe])
def test_every_knob_says_what_it_does(module: object) -> None:
    tree = ast.parse(Path(str(module.__file__)).read_text(encoding="utf-8"))
    classes = [node for node in tree.body if isinstance(node, ast.ClassDef) and node.name != "Recipe"]
    assert classes
    for definition in classes:
        for position, node in enumerate(definition.body):
            if isinstance(node, ast.AnnAssign):
                said = definition.body[position + 1]
                assert isinstance(said, ast.Expr) and isinstance(said.value, ast.Constant), ast.unparse(node)


def test_every_knob_is_turned_somewhere() -> None:
    read: set[str] = set()
    for path in FOLDER.glob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        read |= {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    assert [knob for knob in knobs() if knob[1] not in read] == []


@pytest.mark.parametrize(
    ("stage", "degrees", "metres", "residual_share"),
    [(1, 20, 1.5, 0.7), (2, 10, 1.0, 0.7), (3, 5, 0.9, 0.4), (4, 2, 0.5, 0.4), (5, 1.5, 0.35, 0.4)],
)
def test_last_stages_are_drawn_wider_in_translation(
    stage: int, degrees: float, metres: float, residual_share: float
) -> None:
    draws = RECIPE.draws.of(RANGES[stage - 1])
    assert draws.range == MiscalibrationRange(degrees, metres)
    assert draws.residual_share == residual_share


def test_a_range_of_one_s_own_is_drawn_as_it_is() -> None:
    own = MiscalibrationRange(7.0, 0.3)
    assert RECIPE.draws.of(own).range == own and RECIPE.draws.of(own).residual_share == 0.7


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"minutes": 60.0}, 6000),
        ({"samples": 100_000}, 6000),
        ({"samples": 9000}, 3000),
        ({"samples": 40}, 13),
        ({"minutes": 60.0, "initialize": "neighbour.safetensors"}, 0),
        ({"minutes": 60.0, "initialize": "neighbour.safetensors", "warm_up": 500}, 500),
        ({"minutes": 60.0, "warm_up": 0}, 0),
        ({"minutes": 60.0, "warm_up": 9000}, 9000),
        ({"samples": 900, "warm_up": 9000}, 300),
    ],
)
def test_the_warm_up_of_a_run(given: dict[str, float | str], expected: int) -> None:
    options = TrainingOptions("tiny", "5/0.5", "out", **given)  # type: ignore[arg-type]
    assert RECIPE.of_run(options, TINY).features == replace(RECIPE.features, warm_up=expected)


def test_features_never_train_alone_without_the_hybrid_loss() -> None:
    options = TrainingOptions("tiny", "5/0.5", "out", minutes=1.0, warm_up=9000)
    features = RECIPE.of_run(options, replace(TINY, hybrid_loss=False)).features
    assert (features.warm_up, features.every) == (0, 0)


def test_changed_knobs_are_named() -> None:
    assert changed_knobs(RECIPE, RECIPE) == {}
    heavier = replace(RECIPE, losses=replace(RECIPE.losses, pose=3.0))
    assert changed_knobs(heavier, RECIPE) == {"losses.pose": 3.0}
    shorter = replace(RECIPE, schedule=(Step(RANGES[2], 1.0, None, 1.0),))
    assert list(changed_knobs(shorter, RECIPE)) == ["schedule"]
    assert json.loads(json.dumps(changed_knobs(shorter, RECIPE)))["schedule"][0]["share"] == 1.0
