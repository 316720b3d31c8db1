"""Reads the JSON of `bench` and `ablate`, and checks it against the types of their tables."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from annotated_types import Interval, Len, Predicate

from calibnet.errors import ConfigError
from calibnet.evaluation.published import PUBLISHED_ABLATION, Published
from calibnet.runtime.reading import parse_json, read_text
from calibnet.runtime.schema import validated

Count = Annotated[int, Interval(ge=0, le=10**15)]
Number = Annotated[float, Interval(ge=0, le=1e12)]


@dataclass(frozen=True)
class _Spread:
    mean: Number
    median: Number
    p95: Number


@dataclass(frozen=True)
class _Rotation(_Spread):
    roll: Number
    pitch: Number
    yaw: Number


@dataclass(frozen=True)
class _Translation(_Spread):
    x: Number
    y: Number
    z: Number


@dataclass(frozen=True, kw_only=True)
class _Figures:
    """Figures of a row, or the reason why there are none."""

    runs: Count = 0
    of_runs: Count = 0
    refused: Count = 0
    rotation_deg: _Rotation | None = None
    translation_cm: _Translation | None = None
    success_2deg_5cm: Number | None = None
    why: str = ""
    rig: str = ""
    in_rig: bool | None = None


@dataclass(frozen=True, kw_only=True)
class _Row(_Figures):
    range: str
    of: str = ""


@dataclass(frozen=True)
class _Audit:
    range: str = ""
    grey: _Figures | None = None
    swapped: _Figures | None = None


@dataclass(frozen=True)
class _Costs:
    parameters: Count | None
    multiply_adds: Count | None
    latency_ms: Number | None


@dataclass(frozen=True)
class _Method(_Costs):
    samples_trained: Count | None
    trained_on: list[str]
    rows: list[_Row]
    audit: _Audit
    claims: list[Published]


@dataclass(frozen=True)
class _Sequence:
    name: str
    rig: str
    frames: Count


@dataclass(frozen=True, kw_only=True)
class _Table:
    sequences: list[_Sequence]
    repeats: Count
    seed: Count
    threads: Count
    initial: list[_Row] = ()  # type: ignore[assignment]


@dataclass(frozen=True, kw_only=True)
class _Bench(_Table):
    ranges: list[str]
    most: Count
    methods: dict[str, _Method]


@dataclass(frozen=True, kw_only=True)
class _AblationRow(_Figures):
    preset: str
    name: Annotated[str, Predicate(PUBLISHED_ABLATION.__contains__)]
    parameters: Count
    multiply_adds: Count
    latency_ms: Number | None
    samples_trained: Count = 0


@dataclass(frozen=True, kw_only=True)
class _Ablation(_Table):
    range: str
    input: Annotated[list[Count], Len(2, 2)]
    processor: str
    rows: list[_AblationRow]


def read_table(source: Path, command: str) -> dict[str, Any]:
    """Read a JSON file that ``bench`` or ``ablate`` wrote.

    Raises:
        ConfigError: it is not a file of that command.
    """
    remedy = f"give a file written by `calib-inspect {command} --json`"
    try:
        content = parse_json(read_text(source, f"The table of {command}", error=ConfigError))
    except ValueError as error:
        raise ConfigError(f"{source} is not JSON ({error}); {remedy}.") from None
    if not isinstance(content, dict) or content.get("table") != command:
        raise ConfigError(f"{source} was not written by `calib-inspect {command} --json`; {remedy}.")
    validated({"bench": _Bench, "ablate": _Ablation}[command], content, str(source), ConfigError, remedy)
    return content
