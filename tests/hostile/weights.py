"""Weights, manifests and checkpoints that ask for what is not there."""

from __future__ import annotations

import functools
import json
import shutil
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import calibnet.weights
from tests.hostile.inputs import CAR, RUN, Build, put
from tests.hostile.rows import Row, instead_of

PACKAGE = Path(calibnet.weights.__file__).parent
STAGE = "compact-1deg-0.1m.safetensors"
PLACE, MANIFEST = f"weights/{STAGE}", "weights/compact.toml"
KEY = "calib-inspect"


def calibrated(root: Path) -> list[str]:
    """A car calibrated by stage 5 of weights of its own."""
    put(CAR, root)
    (root / "weights").mkdir()
    for name in (STAGE, "compact.toml"):
        shutil.copyfile(PACKAGE / name, root / "weights" / name)
    return ["folder", CAR, *RUN, "--weights", "weights", "--stages", "5"]


@functools.cache
def _parts() -> tuple[dict[str, Any], bytes]:
    """Header and tensors of the file."""
    data = (PACKAGE / STAGE).read_bytes()
    (length,) = struct.unpack("<Q", data[:8])
    return json.loads(data[8 : 8 + length]), data[8 + length :]


def file(change: Callable[[dict[str, Any]], Any], raw: Callable[[bytes], bytes] = lambda data: data) -> bytes:
    """The file with its header changed."""
    header, tensors = _parts()
    header = json.loads(json.dumps(header))
    change(header)
    text = json.dumps(header).encode()
    return raw(struct.pack("<Q", len(text)) + text + tensors)


def entry(change: Callable[[dict[str, Any]], Any]) -> bytes:
    """The file with what calib-inspect says of itself changed."""

    def made(header: dict[str, Any]) -> None:
        said = json.loads(header["__metadata__"][KEY])
        change(said)
        header["__metadata__"][KEY] = json.dumps(said)

    return file(made)


def config(key: str, value: Any) -> bytes:
    """The file with one value of its network's config changed."""
    return entry(lambda said: said["config"].__setitem__(key, value))


CONFIG: dict[str, list[Any]] = {
    "hourglasses": [10**6, -1, None, "many", 1.5, [1], float("nan")],
    "hourglass_blocks": [10**6, [1, None], []],
    "widths": [[10**6] * 5, [24] * 10_000, None, [], [24, "x"], [0, 0, 0, 0, 0]],
    "blocks": [[10**6] * 5, [1], None],
    "radius": [10**6, 0, -4, None],
    "input_height": [10**9, 0, None],
    "groups": [0, 10**9, None],
    "feature_channels": [10**9, 0, 65],
    "volume_channels": [10**9, [8]],
    "context_channels": [10**9, -1],
    "scales": [[], [8], [10**6], None],
    "head": [None, "nonsense", 7],
    "normalization": ["layer", None],
    "aggregation": ["yes", None, 2],
    "more": [1],
}
HEADERS: dict[str, Callable[[], bytes]] = {
    "no entry of ours": lambda: file(lambda header: header["__metadata__"].pop(KEY)),
    "no metadata": lambda: file(lambda header: header.pop("__metadata__")),
    "an entry that is no JSON": lambda: file(lambda header: header["__metadata__"].update({KEY: "{"})),
    "an entry that is a list": lambda: file(lambda header: header["__metadata__"].update({KEY: "[]"})),
    "an entry nested": lambda: file(lambda header: header["__metadata__"].update({KEY: "[" * 100_000})),
    "no config": lambda: entry(lambda said: said.pop("config")),
    "a config that is a list": lambda: entry(lambda said: said.update(config=[1])),
    "a config of null": lambda: entry(lambda said: said.update(config=None)),
    "a record of null": lambda: entry(lambda said: said.update(record=None)),
    "a range of null": lambda: entry(lambda said: said.update(range=None)),
    "a range of NaN": lambda: entry(lambda said: said.update(range="nan/nan")),
    "a range of text": lambda: entry(lambda said: said.update(range="wide")),
    "a tensor less": lambda: file(lambda header: header.pop(next(name for name in header if name[0] != "_"))),
    "cut": lambda: (PACKAGE / STAGE).read_bytes()[:50_000],
    "cut in its header": lambda: (PACKAGE / STAGE).read_bytes()[:500],
    "a header of 2^60 bytes": lambda: struct.pack("<Q", 2**60) + (PACKAGE / STAGE).read_bytes()[8:],
    "a header that is no JSON": lambda: struct.pack("<Q", 100) + b"x" * 200,
    "a pickle": lambda: b"\x80\x04\x95" + b"x" * 500,
}
MANIFESTS = {
    "no TOML": "preset = ",
    "binary": "\0\1\2",
    "latin-1": "preset = 'gr\udce9'",
    "of another preset": 'preset = "paper"',
    "without a preset": "match_error_limit_px = 3",
    "a key more": 'preset = "compact"\nlimit = 3',
    "a limit of NaN": 'preset = "compact"\nmatch_error_limit_px = nan',
    "a limit of text": 'preset = "compact"\nmatch_error_limit_px = "3"',
    "stages that are a number": 'preset = "compact"\nstages = 3',
    "a stage without a file": 'preset = "compact"\n[[stages]]\nrange = "1/0.1"',
    "a stage of no range": f'preset = "compact"\n[[stages]]\nfile = "{STAGE}"',
    "a range of text": f'preset = "compact"\n[[stages]]\nfile = "{STAGE}"\nrange = "wide"',
    "no looks": f'preset = "compact"\n[[stages]]\nfile = "{STAGE}"\nrange = "1/0.1"\nlooks = 0',
    "a billion looks": f'preset = "compact"\n[[stages]]\nfile = "{STAGE}"\nrange = "1/0.1"\nlooks = 1000000000',
    "looks of text": f'preset = "compact"\n[[stages]]\nfile = "{STAGE}"\nrange = "1/0.1"\nlooks = "2"',
    "a gain of NaN": f'preset = "compact"\n[[stages]]\nfile = "{STAGE}"\nrange = "1/0.1"\ngain = nan',
    "a picture a thousand times as large": f'preset = "compact"\n[[stages]]\nfile = "{STAGE}"\nrange = "1/0.1"\n'
    "image_size = 1000.0",
    "a file elsewhere": 'preset = "compact"\n[[stages]]\nfile = "../../../etc/passwd"\nrange = "1/0.1"',
    "nested": "preset = " + "[" * 10_000,
}


def changed(place: str, content: Callable[[], bytes]) -> Build:
    """Weights of which one file is another."""

    def made(root: Path) -> list[str]:
        command = calibrated(root)
        (root / place).write_bytes(content())
        return command

    return made


def without(root: Path) -> list[str]:
    """A folder of weights without the stage's."""
    command = calibrated(root)
    (root / PLACE).unlink()
    return command


def rows() -> Iterator[Row]:
    """Of weights and manifests."""
    yield from instead_of("weights", calibrated, PLACE, "missing")
    yield from instead_of("manifest", calibrated, MANIFEST, "missing")
    yield Row("weights: missing", without, words=("Stage 5", "no weights"))
    for what, content in HEADERS.items():
        yield Row(f"weights: {what}", changed(PLACE, content), words=(STAGE,))
    for key, values in CONFIG.items():
        for value in values:
            shown = str(value)[:40]
            yield Row(
                f"weights: {key} {shown}",
                changed(PLACE, lambda key=key, value=value: config(key, value)),
                words=(STAGE,),
            )
    for what, text in MANIFESTS.items():
        content = text.encode("utf-8", "surrogateescape")
        yield Row(f"manifest: {what}", changed(MANIFEST, lambda content=content: content), words=("compact.toml",))
