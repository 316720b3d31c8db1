from __future__ import annotations

import errno
import os
import re
import signal
import subprocess
import sys
import tomllib
from importlib.metadata import version
from pathlib import Path
from unittest import mock

import click
import pytest
from rich.table import Table

from calibnet import __version__
from calibnet.errors import CalibnetError, DatasetError
from calibnet.evaluation.measure import Step
from calibnet.verdict import DRIVE_LIMITS
from inspector.cli import errors
from inspector.cli.evaluate import Bars
from inspector.cli.fleet_console import fleet_progress
from inspector.cli.main import COMMANDS, cli, settle_environment
from inspector.cli.output import make_console
from inspector.fleet.drives import Drive
from inspector.fleet.table import row_of

ROOT = Path(__file__).resolve().parents[3]


def failing(error: BaseException) -> click.Command:
    """A command that raises."""

    @click.command()
    def command() -> None:
        raise error

    return command


def start(code: str, **streams: int) -> subprocess.Popen[str]:
    """Run a command of its own in a fresh interpreter."""
    preamble = "import sys, click\nfrom inspector.cli.errors import run\n"
    return subprocess.Popen([sys.executable, "-c", preamble + code], cwd=ROOT, text=True, **streams)


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        RuntimeError("[enforce fail at alloc_cpu.cpp:127] err == 0. DefaultCPUAllocator: can't allocate memory: you"),
        RuntimeError("CUDA out of memory. Tried to allocate 2.00 GiB."),
    ],
)
def test_a_lack_of_memory_is_one_sentence(error: Exception, capsys: pytest.CaptureFixture[str]) -> None:
    assert errors.run(failing(error), []) == 3
    said = capsys.readouterr().err
    assert said == "calib-inspect: There is not enough memory for this; free some, or use fewer or smaller files.\n"


def test_help_lists_every_command_with_a_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    assert errors.run(cli, ["--help"]) == 0
    lines = capsys.readouterr().out.splitlines()
    listed = {line.split()[0]: line for line in lines if line.startswith("  ") and line.split()[0] in COMMANDS}
    assert listed.keys() == COMMANDS.keys()
    assert all(len(line.split()) > 3 for line in listed.values())


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_exists_and_explains_itself(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert errors.run(cli, [name, "--help"]) == 0
    assert f"Usage: calib-inspect {name}" in capsys.readouterr().out


def test_version_is_the_packages(capsys: pytest.CaptureFixture[str]) -> None:
    assert errors.run(cli, ["--version"]) == 0
    out = capsys.readouterr().out
    assert __version__ in out
    assert f"rerun-sdk {version('rerun-sdk')}, torch {version('torch')}" in out


def test_the_console_script_is_the_root_group() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["scripts"]["calib-inspect"] == "inspector.cli.main:main"


@pytest.mark.parametrize("arguments", [["no-such-command"], ["evaluate"], ["--no-such-option"]])
def test_wrong_usage_exits_2(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert errors.run(cli, arguments) == 2
    assert "Usage: calib-inspect" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "code", "sentence"),
    [
        (DatasetError("Folder x is missing."), 3, "Folder x is missing."),
        (CalibnetError("Anything."), 3, "Anything."),
        (OSError(errno.ENOSPC, "no", "out.rrd"), 3, "out.rrd: No space left on device; free some space"),
        (PermissionError(errno.EACCES, "no", "/x/y"), 3, "/x/y: Permission denied; check the permissions"),
        (FileNotFoundError(errno.ENOENT, "no", "a.json"), 3, "a.json: No such file or directory; check the path."),
        (
            OSError("libusb-1.0.so.0: cannot open shared object file: No such file"),
            3,
            "apt-get install -y libusb-1.0-0",
        ),
        (ImportError("libfoo.so.2: cannot open shared object file"), 3, "libfoo.so.2 is missing, install it with"),
        (ImportError("cv2.so: failed to map segment from shared object"), 3, "cannot be loaded (cv2.so: failed to map"),
        (KeyboardInterrupt(), 130, "Interrupted."),
        (click.Abort(), 130, "Interrupted."),
    ],
)
def test_errors_become_one_sentence(
    error: BaseException, code: int, sentence: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert errors.run(failing(error), []) == code
    printed = capfd.readouterr()
    assert printed.out == ""
    assert sentence in printed.err
    assert len(printed.err.strip().splitlines()) == 1
    assert "Traceback" not in printed.err


@pytest.mark.parametrize("error", [ValueError("a bug"), ImportError("No module named 'x'"), OSError("no number")])
def test_a_fault_of_ours_is_one_sentence_and_a_file_with_the_traceback(
    error: Exception, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert errors.run(failing(error), []) == 70
    (kept,) = tmp_path.iterdir()
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "Please report it" in said
    assert str(kept) in said
    assert f"{type(error).__name__}: {error}" in kept.read_text()
    assert "Traceback" in kept.read_text()


def test_a_failed_check_exits_1() -> None:
    assert errors.run(failing(click.exceptions.Exit(1)), []) == errors.ExitCode.CHECK_FAILED


def test_a_full_disk_behind_stdout_is_a_sentence() -> None:
    with Path("/dev/full").open("w") as full:
        process = start(
            "sys.exit(run(click.Command('c', callback=lambda: print('x'))))", stdout=full.fileno(), stderr=-1
        )
        stderr = process.communicate(timeout=60)[1]
    assert process.returncode == 3
    assert stderr == "calib-inspect: No space left on device; free some space or write elsewhere.\n"


def test_a_closed_pipe_ends_quietly() -> None:
    read, write = os.pipe()
    os.close(read)
    process = start("sys.exit(run(click.Command('c', callback=lambda: print('x'))))", stdout=write, stderr=-1)
    os.close(write)
    assert process.communicate(timeout=60)[1] == ""
    assert process.returncode == errors.ExitCode.BROKEN_PIPE


def test_ctrl_c_exits_130_without_traceback() -> None:
    # a shell starts what it runs in the background with this signal ignored, and children inherit that
    wait = "import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"
    wait += "def wait():\n    print('ready', flush=True)\n    import time\n    time.sleep(60)\n"
    process = start(wait + "sys.exit(run(click.Command('c', callback=wait)))", stdout=-1, stderr=-1)
    assert process.stdout is not None
    process.stdout.readline()
    process.send_signal(signal.SIGINT)
    stderr = process.communicate(timeout=60)[1]
    assert process.returncode == 130
    assert stderr.strip() == "calib-inspect: Interrupted."


@pytest.mark.parametrize(
    ("words", "completions"),
    [
        ("calib-inspect se", ["seq"]),
        ("calib-inspect seq --col", ["--color"]),
        ("calib-inspect seq --color e", ["edge", "error"]),
    ],
)
def test_shell_completion_knows_commands_options_and_values(
    words: str, completions: list[str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("_CALIB_INSPECT_COMPLETE", "bash_complete")
    monkeypatch.setenv("COMP_WORDS", words)
    monkeypatch.setenv("COMP_CWORD", str(len(words.split()) - 1))
    errors.run(cli, [])
    assert [line.partition(",")[2] for line in capsys.readouterr().out.splitlines()] == completions


@pytest.mark.parametrize(
    ("asked", "words", "place"),
    [
        ("bash_complete", "calib-inspect se", "abc"),
        ("bash_complete", "calib-inspect se", "-1"),
        ("zsh_complete", "calib-inspect se", "9" * 5000),
        ("bash_complete", "calib-inspect se", None),
        ("fish_complete", None, "se"),
        ("ksh_complete", "calib-inspect se", "1"),
        ("nonsense", None, None),
    ],
)
def test_what_no_shell_says_of_a_line_is_a_sentence(
    asked: str,
    words: str | None,
    place: str | None,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name, value in (("_CALIB_INSPECT_COMPLETE", asked), ("COMP_WORDS", words), ("COMP_CWORD", place)):
        if value is None:
            monkeypatch.delenv(name, raising=False)
        else:
            monkeypatch.setenv(name, value)
    assert errors.run(cli, []) == 3
    seen = capsys.readouterr()
    assert seen.out == ""
    assert re.fullmatch(r"calib-inspect: .*(not a valid completion request|COMP_CWORD are not valid); .*\n", seen.err)


@pytest.mark.parametrize("threads", ["abc", "-1", "0", "", "2;3", "9" * 50])
def test_a_number_of_threads_that_is_none_is_a_sentence(
    threads: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", threads)
    assert errors.run(cli, ["info"]) == 3
    assert capsys.readouterr().err == (
        f"calib-inspect: OMP_NUM_THREADS={threads[:40]!r} is not a number of threads; unset it or give 1 or more.\n"
    )


@pytest.mark.parametrize("threads", ["2", "4,2", "016"])
def test_numbers_of_threads(threads: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", threads)
    assert errors.run(cli, ["info", "--help"]) == 0


@pytest.mark.parametrize("columns", ["1", "0", "-5", "x"])
def test_a_table_has_its_numbers_on_any_terminal(
    columns: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    console = make_console(stderr=False)
    table = Table("module", "parameters")
    table.add_row("total", "2.651 M")
    console.print(table)
    assert "2.651 M" in capsys.readouterr().out


def test_a_name_with_brackets_or_colons_is_printed_as_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    console = make_console(stderr=False)
    console.print("3 parts in a[/b] and :smile:")
    table = Table("name")
    table.add_row("[red]x[/] a[/b]")
    console.print(table)
    shown = capsys.readouterr().out
    assert "3 parts in a[/b] and :smile:" in shown and "[red]x[/] a[/b]" in shown


def test_a_sentence_is_not_broken_by_us(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    sentence = f"The result is within {' / '.join(map(str, [DRIVE_LIMITS] * 9))}."
    make_console(stderr=False).print(sentence, style="yellow")
    assert capsys.readouterr().out == f"{sentence}\n"


def test_bars_are_named_by_foreign_text() -> None:
    with Bars() as bars:
        bars.show(Step("row", 1, 2, "a[/b]"))
    with fleet_progress(1) as progress:
        progress.advance(row_of(Drive("a[/b]", "c[/d]", "folder", "/x"), verdict="failed", reason="e[/f]"))


def test_a_log_has_a_line_for_every_drive_of_a_fleet(capsys: pytest.CaptureFixture[str]) -> None:
    drives = [Drive("car", name, "folder", "/x") for name in ("one", "two")]
    with fleet_progress(2) as progress:
        progress.advance(row_of(drives[0], verdict="cannot tell"))
        assert capsys.readouterr().err.strip() == "car/one: cannot tell", "at once, not at the end"
        progress.advance(row_of(drives[1], verdict="failed", reason="It is cut short."))
    assert "Failed: car/two: It is cut short." in capsys.readouterr().err


def test_variables_of_libraries_that_change_what_they_do_are_taken_out() -> None:
    given = {"OPENCV_IO_MAX_IMAGE_PIXELS": "abc", "RERUN_FLUSH_NUM_BYTES": "-1", "RERUN_CHUNK_MAX_ROWS": "1"}
    kept = {"RERUN_STRICT": "0", "RUST_LOG": "info", "HOME": "/"}
    with mock.patch.dict(os.environ, given | kept | {"RERUN": "maybe"}, clear=True):
        settle_environment()
        assert dict(os.environ) == kept | {"GOMP_SPINCOUNT": "20000", "PYDANTIC_DISABLE_PLUGINS": "__all__"}
    with mock.patch.dict(os.environ, {"RERUN": "Off"}, clear=True):
        settle_environment()
        assert os.environ["RERUN"] == "Off", "which is said, as nothing is recorded then"
