"""Output of a command: tables and sentences on the terminal, files, and JSON, with ``-`` to stdout."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from calibnet.runtime.text import quoted_lines
from calibnet.runtime.writing import Kind, allow_overwriting, check_output, write_whole

if TYPE_CHECKING:
    from rich.console import Console


def _let_overwrite(ctx: click.Context, _: click.Parameter, asked: bool) -> None:
    if asked:
        allow_overwriting()


overwrite_option = click.option(
    "--overwrite",
    is_flag=True,
    expose_value=False,
    callback=_let_overwrite,
    help="Let outputs replace files of any kind; by default they replace only files of their own kind.",
)
"""Option of every command that writes files named by its user."""


class OutputFile(click.Path):
    """A file to write, whose name is not that of a folder: `Path` would make the file ``out`` of ``out/``."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Refuse a folder, whether it exists or not."""
        name = os.fspath(value)
        last = name.rpartition(os.sep)[2]
        if last in ("", os.curdir, os.pardir) or os.path.isdir(name):  # noqa: PTH112 - false for names too long
            self.fail(f"{name!r} names a folder; give the name of a file.", param, ctx)
        return super().convert(value, param, ctx)


OUTPUT_FILE = OutputFile(path_type=Path)
JSON_FILE = OutputFile(allow_dash=True)
"""Type of a ``--json FILE|-`` option."""


def console_beside(json_file: str | None) -> Console:
    """The console for tables: stderr if the JSON goes to stdout."""
    return make_console(stderr=json_file == "-")


NARROWEST = 60
"""Smallest width of a table: narrower, rich would leave numbers out, and lines broken by the terminal are better."""


def make_console(stderr: bool = True) -> Console:
    """A console that quotes the foreign text in what it prints and does not break sentences, as `say` does."""
    from rich.console import Console

    class Quoting(Console):
        def print(self, *objects: Any, **options: Any) -> None:
            sentences = all(isinstance(one, str) for one in objects)  # rich would break "8 cm" in two, also in files
            said = (quoted_lines(one) if isinstance(one, str) else one for one in objects)
            super().print(*said, **{"soft_wrap": sentences, **options})

    console = Quoting(stderr=stderr, highlight=False, markup=False, emoji=False)  # names are not markup
    if console.width < NARROWEST:
        console.width = NARROWEST
    return console


def say(text: object, err: bool = False) -> None:
    """Print text of ours, in which foreign text is quoted."""
    click.echo(quoted_lines(text), err=err)


def prepare(file: Path | None, kind: Kind) -> None:
    """Check and `hold` an output, so that a path that cannot be written fails before the work.

    Raises:
        OutputError: the output must not replace what is there, cannot be written, or is being written by another run.
    """
    if file is not None:
        check_output(file, kind)
        hold(file)


def hold(file: Path) -> None:
    """Let no other run write an output until the command ends, so that all outputs of a command are of one run.

    A drive of a fleet is no command; its folder is its own.

    Raises:
        OutputError: another run has it, or it cannot be written.
    """
    from calibnet.runtime.claim import locked

    context = click.get_current_context(silent=True)
    if context is None or file in (held := context.meta.setdefault(__name__, set())):
        return
    context.with_resource(locked(file))
    held.add(file)


def prepare_json(json_file: str | None) -> None:
    """Do the same for the file of a ``--json`` option."""
    prepare(None if json_file in (None, "-") else Path(str(json_file)), Kind.JSON)


def write(file: Path, content: bytes, kind: Kind) -> None:
    """Write an output whole or not at all, and say if it replaces a file."""
    if write_whole(file, content, kind):
        say(f"Replaced {file}.", err=True)


def write_json(json_file: str | None, content: dict[str, Any]) -> None:
    """Write ``content`` whole or not at all; without a file nothing is written."""
    if json_file is None:
        return
    text = json.dumps(content, indent=2)
    if json_file == "-":
        click.echo(text)
        return
    write(Path(json_file), f"{text}\n".encode(), Kind.JSON)


def keep_json(json_file: str | None, content: dict[str, Any], first: bool) -> None:
    """Write the results so far, if a file is asked for; says what it replaces only the first time."""
    if json_file in (None, "-"):
        return
    if first:
        write_json(json_file, content)
    else:
        write_whole(Path(str(json_file)), (json.dumps(content, indent=2) + "\n").encode(), Kind.JSON)
