"""What may import what. The design depends on it, so a test keeps it."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
HEAVY = ("torch", "open3d", "rerun", "cv2", "pykitti", "lightning_fabric", "rich", "pandas", "matplotlib")


class RuntimeOnly(ast.NodeTransformer):
    """Removes the bodies of ``if TYPE_CHECKING:``, which only name types."""

    def visit_If(self, node: ast.If) -> ast.AST:
        if ast.unparse(node.test) in ("TYPE_CHECKING", "typing.TYPE_CHECKING"):
            node.body = [ast.Pass()]
        return self.generic_visit(node)


def imported_modules(source: str, package: str = "", types: bool = True) -> Iterator[str]:
    """Full names of everything ``source`` imports, anywhere in it; ``package`` resolves relative imports."""
    tree: ast.AST = ast.parse(source)
    for node in ast.walk(tree if types else RuntimeOnly().visit(tree)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            module = ".".join([*above, *([node.module] if node.module else [])])
            yield module
            yield from (f"{module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Call) and ast.unparse(node.func).rpartition(".")[2] in (
            "import_module",
            "__import__",
        ):
            yield from (arg.value for arg in node.args if isinstance(arg, ast.Constant) and isinstance(arg.value, str))


def violations(package: str, forbidden: tuple[str, ...], exempt: tuple[str, ...] = (), types: bool = True) -> list[str]:
    """``file: module`` for every forbidden import below ``package``, outside the exempt folders."""
    found = []
    for path in sorted((ROOT / package).rglob("*.py")):
        relative = path.relative_to(ROOT)
        if any(relative.is_relative_to(folder) for folder in exempt):
            continue
        for module in imported_modules(path.read_text(encoding="utf-8"), ".".join(relative.parent.parts), types):
            if any(module == name or module.startswith(f"{name}.") for name in forbidden):
                found.append(f"{relative}: {module}")
    return found


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("import rerun as rr", "rerun"),
        ("def f():\n    from rerun.blueprint import Tabs", "rerun.blueprint"),
        ("from calibnet import cascade", "calibnet.cascade"),
        ("from ..network import features", "calibnet.network"),
        ("import importlib\nimportlib.import_module('torch.nn')", "torch.nn"),
    ],
)
def test_the_scan_sees_imports_of_every_form(source: str, expected: str) -> None:
    assert expected in set(imported_modules(source, "calibnet.training"))


def test_types_alone_can_be_left_out() -> None:
    source = "import json\nif TYPE_CHECKING:\n    import torch\nelse:\n    import rerun"
    assert set(imported_modules(source, types=False)) == {"json", "rerun"}


def test_calibnet_knows_no_user_interface() -> None:
    assert violations("calibnet", ("rerun", "rerun_bindings", "rerun_sdk", "click", "rich", "inspector")) == []


def test_inspector_computes_no_calibration() -> None:
    """It reads traces and names types; only the commands put a cascade and a recording together."""
    computing = ("torch", "lightning_fabric", "calibnet.network", "calibnet.cascade", "calibnet.drive")
    computing += ("calibnet.alignment", "calibnet.drive.consensus", "calibnet.training")
    assert violations("inspector", computing, exempt=("inspector/cli",), types=False) == []


ROOM = re.compile(r"^\| `(\w+)` \|.*\|([^|]*)\|$", re.MULTILINE)
"""A row of the table of rooms in docs/architecture.md: the room, what it has, and the rooms that it may import."""
FOUNDATION = ("errors", "runtime", "geometry")
"""Rooms that every other one may import."""


def permitted_imports() -> dict[str, set[str]]:
    """The rooms that each room of ``calibnet`` may import, as docs/architecture.md has them, foundation aside."""
    table = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    return {room: set(re.findall(r"`(\w+)`", others)) for room, others in ROOM.findall(table)}


def actual_imports() -> dict[str, set[str]]:
    """The rooms that each room of ``calibnet`` imports, anywhere and for types as well; foundation aside."""
    found: dict[str, set[str]] = {}
    for path in sorted((ROOT / "calibnet").rglob("*.py")):
        package = path.relative_to(ROOT).parent.parts
        room = package[1] if len(package) > 1 else path.stem
        modules = (name.split(".") for name in imported_modules(path.read_text(encoding="utf-8"), ".".join(package)))
        rooms = {name[1] for name in modules if name[0] == "calibnet" and len(name) > 1}
        found.setdefault(room, set()).update(rooms)
    names = found.keys() - {"__init__", *FOUNDATION}
    return {room: imported & names - {room} for room, imported in found.items() if room in names}


def test_rooms_import_what_the_table_of_the_architecture_says_and_nothing_else() -> None:
    assert actual_imports() == permitted_imports()


def test_the_table_of_rooms_goes_downward_only() -> None:
    earlier = set[str]()
    for room, imported in permitted_imports().items():
        assert imported <= earlier, f"{room} imports rooms below it in the table: {sorted(imported - earlier)}"
        earlier.add(room)


def test_the_foundation_imports_nothing_above_it() -> None:
    above = tuple(f"calibnet.{room}" for room in actual_imports())
    assert [line for room in ("runtime", "geometry") for line in violations(f"calibnet/{room}", above)] == []
    assert set(imported_modules((ROOT / "calibnet" / "errors.py").read_text(encoding="utf-8"))) & set(above) == set()


QUICK = (
    "import calibnet",
    "import calibnet; calibnet.pose_error; calibnet.open_sequence",
    "import calibnet.datasets, calibnet.geometry, calibnet.trace, calibnet.evaluation.runner",
    "import calibnet.datasets.synthetic",
    "import inspector",
    "from inspector.cli.errors import run; from inspector.cli.main import cli",
    *(f"run(cli, {arguments})" for arguments in (["--help"], ["--version"])),
    *(f"run(cli, {[command, '--help']})" for command in ("evaluate", "info", "compare", "check", "export")),
)
"""Statements that load nothing heavy, so that one interpreter can run them after one another."""


def loaded_by(*statements: str) -> dict[str, set[str]]:
    """The heavy modules in ``sys.modules`` of a fresh interpreter after each of the statements."""
    told = f"\nprint('LOADED', *[name for name in {HEAVY!r} if name in sys.modules])\n"
    code = "import sys\n" + told.join(statements) + told
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True, timeout=60
    )
    lines = [line.split()[1:] for line in done.stdout.splitlines() if line.startswith("LOADED")]
    return {statement: set(line) for statement, line in zip(statements, lines, strict=True)}


def test_what_must_stay_quick_imports_nothing_heavy() -> None:
    assert loaded_by(*QUICK) == {statement: set() for statement in QUICK}


def test_the_check_of_heavy_imports_can_fail() -> None:
    assert loaded_by("import json", "import rich") == {"import json": set(), "import rich": {"rich"}}
