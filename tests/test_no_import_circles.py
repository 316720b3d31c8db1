"""No module imports one that imports it back, not even to name a type: every circle is two rooms that are one."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("calibnet", "inspector")


def sources(root: Path, packages: tuple[str, ...]) -> dict[str, str]:
    """Source of every module by its full name."""
    found = {}
    for package in packages:
        for path in sorted((root / package).rglob("*.py")):
            parts = path.relative_to(root).with_suffix("").parts
            name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
            found[name] = path.read_text(encoding="utf-8")
    return found


def outside_functions(node: ast.AST) -> Iterator[ast.AST]:
    """Every node that runs when the module does, and the bodies of ``if TYPE_CHECKING:``."""
    for child in ast.iter_child_nodes(node):
        if not isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            yield child
            yield from outside_functions(child)


def imports(name: str, modules: dict[str, str]) -> set[str]:
    """The modules that one imports; a name taken from a package counts as that package's ``__init__``."""
    wanted = set()
    for node in outside_functions(ast.parse(modules[name])):
        if isinstance(node, ast.Import):
            wanted |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name} imports relatively; this test reads full names."
            for alias in node.names:
                submodule = f"{node.module}.{alias.name}"
                wanted.add(submodule if submodule in modules else str(node.module))
    return wanted & modules.keys()


def circle(modules: dict[str, str]) -> list[str]:
    """Names of the modules along one circle, or nothing."""
    try:
        TopologicalSorter({name: imports(name, modules) for name in modules}).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


@pytest.mark.parametrize(
    "back",
    [
        "import p.a",
        "from p.a import A",
        "from p import a",
        "class B:\n    from p.a import A",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from p.a import A",
    ],
)
def test_a_circle_is_found_in_imports_of_every_form(back: str) -> None:
    modules = {"p": "", "p.a": "from p import c", "p.c": "from p.b import B", "p.b": back}
    assert set(circle(modules)) == {"p.a", "p.b", "p.c"}


def test_a_module_that_asks_its_own_package_for_a_sibling_is_a_circle() -> None:
    assert set(circle({"p": "from p.a import A", "p.a": "from p import A"})) == {"p", "p.a"}


def test_what_a_function_imports_closes_no_circle() -> None:
    assert circle({"p": "", "p.a": "import p.b", "p.b": "def f():\n    import p.a"}) == []


def test_no_module_imports_itself_through_others() -> None:
    modules = sources(ROOT, PACKAGES)
    assert {"calibnet", "inspector", "calibnet.datasets.synthetic.world"} <= modules.keys()
    assert circle(modules) == []


def rooms(package: str, modules: dict[str, str]) -> dict[str, set[str]]:
    """The rooms of a package, its folders and the modules beside them, with those that each imports."""
    found: dict[str, set[str]] = {}
    for name in modules:
        if name.startswith(f"{package}."):
            imported = {one.split(".")[1] for one in imports(name, modules) if one.startswith(f"{package}.")}
            found.setdefault(name.split(".")[1], set()).update(imported)
    return {room: imported - {room} for room, imported in found.items()}


def test_two_rooms_that_import_each_other_are_seen() -> None:
    modules = {"p.r.a": "import p.s.a", "p.r.b": "", "p.s.a": "", "p.s.b": "import p.r.b"}
    assert rooms("p", modules) == {"r": {"s"}, "s": {"r"}}


@pytest.mark.parametrize("package", PACKAGES)
def test_no_room_imports_itself_through_others(package: str) -> None:
    TopologicalSorter(rooms(package, sources(ROOT, PACKAGES))).prepare()
