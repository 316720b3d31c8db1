"""The optional dependencies of fleets, the extra ``[fleet]``, imported only where used."""

from __future__ import annotations

from importlib.util import find_spec

from calibnet.errors import ConfigError


def require_extra(*modules: str) -> None:
    """Check that modules of the extra are installed.

    Raises:
        ConfigError: one is not; the sentence says how to install them.
    """
    missing = [module for module in modules if find_spec(module) is None]
    if missing:
        raise ConfigError(
            f"This needs {' and '.join(missing)}, which a plain installation leaves out; "
            "install with: pip install -c constraints.txt -e '.[fleet]'"
        )
