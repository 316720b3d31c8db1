"""Names that would be content, if they were not quoted."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from tests.hostile.inputs import CAR, RUN, Build, put
from tests.hostile.recordings import whole
from tests.hostile.rows import BAD, FINE, Row

NAMES = {
    "a row of KITTI": "a\nTr: 1 0 0 0 0 1 0 0 0 0 1 0",
    "a key of YAML": "a\nmine: 1",
    "escapes of a terminal": "a\x1b[2J\x1b]0;title\x07",
    "a carriage return": "a\rb",
    "no UTF-8": os.fsdecode(b"caf\xe9"),
    "from right to left": "a\u202egnp",
    "lines of Unicode": "a\u2028b\u2029c\x85d",
    "markup": "[red]a[/red] <b>&amp;",
}


def exported(name: str, form: str) -> Build:
    """Export the calibration of a folder of that name."""

    def made(root: Path) -> list[str]:
        put(CAR, root, name)
        return ["export", "--folder", name, "--format", form]

    return made


def calibrated(name: str) -> Build:
    """Calibrate a folder of that name."""

    def made(root: Path) -> list[str]:
        put(CAR, root, name)
        return ["folder", name, *RUN, "--save", "run.rrd"]

    return made


def checked(name: str, *options: str) -> Build:
    """Check a recording of that name."""

    def made(root: Path) -> list[str]:
        command = whole("check")(root)
        (root / "run.rrd").rename(root / f"{name}.rrd")
        return [command[0], f"{name}.rrd", *options]

    return made


def rows() -> Iterator[Row]:
    """Of names."""
    for what, name in NAMES.items():
        if "/" in name:
            name = name.replace("/", "|")
        for form in ("kitti", "ros", "opencv", "json"):
            yield Row(f"a folder called {what}: export {form}", exported(name, form), FINE)
        yield Row(f"a folder called {what}: folder", calibrated(name), FINE, ("Saved run.rrd",))
        yield Row(f"a folder called {what} that is not there", lambda root, name=name: ["folder", name, *RUN], BAD)
        yield Row(f"a recording called {what}: JUnit", checked(name, "--junit", "out.xml"), FINE)
        yield Row(
            f"a recording called {what}: report",
            lambda root, name=name: ["report", checked(name)(root)[1], "--output", "report"],
            FINE,
        )
