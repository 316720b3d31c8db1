"""Plugins of other packages by entry points: datasets, heads, methods, their networks and export formats.

A package that registers ``[project.entry-points."calib_inspect.datasets"] mine = "my_package:MyDataset"`` in its
``pyproject.toml`` is found by the name ``mine`` as if it were ours. It is imported only when requested.
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
    """The entry points of installed packages by name; of two with the same name, the first on the path.

    Args:
        group: one of `GROUPS`.
    """
    found: dict[str, EntryPoint] = {}
    for distribution in distributions():
        with contextlib.suppress(Exception):  # a package with unreadable metadata must not hide others
            for entry in distribution.entry_points.select(group=f"{PREFIX}{group}"):
                found.setdefault(entry.name, entry)
    return found


def package_at_fault(error: BaseException) -> str:
    """The package whose plugin raised an error, directly or indirectly; empty if none did."""
    modules = {frame.f_globals.get("__name__", "").partition(".")[0] for frame, _ in walk_tb(error.__traceback__)}
    entries = (entry for group in GROUPS for entry in plugins(group).values())
    return next((_package(entry) for entry in entries if entry.module.partition(".")[0] in modules - OURS), "")


def _package(entry: EntryPoint) -> str:
    return entry.dist.name if entry.dist else entry.module


@dataclass(frozen=True)
class Registry:
    """Objects of one kind by name: our own, and those of `plugins`.

    Attributes:
        group: group of the entry points.
        kind: name of the kind, for messages.
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
        """Import the object of a name.

        Raises:
            ConfigError: there is none, or the package that registers it is broken.
        """
        if name in self.own:
            return EntryPoint(name, self.own[name], self.group).load()
        entry = plugins(self.group).get(name)
        if entry is None:
            raise ConfigError(f"{name!r} is not a {self.kind}; choose from {', '.join(self.names())}.")
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
