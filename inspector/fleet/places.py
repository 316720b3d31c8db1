"""Folders on this machine and in buckets (by fsspec), from which drives are read and to which results are written."""

from __future__ import annotations

import hashlib
import os
import stat
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from io import BufferedReader
from itertools import pairwise
from pathlib import Path
from typing import Any, cast

from calibnet.errors import ConfigError, DatasetError
from calibnet.runtime.reading import open_file
from calibnet.runtime.text import file_name, one_line
from calibnet.runtime.writing import write_whole
from inspector.fleet.drives import Drive


def is_url(path: str) -> bool:
    """Whether a path is for fsspec."""
    return "://" in path


@dataclass(frozen=True)
class Item:
    """A file of a drive: its path relative to the drive's, its size, and a mark that changes when it is written."""

    path: str
    size: int
    mark: str


def items_of(drive: Drive) -> list[Item]:
    """The files of a drive, by name, including those named by its options.

    Raises:
        DatasetError: the place cannot be listed.
    """
    try:
        items = _remote_items(drive) if is_url(drive.path) else _local_items(Path(drive.path), drive.files)
        items += [item for named in _guesses(drive) for item in _local_items(Path(named), ("",), named)]
    except (OSError, ValueError) as error:
        raise DatasetError(f"{drive.path} cannot be listed ({_reason(error)}); check the path.") from None
    return sorted(items, key=lambda item: item.path)


def seen(items: Sequence[Item]) -> str:
    """A digest of the files' names, sizes and times, which is quick and different after every change.

    Empty where these are unknown, for instance on a web server that only lists names.
    """
    if not all(item.mark for item in items):
        return ""
    digest = hashlib.sha256()
    for item in items:
        digest.update(f"{item.path}\0{item.size}\0{item.mark}\n".encode(errors="surrogatepass"))
    return digest.hexdigest()


def content(folder: Path, drive: Drive) -> str:
    """A digest of the content of a drive's files, wherever they are and whenever they were written.

    Args:
        folder: folder of its files on this machine.
        drive: the drive.

    Raises:
        DatasetError: a file cannot be read.
    """
    digest = hashlib.sha256()
    found = [(item.path, folder / item.path) for item in _local_items(folder, drive.files)]
    found += [(named, Path(named)) for named in _guesses(drive)]
    for name, path in sorted(found):
        digest.update(name.encode(errors="surrogatepass") + b"\0")
        if not path.is_file():  # opening a fifo without a writer would wait for ever
            continue
        try:
            with open_file(path, remember=False) as file:
                digest.update(hashlib.file_digest(cast(BufferedReader, file), "sha256").digest())
        except OSError as error:
            raise DatasetError(
                f"{path} cannot be read ({_reason(error)}); check its permissions, or restore it."
            ) from None
    return digest.hexdigest()


@contextmanager
def on_this_machine(drive: Drive) -> Iterator[Path]:
    """A drive's path on this machine: its own, or that of a temporary copy of its files.

    Raises:
        DatasetError: it cannot be copied.
    """
    if not is_url(drive.path):
        yield Path(drive.path)
        return
    with tempfile.TemporaryDirectory(prefix="calib-inspect-drive-") as temporary:
        system, root = _system(drive.path)
        copy = Path(temporary) / file_name(root.rpartition("/")[2])  # the last name appears in titles
        try:
            for item in _remote_items(drive):
                if ".." in Path(item.path).parts:
                    raise ValueError(f"a file is called {item.path}")
                target = copy / item.path
                target.parent.mkdir(parents=True, exist_ok=True)
                system.get_file(f"{root}/{item.path}".rstrip("/"), str(target))
        except Exception as error:  # every file system raises errors of its own
            raise DatasetError(
                f"{drive.path} cannot be copied to this machine ({_reason(error)}); check the path, or free some space."
            ) from None
        yield copy


@dataclass(frozen=True)
class Store:
    """The fleet's folder: a path on this machine, or a URL that fsspec supports."""

    root: str

    @property
    def local(self) -> Path | None:
        """The folder if it is on this machine, else None."""
        return None if is_url(self.root) else Path(self.root)

    def check(self) -> None:
        """Create the folder, and check that it can be written.

        Raises:
            ConfigError: it cannot be written.
        """
        try:
            if self.local is not None:
                self.local.mkdir(parents=True, exist_ok=True)
                with tempfile.TemporaryFile(dir=self.local):
                    return
            system, root = _system(self.root)
            system.makedirs(root, exist_ok=True)
        except Exception as error:
            raise ConfigError(f"{self.root} cannot be written ({_reason(error)}); choose another --output.") from None

    def read(self, name: str, largest: int) -> bytes | None:
        """The content of a file; None if it cannot be read."""
        with suppress(Exception):
            if self.local is not None:
                with open_file(self.local / name, largest, remember=False) as file:
                    return file.read(largest + 1)
            system, root = _system(self.root)
            return bytes(system.cat_file(f"{root}/{name}", 0, largest))
        return None

    def has(self, name: str) -> bool:
        """Whether a file exists."""
        if self.local is not None:
            return (self.local / name).is_file()
        system, root = _system(self.root)
        return bool(system.exists(f"{root}/{name}"))

    def write(self, name: str, data: bytes) -> None:
        """Write a file of the fleet's bookkeeping, whole or not at all."""
        if self.local is not None:
            write_whole(self.local / name, data)
            return
        system, root = _system(self.root)
        system.makedirs(f"{root}/{name}".rpartition("/")[0], exist_ok=True)
        system.pipe_file(f"{root}/{name}", data)

    @contextmanager
    def workplace(self, name: str) -> Iterator[Path]:
        """A folder to write results into: that of the store, or a temporary one whose files replace those in the store.

        Files are replaced after an error as well, so that a failed drive shows no earlier result.
        """
        if self.local is not None:
            folder = self.local / name
            folder.mkdir(parents=True, exist_ok=True)
            yield folder
            return
        with tempfile.TemporaryDirectory(prefix="calib-inspect-result-") as temporary:
            try:
                yield Path(temporary)
            except Exception:
                with suppress(Exception):  # the first error is the one to report
                    self._replace(name, Path(temporary))
                raise
            self._replace(name, Path(temporary))

    def _replace(self, name: str, folder: Path) -> None:
        """Replace the files in a folder of a remote store by those of a folder on this machine."""
        system, root = _system(self.root)
        there = f"{root}/{name}"
        earlier = set(system.find(there)) if system.exists(there) else set()
        files = [path for path in folder.rglob("*") if path.is_file() and not path.name.startswith(".")]  # no locks
        for path in sorted(files):
            target = f"{there}/{path.relative_to(folder).as_posix()}"
            system.makedirs(target.rpartition("/")[0], exist_ok=True)
            system.put_file(str(path), target)
            earlier.discard(target)
        for old in sorted(earlier):
            system.rm_file(old)


def _system(url: str) -> tuple[Any, str]:
    """The file system of a URL, and its path there.

    Raises:
        ConfigError: fsspec does not support it, or lacks a dependency.
    """
    import fsspec

    try:
        system, root = fsspec.core.url_to_fs(url)
    except (ValueError, ImportError) as error:
        raise ConfigError(
            f"{url} cannot be opened ({_reason(error)}); check the address, or install the package that it needs."
        ) from None
    return system, str(root).rstrip("/")


def _local_items(root: Path, patterns: Sequence[str], prefix: str = "") -> list[Item]:
    found: dict[str, Item] = {}
    for pattern in patterns:
        for start in sorted(root.glob(pattern)) if pattern else [root]:
            for path in _files(start):
                status = path.stat()
                relative = prefix if path == root else (Path(prefix) / path.relative_to(root)).as_posix()
                special = "" if stat.S_ISREG(status.st_mode) else f"{status.st_mode} "
                mark = f"{special}{status.st_mtime_ns} {status.st_ctime_ns}"
                found[relative] = Item(relative, status.st_size, mark)
    return list(found.values())


def _files(start: Path) -> Iterator[Path]:
    """All files below a folder, including those in linked folders, or the file itself."""
    if not start.is_dir():
        if os.path.lexists(start):
            yield start
        return
    been: set[tuple[int, int]] = set()
    for folder, below, names in os.walk(start, followlinks=True):
        status = Path(folder).stat()
        if (status.st_dev, status.st_ino) in been:  # a link to a parent
            below.clear()
            continue
        been.add((status.st_dev, status.st_ino))
        yield from (Path(folder) / name for name in names if (Path(folder) / name).exists())


def _remote_items(drive: Drive) -> list[Item]:
    system, root = _system(drive.path)
    found: dict[str, Item] = {}
    for pattern in drive.files:
        for start in sorted(system.glob(f"{root}/{pattern}")) if pattern else [root]:
            for name, info in system.find(start, detail=True).items():
                relative = name[len(root) :].lstrip("/")
                changed = (
                    info.get(key) for key in ("ETag", "etag", "md5", "mtime", "LastModified", "updated", "created")
                )
                mark = next((str(one) for one in changed if one is not None), "")
                found[relative] = Item(relative, int(info.get("size") or 0), mark)
    return list(found.values())


def _guesses(drive: Drive) -> list[str]:
    """Files of the initial guess, named by a drive's options."""
    options = (*drive.common, *drive.options)
    named = [value for option, value in pairwise(options) if option == "--guess"]
    return named + [word.removeprefix("--guess=") for word in options if word.startswith("--guess=")]


def _reason(error: BaseException) -> str:
    return one_line(getattr(error, "strerror", None) or str(error) or type(error).__name__, 200)
