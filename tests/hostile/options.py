"""Options with values that cannot be meant."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from tests.hostile.inputs import car
from tests.hostile.recordings import whole
from tests.hostile.rows import BAD, USAGE, Row

RUNS: list[tuple[int, list[str]]] = [
    (BAD, ["--connect", "rerun+http://127.0.0.1:99999/proxy"]),
    (BAD, ["--connect", "http://127.0.0.1:9/proxy"]),
    (BAD, ["--connect", "rerun+http://[::1"]),
    (BAD, ["--connect", "rerun+http://127.0.0.1:1/proxy"]),
    (BAD, ["--connect", ""]),
    (BAD, ["--connect", "rerun+http://127.0.0.1:nine/proxy"]),
    (USAGE, ["--seed", str(2**70)]),
    (USAGE, ["--seed", "-1"]),
    (USAGE, ["--seed", "1.5"]),
    (USAGE, ["--range", "nan/nan"]),
    (USAGE, ["--range", "inf/1"]),
    (USAGE, ["--range", "1e9/1"]),
    (USAGE, ["--range", "-5/0.5"]),
    (USAGE, ["--range", "5"]),
    (USAGE, ["--range", ""]),
    (USAGE, ["--miscalibrate", "nan,0,0,0,0,0"]),
    (USAGE, ["--miscalibrate", "1e400,0,0,0,0,0"]),
    (USAGE, ["--miscalibrate", "1,2,3"]),
    (USAGE, ["--miscalibrate", "a,b,c,d,e,f"]),
    (USAGE, ["--stages", "0"]),
    (USAGE, ["--stages", "9" * 30]),
    (USAGE, ["--stages", "5-3"]),
    (USAGE, ["--stages", "1,,2"]),
    (USAGE, ["--frames", "a"]),
    (USAGE, ["--frames", "::0"]),
    (BAD, ["--frames", "7"]),
    (BAD, ["--frames", "9" * 100]),
    (BAD, ["--preset", "nonsense"]),
    (BAD, ["--preset", "../../etc/passwd"]),
    (BAD, ["--weights", "nowhere", "--stages", "5"]),
    (USAGE, ["--detail", "custom"]),
    (USAGE, ["--log", "nonsense"]),
    (USAGE, ["--color", "nonsense"]),
    (USAGE, ["--nonsense"]),
    (USAGE, ["--nonsense\x1b[2J"]),
    (USAGE, ["--on-bad-frame", "nonsense"]),
]
OTHERS: list[tuple[int, list[str]]] = [
    (USAGE, ["check", "run.rrd", "--max-rotation", "nan"]),
    (USAGE, ["check", "run.rrd", "--max-rotation", "inf"]),
    (USAGE, ["check", "run.rrd", "--max-rotation", "-1"]),
    (USAGE, ["check", "run.rrd", "--max-translation", "nan"]),
    (USAGE, ["check", "run.rrd", "--max-translation", "text"]),
    (USAGE, ["check", "run.rrd", "--statistic", "mean"]),
    (USAGE, ["check"]),
    (USAGE, ["export", "run.rrd", "--format", "nonsense"]),
    (BAD, ["export", "run.rrd", "--format", "json", "--frame", "99"]),
    (USAGE, ["export", "run.rrd", "--format", "json", "--frame", "-1"]),
    (USAGE, ["export", "run.rrd", "--format", "ros", "--camera-frame", "a b"]),
    (USAGE, ["export", "run.rrd", "--format", "ros", "--lidar-frame", "a\nmine: 1"]),
    (BAD, ["export", "run.rrd", "--format", "json", "--drive"]),
    (USAGE, ["export", "--format", "json"]),
    (USAGE, ["compare", "run.rrd"]),
    (BAD, ["compare", "run.rrd", "other.rrd", "--names", ",", "--headless"]),
    (USAGE, ["compare", "run.rrd", "other.rrd", "--names", "a", "--headless"]),
    (BAD, ["compare", "run.rrd", "other.rrd", "--names", "a,a", "--headless"]),
    (USAGE, ["pictures", "run.rrd"]),
    (USAGE, ["pictures", "run.rrd", "--output", "x", "--size", "1x1"]),
    (USAGE, ["pictures", "run.rrd", "--output", "x", "--size", "99999x99999"]),
    (USAGE, ["pictures", "run.rrd", "--animate", "x.webp", "--frame", "99"]),
    (BAD, ["pictures", "run.rrd", "--animate", "x.mp4"]),
    (USAGE, ["benchmark", "--threads", "100000"]),
    (USAGE, ["benchmark", "--threads", "0"]),
    (USAGE, ["bench", "--threads", "100000"]),
    (USAGE, ["ablate", "--threads", "100000"]),
    (USAGE, ["benchmark", "--repeats", "0"]),
    (BAD, ["benchmark", "--preset", "nonsense"]),
    (BAD, ["info", "--preset", "nonsense"]),
    (USAGE, ["train", "--range", "5/0.5", "--minutes", "1", "--learning-rate", "nan"]),
    (USAGE, ["train", "--range", "5/0.5", "--minutes", "1", "--learning-rate", "inf"]),
    (USAGE, ["train", "--range", "5/0.5", "--minutes", "nan"]),
    (USAGE, ["train", "--range", "5/0.5", "--minutes", "inf"]),
    (USAGE, ["train", "--range", "5/0.5", "--minutes", "0"]),
    (USAGE, ["train", "--range", "5/0.5"]),
    (USAGE, ["train", "--minutes", "1"]),
    (USAGE, ["train", "--range", "5/0.5", "--samples", "8", "--synthetic", "nan"]),
    (USAGE, ["train", "--range", "5/0.5", "--samples", "8", "--batch", "0"]),
    (USAGE, ["train", "--range", "5/0.5", "--samples", "8", "--seed", str(2**70)]),
    (BAD, ["train", "--range", "5/0.5", "--samples", "8", "--data", "nonsense"]),
    (BAD, ["train", "--range", "5/0.5", "--samples", "8", "--data", "folder:nowhere", "--synthetic", "0"]),
    (USAGE, ["evaluate", "--dataset", "nonsense", "--root", "."]),
    (BAD, ["evaluate", "--dataset", "folder", "--root", "nowhere"]),
    (USAGE, ["evaluate", "--dataset", "kitti-raw", "--root", ".", "--sequences", "nonsense"]),
    (BAD, ["seq", "04"]),
    (BAD, ["seq", "99", "--root", "nowhere"]),
    (BAD, ["seq", "../..", "--root", "."]),
    (BAD, ["raw", "2011_01_02", "0007", "--root", "."]),
    (BAD, ["object", "--split", "../val", "--root", "."]),
    (USAGE, ["demo", "--length", "0"]),
    (USAGE, ["demo", "--length", "many"]),
    (USAGE, ["nonsense"]),
    (USAGE, ["verify"]),
]


def rows() -> Iterator[Row]:
    """Of options of every command."""
    for code, options in RUNS:

        def run(root: Path, options: list[str] = options) -> list[str]:
            return [
                *[word for word in car(root) if options[0] != "--frames" or word not in ("--frames", "0")],
                *options,
            ]

        yield Row(f"folder {' '.join(options)[:70]}", run, code)
    for code, command in OTHERS:

        def other(root: Path, command: list[str] = command) -> list[str]:
            if any(word.endswith(".rrd") for word in command):
                whole("check")(root)
            return command

        yield Row(" ".join(command)[:90], other, code)
