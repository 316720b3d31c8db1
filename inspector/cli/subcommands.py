"""Subcommands for each kind of data, of `calib-inspect`, `verify`, `watch` and `live`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from inspector.cli.run_options import Decorator
from inspector.cli.source import Source
from inspector.cli.sources import SOURCES

if TYPE_CHECKING:
    from calibnet.datasets import Sequence

Opening = Callable[[], "Sequence"]


def over_sequences(
    group: click.Group,
    act: Callable[..., object],
    options: Callable[[Source], Decorator],
    verb: str,
    sources: Iterable[Source] = SOURCES,
) -> None:
    """Give a group a subcommand for every kind of data.

    Args:
        group: the group to add them to.
        act: called with what opens the sequence, and with the options; returns what the command does, an exit code.
        options: for a kind of data, the decorator with all options but those that say what to open.
        verb: first words of each one's help, before the data's name.
        sources: kinds of data to offer.
    """
    for source in sources:
        group.add_command(_command(source, act, options(source), verb))


def _command(source: Source, act: Callable[..., object], options: Decorator, verb: str) -> click.Command:
    def run(**asked: Any) -> object:
        opened = {name: asked.pop(name) for name in names}
        if not source.one_mount and asked.get("drive") is None:
            asked["drive"] = False
        as_is = source.given and not disturbed(asked)
        return act(partial(source.open, **opened), camera=opened.get("camera"), as_is=as_is, **asked)

    names = [str(parameter.name) for parameter in source.parameters]
    command = click.command(source.name, help=f"{verb} {source.of}.\n\n{source.note}")(options(run))
    command.params[:0] = source.parameters
    return command


def disturbed(asked: Mapping[str, Any]) -> bool:
    """Whether the options of a run put a miscalibration on the dataset's extrinsic."""
    return asked["range"] is not None or asked["miscalibration"] is not None
