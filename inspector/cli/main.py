"""``calib-inspect``: the root group, which imports a command's module only when that command runs."""

from __future__ import annotations

import contextlib
import importlib
import os
import re
import sys
import warnings
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any, NoReturn

import click

from calibnet import __version__
from calibnet.errors import ConfigError
from inspector.cli.errors import run
from inspector.programs import SWITCHED_OFF


@dataclass(frozen=True)
class LazyCommand:
    """Where a command is defined, ``module:name`` or ``module:group.name``, and its line in the list of commands."""

    target: str
    help: str

    def load(self) -> click.Command:
        """Import the command's module and return the command."""
        module, _, names = self.target.partition(":")
        name, _, below = names.partition(".")
        command = getattr(importlib.import_module(module), name)
        command = command.commands[below] if below else command
        if not isinstance(command, click.Command):
            raise TypeError(f"{self.target} is not a click command")
        return command


SECTIONS = {
    "Calibrate": {
        "folder": LazyCommand("inspector.cli.inspect:runs.folder", "Calibrate a folder of your own images and scans."),
        "bag": LazyCommand("inspector.cli.inspect:runs.bag", "Calibrate a ROS 1 or ROS 2 bag, or an MCAP file."),
        "rig": LazyCommand("inspector.cli.rig:rig", "Calibrate several cameras with one LiDAR."),
        "live": LazyCommand("inspector.cli.live:live", "Move the extrinsic by hand, and see the cascade's answer."),
        "demo": LazyCommand("inspector.cli.inspect:runs.demo", "Calibrate a synthetic drive, without any data."),
        "seq": LazyCommand("inspector.cli.inspect:runs.seq", "Calibrate a KITTI odometry sequence."),
        "raw": LazyCommand("inspector.cli.inspect:runs.raw", "Calibrate a KITTI raw drive."),
        "object": LazyCommand("inspector.cli.inspect:runs.object", "Calibrate the KITTI object detection frames."),
        "tracking": LazyCommand("inspector.cli.inspect:runs.tracking", "Calibrate a KITTI tracking sequence."),
        "kitti360": LazyCommand("inspector.cli.inspect:runs.kitti360", "Calibrate a KITTI-360 drive."),
        "nuscenes": LazyCommand("inspector.cli.inspect:runs.nuscenes", "Calibrate a nuScenes scene."),
    },
    "Judge a calibration": {
        "verify": LazyCommand("inspector.cli.verify:verify", "Tell whether the calibration that you have is good."),
        "watch": LazyCommand("inspector.cli.watch:watch", "Tell whether the mount moved during a drive."),
        "check": LazyCommand("inspector.cli.check:check", "Check a recording's verdict and limits, for CI."),
    },
    "Use a recording": {
        "report": LazyCommand("inspector.cli.report:report", "Make a page with pictures, curves and figures."),
        "compare": LazyCommand("inspector.cli.compare:compare", "Show several recordings side by side."),
        "export": LazyCommand("inspector.cli.export:export", "Write the extrinsic for ROS, KITTI, OpenCV and others."),
        "pictures": LazyCommand("inspector.cli.pictures:pictures", "Take pictures of every tab."),
    },
    "Many drives": {
        "fleet": LazyCommand("inspector.cli.fleet:fleet", "Verify many drives, on this machine or a cluster."),
        "fleet-report": LazyCommand("inspector.cli.fleet_views:report", "Make a page of a fleet, worst drives first."),
        "fleet-view": LazyCommand("inspector.cli.fleet_views:view", "Show a fleet's recordings in a Rerun catalogue."),
        "fleet-simulate": LazyCommand("inspector.cli.fleet_views:simulate", "Make a fleet of synthetic drives to try."),
    },
    "Train and measure": {
        "train": LazyCommand("inspector.cli.train:train", "Train one stage of the cascade, or all."),
        "pack-training": LazyCommand("inspector.cli.pack_training:pack_training", "Pack frames to train elsewhere."),
        "fit-verdict": LazyCommand("inspector.cli.fit_verdict:fit_verdict", "Fit the verdict to weights of your own."),
        "evaluate": LazyCommand("inspector.cli.evaluate:evaluate", "Measure errors and success rates of every stage."),
        "bench": LazyCommand("inspector.cli.bench:bench", "Measure all methods on the same frames."),
        "ablate": LazyCommand("inspector.cli.ablate:ablate", "Measure what each module of the network is worth."),
        "benchmark": LazyCommand("inspector.cli.benchmark:benchmark", "Measure milliseconds by part, stage and frame."),
        "info": LazyCommand("inspector.cli.info:info", "Count parameters and multiply-adds by module."),
    },
}
"""Every command, under the headings and in the order in which ``--help`` lists them."""
COMMANDS = {name: command for section in SECTIONS.values() for name, command in section.items()}


class LazyGroup(click.Group):
    """A group whose help imports no command's module."""

    def main(self, *arguments: Any, **more: Any) -> Any:
        """Run the group, or complete a line for a shell, whose request click would take on trust."""
        check_completion()
        return super().main(*arguments, **more)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names in the order of `COMMANDS`."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import and return one command; None for a name that does not exist."""
        lazy = COMMANDS.get(cmd_name)
        return lazy.load() if lazy else None

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the lists of commands from the texts in `SECTIONS`."""
        widest = max(map(len, COMMANDS))
        for title, commands in SECTIONS.items():
            with formatter.section(title):
                formatter.write_dl([(name.ljust(widest), lazy.help) for name, lazy in commands.items()])


def _print_versions(ctx: click.Context, _: click.Parameter, asked: bool) -> None:
    """Print the package's version and those of what results depend on, without importing any of it."""
    if asked:
        others = ", ".join(f"{name} {version(name)}" for name in ("rerun-sdk", "torch"))
        click.echo(f"calib-inspect {__version__} ({others})")
        ctx.exit()


def check_completion() -> None:
    """Check a shell's request for completion, which stands in the environment.

    Raises:
        ConfigError: it is not a request that a shell makes.
    """
    asked = os.environ.get(COMPLETES)
    if not asked:
        return
    if not re.fullmatch("(bash|zsh|fish)_(source|complete)", asked):
        raise ConfigError(f"{COMPLETES}={asked[:40]!r} is not a valid completion request; unset it, or see --help.")
    if asked.endswith("_complete"):
        word = ".*" if asked.startswith("fish") else r"\d{1,4}"  # fish gives the word itself, the others its place
        if "COMP_WORDS" not in os.environ or not re.fullmatch(word, os.environ.get("COMP_CWORD", "\n")):
            raise ConfigError("COMP_WORDS and COMP_CWORD are not valid; unset them, and press Tab in a shell.")


COMPLETES = "_CALIB_INSPECT_COMPLETE"
"""Variable in which a shell requests the completion of a line."""
COMPLETION = (
    "\b\n"  # click keeps the lines of such a paragraph as they are
    "Completion in bash (zsh_source and fish_source for the others):\n"
    f'  eval "$({COMPLETES}=bash_source calib-inspect)"'
)


@click.group(
    "calib-inspect", cls=LazyGroup, epilog=COMPLETION, context_settings={"help_option_names": ["-h", "--help"]}
)
@click.option(
    "--version",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_print_versions,
    help="Print the versions of calib-inspect, rerun and torch.",
)
def cli() -> None:
    """Calibrate a camera to a LiDAR with a cascade of networks, and look at every stage of it.

    Start with `calib-inspect demo`, which needs no data. Exit codes: 0 done, 1 rejected or a limit exceeded, 2 wrong
    usage, 3 bad input or environment, 4 cannot tell, 70 internal error, 130 interrupted.
    """
    threads = os.environ.get("OMP_NUM_THREADS", "1")
    if not re.fullmatch(r"\s*0*[1-9]\d{0,3}\s*(,\s*\d+\s*)*", threads):
        raise ConfigError(f"OMP_NUM_THREADS={threads[:40]!r} is not a number of threads; unset it or give 1 or more.")


RERUN_LOG = "warn,re_log_encoding::rrd::file_sink=error"
"""Log levels of Rerun, without its warning that a recording still being written has no footer."""

SPINS = "20000"
"""How often a thread of libgomp looks for work before it sleeps. The default, 300,000, makes a frame take several times
as long where other programs use the cores, and saves nothing where none does."""

NOT_FOR_US = ("OPENCV_IO_MAX_IMAGE_", "RERUN_FLUSH_", "RERUN_CHUNK_")
"""Prefixes of variables that change what libraries do, or end the process if not a number; the limits of image sizes
and chunks are ours to set."""


def settle_environment() -> None:
    """Remove from the environment what would change results or make libraries print, before they are imported."""
    for name in [name for name in os.environ if name.startswith(NOT_FOR_US)]:
        del os.environ[name]
    if os.environ.get("RERUN", "").lower() not in SWITCHED_OFF:
        os.environ.pop("RERUN", None)
    os.environ["PYDANTIC_DISABLE_PLUGINS"] = "__all__"  # or it would load what every installed package registers
    os.environ.setdefault("RUST_LOG", RERUN_LOG)
    os.environ.setdefault("GOMP_SPINCOUNT", SPINS)


def main() -> None:
    """Entry point of the console script."""
    if not sys.warnoptions:
        warnings.simplefilter("ignore")  # warnings are for developers; users get sentences of ours
    settle_environment()
    leave(run(cli))


def leave(code: int) -> NoReturn:
    """End the process, at once where Rerun would wait for a writer that has given up."""
    flushing = sys.modules.get("inspector.record.flushing")  # which was not imported where nothing was recorded
    if flushing is not None and flushing.LOST:
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(OSError, ValueError, AttributeError):
                stream.flush()
        os._exit(code)
    sys.exit(code)
