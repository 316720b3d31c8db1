"""Recordings of the fake cascade, made once a session, and how to read them back."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from tests.support import fakes as fakes_module


@pytest.fixture(scope="session")
def fakes() -> ModuleType:
    return fakes_module


@pytest.fixture(scope="session")
def record() -> Callable[..., None]:
    """Record the fake sequence: ``record(file, length=3, detail="full", as_is=False, seed=1, **cascade)``."""
    from rich.console import Console

    from calibnet.geometry import MiscalibrationRange
    from inspector.record.contents import Coloring, Contents, Detail, Part
    from inspector.record.outputs import Outputs
    from inspector.record.recording import RunDescription
    from inspector.run.session import Session
    from inspector.run.start import Start

    def make(
        file: Path,
        length: int = 3,
        detail: str = "full",
        parts: tuple[str, ...] = (),
        color: str = "depth",
        as_is: bool = False,
        seed: int = 1,
        sequence: Any = None,
        per_frame: bool = False,
        provenance: dict[str, Any] | None = None,
        stop_on_bad_frame: bool = False,
        drive: bool = False,
        drive_asked: bool = False,
        watching: Any = None,
        cascade_type: Any = fakes_module.FakeCascade,
        **cascade: Any,
    ) -> Any:
        session = Session(
            sequence=sequence or fakes_module.FakeSequence(length),
            positions=range(length),
            cascade=cascade_type(**cascade),
            skipped=fakes_module.FakeCascade.skipped,
            start=Start(MiscalibrationRange(5, 0.5), seed, per_frame=per_frame, as_is=as_is),
            outputs=Outputs(file),
            description=RunDescription("fake/00", {"seed": seed, "detail": detail}, provenance or {}),
            contents=Contents.of(Detail(detail), frozenset(map(Part, parts)), Coloring(color)),
            console=Console(quiet=True),
            stop_on_bad_frame=stop_on_bad_frame,
            drive=drive,
            drive_asked=drive_asked,
            watching=watching,
        )
        try:
            return session.run()
        finally:
            session.outputs.close()

    return make


@pytest.fixture(scope="session")
def full_recording(record: Callable[..., None], tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("full") / "full.rrd"
    record(file)
    return file


@pytest.fixture(scope="session")
def read() -> Callable[..., list[tuple[Any, Any]]]:
    """``read(file, entity, component, timeline="frame")`` gives ``[(time, values)]`` in order."""
    from rerun.chunk import RrdReader

    def column(file: Path, entity: str, component: str, timeline: str = "frame") -> list[tuple[Any, Any]]:
        rows: list[tuple[Any, Any]] = []
        for chunk in RrdReader(file).store().stream().filter(content=f"/{entity}", components=component):
            batch = chunk.to_record_batch()
            if timeline in batch.schema.names and component in batch.schema.names:
                rows += zip(batch[timeline].to_pylist(), batch[component], strict=True)
        return sorted(rows, key=lambda row: row[0])

    return column
