"""What other packages add by entry points: datasets, heads, methods, their networks and export formats.

A package that registers ``[project.entry-points."calib_inspect.datasets"] mine = "my_package:MyDataset"`` in its
``pyproject.toml`` is found by the name ``mine`` as if it were ours. Nothing of it is imported before it is asked for.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from importlib.metadata import EntryPoint, distributions
from traceback import walk_tb
from typing import Any

from calibnet.errors import ConfigError

PREFIX = "calib_inspect."
GROUPS = ("datasets", "heads", "methods", "networks", "exports")
OURS = {"calibnet", "inspector"}


def plugins(group: str) -> dict[str, EntryPoint]:
    """What installed packages register, by name; of two with the same name, the one found first on the path.

    Args:
        group: one of `GROUPS`.
    """
    found: dict[str, EntryPoint] = {}
    for distribution in distributions():
        with contextlib.suppress(Exception):  # a package whose metadata cannot be read hides no other
            for entry in distribution.entry_points.select(group=f"{PREFIX}{group}"):
                found.setdefault(entry.name, entry)
    return found


def package_at_fault(error: BaseException) -> str:
    """The package whose plugin an error was raised in, or beneath; empty where it was in none."""
    modules = {frame.f_globals.get("__name__", "").partition(".")[0] for frame, _ in walk_tb(error.__traceback__)}
    entries = (entry for group in GROUPS for entry in plugins(group).values())
    return next((_package(entry) for entry in entries if entry.module.partition(".")[0] in modules - OURS), "")


def _package(entry: EntryPoint) -> str:
    return entry.dist.name if entry.dist else entry.module


@dataclass(frozen=True)
class Registry:
    """Things of one kind by name: our own, and those of `plugins`.

    Attributes:
        group: of the entry points.
        kind: what one of them is, for messages.
        own: name to ``module:object``; a plugin cannot take such a name.
    """

    group: str
    kind: str
    own: dict[str, str]

    def names(self) -> tuple[str, ...]:
        """All names, our own first."""
        return (*self.own, *(name for name in sorted(plugins(self.group)) if name not in self.own))

    def __contains__(self, name: object) -> bool:
        return name in self.own or name in plugins(self.group)

    def load(self, name: str) -> Any:
        """Import what has the name.

        Raises:
            ConfigError: nothing has, or the package that registers it is broken.
        """
        if name in self.own:
            return EntryPoint(name, self.own[name], self.group).load()
        entry = plugins(self.group).get(name)
        if entry is None:
            raise ConfigError(f"There is no {self.kind} {name!r}; choose one of {', '.join(self.names())}.")
        try:
            found = entry.load()
            if not callable(found):
                raise TypeError("it is neither a class nor a function")
            return found
        except (Exception, SystemExit) as error:
            package = _package(entry)
            reason = str(error).splitlines()[0] if str(error) else "no reason is given"
            raise ConfigError(
                f"The {self.kind} {name!r} of package {package} cannot be imported ({type(error).__name__}: {reason}); "
                "update the package or uninstall it."
            ) from error
