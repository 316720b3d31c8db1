"""Where a command's results go: tables on the terminal, JSON into a file or, with ``-``, to stdout."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from calibnet.runtime.whole_file import write_whole

if TYPE_CHECKING:
    from rich.console import Console

JSON_FILE = click.Path(dir_okay=False, writable=True, allow_dash=True)
"""Type of a ``--json FILE|-`` option."""


def console_beside(json_file: str | None) -> Console:
    """The console for tables: stderr when the JSON takes stdout."""
    from rich.console import Console

    return Console(stderr=json_file == "-", highlight=False)


def prepare_json(json_file: str | None) -> None:
    """Create the folder of the file, so that a path that cannot be written fails before the work."""
    if json_file not in (None, "-"):
        Path(str(json_file)).parent.mkdir(parents=True, exist_ok=True)


def write_json(json_file: str | None, content: dict[str, Any]) -> None:
    """Write ``content`` whole or not at all; without a file nothing is written."""
    if json_file is None:
        return
    text = json.dumps(content, indent=2)
    if json_file == "-":
        click.echo(text)
        return
    write_whole(Path(json_file), f"{text}\n".encode())
