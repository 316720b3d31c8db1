"""Opens a page in the user's browser without showing its token to other users of this machine."""

from __future__ import annotations

import tempfile
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager
from html import escape
from pathlib import Path


@contextmanager
def opened_page(address: str) -> Iterator[Path]:
    """Open an address in the browser, by a file that is removed at the end.

    The browser is given a file that redirects to the address and that only its owner may read, since every user can
    read a browser's command line.
    """
    with tempfile.TemporaryDirectory(prefix="calib-inspect-") as folder:  # 0700
        file = Path(folder) / "open.html"
        to = escape(address, quote=True)
        file.write_text(f'<!doctype html><meta http-equiv="refresh" content="0; url={to}"><a href="{to}">{to}</a>\n')
        file.chmod(0o600)
        webbrowser.open(file.as_uri())
        yield file
