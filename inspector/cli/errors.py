"""Turns every error into one sentence on stderr and an exit code."""

from __future__ import annotations

import contextlib
import errno
import io
import os
import re
import sys
import tempfile
import traceback
from enum import IntEnum

import click

from calibnet.errors import CalibnetError
from calibnet.runtime.plugins import package_at_fault
from calibnet.runtime.reading import protecting_inputs
from calibnet.runtime.text import one_line, quoted_lines
from calibnet.runtime.writing import keeping_others

TOO_LITTLE_MEMORY = "There is not enough memory for this; free some, or use fewer or smaller files."
TORCH_HAS_NO_MEMORY = re.compile(r"DefaultCPUAllocator: can't allocate|CUDA out of memory")
"""Pattern of PyTorch's errors for a lack of memory, which are no `MemoryError`."""
SYSTEM_PACKAGES = {
    "libusb-1.0.so.0": "libusb-1.0-0",
    "libGL.so.1": "libgl1",
    "libEGL.so.1": "libegl1",
    "libX11.so.6": "libx11-6",
    "libidn2.so.0": "libidn2-0",
    "libudev.so.1": "libudev1",
}
"""Debian packages of the shared libraries that wheels load from the system, as in `.ci/system-libraries`."""


class ExitCode(IntEnum):
    """Exit codes of the process."""

    OK = 0
    CHECK_FAILED = 1
    USAGE = 2
    BAD_INPUT = 3
    CANNOT_TELL = 4
    UNFORESEEN = 70
    INTERRUPTED = 130
    BROKEN_PIPE = 141


VERDICT_CODES = {
    "accepted": ExitCode.OK,
    "rejected": ExitCode.CHECK_FAILED,
    "cannot tell": ExitCode.CANNOT_TELL,
}
"""Exit codes of the commands that judge, by the word of the verdict."""


def run(command: click.Command, arguments: list[str] | None = None) -> int:
    """Run ``command``; every error a user can act on is one sentence on stderr.

    Args:
        command: the root group.
        arguments: what follows the program's name; by default this process's own arguments.

    Returns:
        The exit code.
    """
    try:
        with protecting_inputs(), keeping_others():
            result = command.main(args=arguments, prog_name="calib-inspect", standalone_mode=False)
        if sys.stdout is not None:
            sys.stdout.flush()  # a full disk or a closed pipe shows up here rather than at the interpreter's end
    except click.ClickException as error:
        shown = io.StringIO()
        error.show(shown)
        with contextlib.suppress(OSError, AttributeError):  # stderr may be closed
            click.echo(quoted_lines(shown.getvalue()), err=True, nl=False)
        return error.exit_code
    except (click.Abort, KeyboardInterrupt):
        return fail("Interrupted.", ExitCode.INTERRUPTED)
    except CalibnetError as error:
        return fail(str(error))
    except BrokenPipeError:
        discard_stdout()
        return ExitCode.BROKEN_PIPE
    except SystemExit as leaving:  # click and rich leave with 1 when the reader of a pipe is gone
        if package_at_fault(leaving):
            return unforeseen(leaving)
        discard_stdout()
        return ExitCode.BROKEN_PIPE if leaving.code == 1 else int(leaving.code or 0)
    except MemoryError:
        return fail(TOO_LITTLE_MEMORY)
    except (OSError, ImportError) as error:
        sentence = environment_sentence(error)
        discard_stdout()
        return fail(sentence) if sentence else unforeseen(error)
    except Exception as error:  # the last net: nobody sees a traceback
        return fail(TOO_LITTLE_MEMORY) if TORCH_HAS_NO_MEMORY.search(str(error)) else unforeseen(error)
    except BaseException as error:
        if type(error).__name__ != "PanicException":  # a panic of Rust code is not an Exception
            raise
        return unforeseen(error)
    return result if isinstance(result, int) else ExitCode.OK


def fail(sentence: str, code: ExitCode = ExitCode.BAD_INPUT) -> int:
    """Print one sentence on stderr; returns the exit code."""
    with contextlib.suppress(OSError, AttributeError):  # stderr may be closed
        click.echo(f"calib-inspect: {one_line(sentence)}", err=True)
    return code


def unforeseen(error: BaseException) -> int:
    """Report an internal error, and keep what its makers need to know in a file."""
    from platform import platform

    from calibnet import __version__

    what = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    told = [f"calib-inspect {__version__}, Python {sys.version}, {platform()}", f"Arguments: {sys.argv[1:]}"]
    text = "\n".join([*told, "", *traceback.format_exception(error)])
    where = "; its traceback could not be kept"
    with contextlib.suppress(OSError):
        descriptor, name = tempfile.mkstemp(prefix="calib-inspect-error-", suffix=".txt")
        with os.fdopen(descriptor, "w", encoding="utf-8", errors="backslashreplace") as file:
            file.write(text)
        where = f" together with {name}"
    package = package_at_fault(error)
    whose, whom = (f"the package {package}", " to its makers") if package else ("calib-inspect", "")
    sentence = f"Internal error in {whose} ({one_line(what, 300)}). Please report it{whom}{where}."
    return fail(sentence, ExitCode.UNFORESEEN)


def environment_sentence(error: OSError | ImportError) -> str | None:
    """What is wrong with the machine and what to do; None where ``error`` is of another kind."""
    library = re.search(r"(lib\S+\.so[.\d]*): cannot open shared object file", str(error))
    if library:
        name = library[1]
        package = SYSTEM_PACKAGES.get(name)
        how = f"; on Debian: apt-get install -y {package}" if package else " with your system's package manager"
        return f"The system library {name} is missing, install it{how}."
    if isinstance(error, ImportError) and "shared object" in str(error):
        return (
            f"A library cannot be loaded ({error}): there is too little memory for it, or it has to be installed again."
        )
    if not isinstance(error, OSError) or error.errno is None:
        return None
    where = f"{os.fsdecode(error.filename)}: " if isinstance(error.filename, str | bytes) else ""
    what = os.strerror(error.errno)
    remedy = {
        errno.ENOSPC: "free some space or write elsewhere",
        errno.EDQUOT: "free some space or write elsewhere",
        errno.EFBIG: "let files be larger (ulimit -f) or write elsewhere",
        errno.EACCES: "check the permissions or use another path",
        errno.EPERM: "check the permissions or use another path",
        errno.EROFS: "choose a path that can be written",
        errno.ENOENT: "check the path",
        errno.EADDRINUSE: "stop the other program",
    }.get(error.errno)
    return f"{where}{what}{f'; {remedy}' if remedy else ''}."


def discard_stdout() -> None:
    """Point stdout at nothing, so that the interpreter's last flush cannot fail a second time."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
