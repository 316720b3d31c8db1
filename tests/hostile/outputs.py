"""Outputs that are somebody else's: the input itself, a link, a device, a file of another kind."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path

from tests.hostile.inputs import CAR, RUN, Build, car, put
from tests.hostile.recordings import whole
from tests.hostile.rows import BAD, FINE, USAGE, Row

Put = Callable[[Path], None]


def _mine(path: Path) -> None:
    path.parent.mkdir(parents=True)
    path.write_text("mine")


def _link(path: Path) -> None:
    path.with_name("target").write_text("mine")
    path.symlink_to("target")


PLACES: dict[str, Put] = {
    "a link": _link,
    "a dangling link": lambda path: path.symlink_to("nowhere"),
    "a link to a device": lambda path: path.symlink_to("/dev/null"),
    "a fifo": lambda path: os.mkfifo(path),
    "my notes": lambda path: path.write_text("mine\n") and None,
    "a picture": lambda path: path.write_bytes(b"\x89PNG\r\n\x1a\nmine") and None,
}
"""What may be there, none of which may change."""


def check(*options: str) -> Build:
    """Check a recording with an output."""
    return lambda root: [*whole("check")(root)[:2], *options]


def export(*options: str) -> Build:
    """Export a recording to an output."""
    return lambda root: [*whole("export")(root), *options]


def run(*options: str) -> Build:
    """Calibrate a car to an output."""
    return lambda root: [*car(root), *options]


OUTPUTS: dict[str, Callable[[str], Build]] = {
    "check --json": lambda name: check("--json", name),
    "check --junit": lambda name: check("--junit", name),
    "export --output": lambda name: export("--output", name),
    "folder --save": lambda name: run("--save", name),
    "pictures --animate": lambda name: lambda root: ["pictures", whole("check")(root)[1], "--animate", f"{name}.webp"],
    "compare --save": lambda name: lambda root: [*whole("compare")(root)[:3], "--save", name, "--headless"],
    "info --json": lambda name: lambda root: ["info", "--json", name],
}


def there(build: Build, put_: Put, name: str) -> Build:
    """An output whose name is taken."""

    def made(root: Path) -> list[str]:
        command = build(root)
        put_(root / name)
        return command

    return made


def rows() -> Iterator[Row]:
    """Of outputs of every command."""
    for option, build in OUTPUTS.items():
        name = "out.webp" if "animate" in option else "out"
        for what, put_ in PLACES.items():
            for more in ((), ("--overwrite",)):
                if more and what in ("my notes", "a picture"):
                    continue
                command = there(build("out"), put_, name)

                def made(root: Path, command: Build = command, more: tuple[str, ...] = more) -> list[str]:
                    return [*command(root), *more]

                yield Row(f"{option}: {what} {' '.join(more)}".strip(), made, BAD, ("out",))
    inputs = {
        "check --json": check("--json", "run.rrd"),
        "check --junit": check("--junit", "run.rrd"),
        "export --output": export("--output", "run.rrd"),
        "compare --save": lambda root: [*whole("compare")(root)[:3], "--save", "other.rrd", "--headless"],
        "folder --save its calibration": run("--save", f"{CAR}/calibration.yaml"),
        "folder --save its picture": run("--save", f"{CAR}/images/0000.png"),
        "folder --save its scan": run("--save", f"{CAR}/clouds/0000.bin"),
    }
    for what, build in inputs.items():
        for more in ((), ("--overwrite",)):

            def made_(root: Path, build: Build = build, more: tuple[str, ...] = more) -> list[str]:
                return [*build(root), *more]

            yield Row(f"{what} over its input {' '.join(more)}".strip(), made_, BAD)
    yield Row("a device as --save", run("--save", "/dev/null"), BAD, ("/dev/null",))
    yield Row("a device as --junit", check("--junit", "/dev/full"), BAD, ("/dev/full",))
    yield Row("stdout's path as --json", check("--json", "/dev/stdout"), BAD, ("/dev/stdout",))
    yield Row("a file as the folder of --save", run("--save", f"{CAR}/calibration.yaml/run.rrd"), BAD, ("run.rrd",))
    for option, build in OUTPUTS.items():
        for what, name in (("a folder", "taken"), ("this folder", "."), ("a folder that is not there", "out/")):
            if "animate" not in option:
                command = there(build(name), Path.mkdir, "taken")
                yield Row(f"{option}: {what}", command, USAGE, ("names a folder",))
    yield Row("a name of 300 characters as --save", run("--save", "x" * 300), BAD)
    yield Row("no place below /proc as --save", run("--save", "/proc/nothing/run.rrd"), BAD, ("/proc/nothing",))
    yield Row(
        "a report where somebody's page is",
        there(whole("report"), _mine, "report/index.html"),
        BAD,
        ("index.html",),
        ("report/pictures", "report/metrics.json", "report/recording.rrd"),
    )
    yield Row(
        "a report where its folder of pictures is a file",
        there(whole("report"), _mine, "report/pictures"),
        BAD,
        ("pictures",),
    )
    yield Row(
        "a report beside a file called writable",
        there(
            whole("report"),
            _mine,
            "report/pictures/writable",
        ),
        FINE,
    )
    yield Row("a recording that replaces another", _again, FINE, ("in place of an earlier recording",), ("out.rrd",))


def _again(root: Path) -> list[str]:
    whole("check")(root)
    (root / "run.rrd").rename(root / "out.rrd")
    put(CAR, root)
    return ["folder", CAR, *RUN, "--save", "out.rrd"]
