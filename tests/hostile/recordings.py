"""Recordings that are cut, damaged, foreign, or say what no run has computed."""

from __future__ import annotations

import functools
import json
import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tests.hostile.inputs import Build
from tests.hostile.pictures import WHOLE_JPEG, encoded, png
from tests.hostile.rows import FINE, Row, instead_of

COMMANDS = {
    "check": ["check", "run.rrd", "--json", "-"],
    "export": ["export", "run.rrd", "--format", "json", "--force"],
    "report": ["report", "run.rrd", "--output", "report"],
    "compare": ["compare", "run.rrd", "other.rrd", "--save", "both.rrd", "--headless", "--common-frames"],
}
WRITTEN = ("report", "both.rrd")


@functools.cache
def prepare() -> Path:
    """The recording that is damaged: two frames of the fake car, made once."""
    from rich.console import Console

    from calibnet.geometry import MiscalibrationRange
    from inspector.record.contents import Coloring, Contents, Detail
    from inspector.record.outputs import Outputs
    from inspector.record.recording import RunDescription
    from inspector.run.session import Session
    from inspector.run.start import Start
    from tests.support.fakes import FakeCascade, FakeSequence

    file = Path(tempfile.mkdtemp(prefix="calib-inspect-hostile-")) / "run.rrd"
    session = Session(
        sequence=FakeSequence(2),
        positions=range(2),
        cascade=FakeCascade(),
        skipped=FakeCascade.skipped,
        start=Start(MiscalibrationRange(5, 0.5), 1),
        outputs=Outputs(file),
        description=RunDescription("fake/00", {"seed": 1, "detail": "overview", "sequence": "fake/00"}),
        contents=Contents.of(Detail.OVERVIEW, frozenset(), Coloring.DEPTH),
        console=Console(quiet=True),
    )
    session.run()
    return file


def whole(command: str) -> Build:
    """The recording as it is, and another of the same."""

    def made(root: Path) -> list[str]:
        for name in ("run.rrd", "other.rrd"):
            shutil.copyfile(prepare(), root / name)
        return COMMANDS[command]

    return made


def damaged(command: str, change: Callable[[bytes], bytes]) -> Build:
    """The recording with other bytes."""

    def made(root: Path) -> list[str]:
        arguments = whole(command)(root)
        (root / "run.rrd").write_bytes(change((root / "run.rrd").read_bytes()))
        return arguments

    return made


def said(command: str, entity: str, *, static: bool = False, app: str = "calib-inspect", **values: Any) -> Build:
    """The recording in which one thing is said that was not."""

    def made(root: Path) -> list[str]:
        import rerun as rr
        from rerun.chunk import RrdReader

        arguments = whole(command)(root)
        source = root / "source.rrd"
        shutil.copyfile(prepare(), source)
        rec = rr.RecordingStream(app, recording_id="hostile")
        rec.save(root / "run.rrd")
        for chunk in RrdReader(source).store().stream():
            if chunk.entity_path.lstrip("/") != entity:
                rr.send_chunks(chunk, recording=rec)
        for frame in (0, 1):
            rec.set_time("frame", sequence=frame)
            rec.set_time("time", duration=0.1 * frame)
            rec.log(entity, rr.AnyValues(**values) if "archetype" not in values else values["archetype"], static=static)
        rec.disconnect()
        source.unlink()
        return arguments

    return made


MATRIX = [0.0, -1, 0, 0, 0, 0, -1, 0, 1, 0, 0, 0, 0, 0, 0, 1]
CAMERA: dict[str, Any] = {
    "width": 400,
    "height": 120,
    "camera_matrix": [232.0, 0, 200, 0, 232, 60, 0, 0, 1],
    "source": "fake 0",
}
VERDICT: dict[str, Any] = {
    "verdict": "accepted",
    "reason": "Fine.",
    "causes": [],
    "camera_from_lidar": np.reshape(MATRIX, (4, 4)).tolist(),
    "moved": {"rotation_deg": 1.0, "translation_cm": 2.0},
    "sigma": None,
    "frames": {"used": 1, "skipped": []},
}


def verdict(**change: Any) -> dict[str, Any]:
    """A verdict's text with values changed, or left out."""
    return {"verdict_json": json.dumps({k: v for k, v in (VERDICT | change).items() if v != "left out"})}


def extrinsic(*change: tuple[int, float]) -> dict[str, Any]:
    """An extrinsic with entries changed."""
    values = np.array(MATRIX)
    for place, value in change:
        values[place] = value
    return {"camera_from_lidar": values}


SAID: dict[str, tuple[str, dict[str, Any]]] = {
    "an extrinsic of NaN": ("extrinsic/initial", extrinsic((3, np.nan))),
    "an extrinsic of infinity": ("extrinsic/stage_5", extrinsic((3, np.inf))),
    "an extrinsic of 1e300": ("extrinsic/corrected", extrinsic((3, 1e300))),
    "an extrinsic that stretches": ("extrinsic/corrected", extrinsic((1, -9.0))),
    "an extrinsic of zeros": ("extrinsic/reference", {"camera_from_lidar": np.zeros(16)}),
    "an extrinsic of 15 numbers": ("extrinsic/initial", {"camera_from_lidar": np.zeros(15)}),
    "a verdict that is no JSON": ("verdict/frame", {"verdict_json": "{"}),
    "a verdict that is a list": ("verdict/frame", {"verdict_json": "[]"}),
    "a verdict nested": ("verdict/frame", {"verdict_json": "[" * 100_000}),
    "a verdict of another word": ("verdict/frame", verdict(verdict="splendid")),
    "a verdict without a reason": ("verdict/frame", verdict(reason="left out")),
    "a verdict whose reason is a list": ("verdict/frame", verdict(reason=[])),
    "a verdict with odd causes": ("verdict/frame", verdict(causes=[{"name": 1}])),
    "a verdict without an extrinsic": ("verdict/frame", verdict(camera_from_lidar=None)),
    "a verdict of a 2x2 extrinsic": ("verdict/frame", verdict(camera_from_lidar=[[1, 0], [0, 1]])),
    "a verdict of NaN": ("verdict/frame", verdict(camera_from_lidar=[[float("nan")] * 4] * 4)),
    "a verdict with odd movement": ("verdict/frame", verdict(moved={"rotation_deg": "x"})),
    "a verdict with an odd sigma": ("verdict/frame", verdict(sigma={"covariance": [[1]]})),
    "a verdict of a billion frames": ("verdict/frame", verdict(frames={"used": 10**30, "skipped": []})),
    "a camera of no width": ("extrinsic/camera", CAMERA | {"width": 0}),
    "a camera of negative width": ("extrinsic/camera", CAMERA | {"width": -400}),
    "a camera of 2^40 pixels": ("extrinsic/camera", CAMERA | {"width": 60_000, "height": 60_000}),
    "a camera of NaN": ("extrinsic/camera", CAMERA | {"camera_matrix": [np.nan] * 9}),
    "a camera of 8 numbers": ("extrinsic/camera", CAMERA | {"camera_matrix": [1.0] * 8}),
    "a camera of no focal length": ("extrinsic/camera", CAMERA | {"camera_matrix": [0.0] * 9}),
}
PICTURES: dict[str, Callable[[], Any]] = {
    "a picture of noise": lambda: _picture(b"noise" * 100),
    "a picture cut": lambda: _picture(WHOLE_JPEG[:3000]),
    "a picture of another size": lambda: _picture(
        encoded("JPEG", None).replace(b"\x00\x78\x01\x90", b"\x00\x10\x01\x90")
    ),
    "a picture of 30000 x 30000": lambda: _picture(png(30_000, 30_000, b"")),
    "an empty picture": lambda: _picture(b""),
}


def _picture(content: bytes) -> Any:
    import rerun as rr

    return rr.EncodedImage(contents=content, media_type="image/jpeg")


def rows() -> Iterator[Row]:
    """Of recordings, and the commands that read them."""
    for command in COMMANDS:
        code = FINE
        yield Row(f"recording that is whole: {command}", whole(command), code, replaced=WRITTEN)
        yield from instead_of(f"recording, {command}", whole(command), "run.rrd")
        for share in (0.02, 0.2):
            what = f"recording cut to {share:.0%}: {command}"
            yield Row(
                what, damaged(command, lambda data, share=share: data[: int(share * len(data))]), words=("run.rrd",)
            )
        half = damaged(command, lambda data: data[: len(data) // 2])
        words = ("run.rrd is cut off; only its 2 complete frames are used",)
        unknown = 4 if command == "check" else code  # what the whole run found is not in it
        yield Row(f"recording cut to half: {command}", half, unknown, words, replaced=WRITTEN)
        yield Row(f"recording of zeros: {command}", damaged(command, lambda data: data[:8] + bytes(len(data) - 8)))
    for what, (entity, values) in SAID.items():
        yield Row(f"recording with {what}", said("check", entity, **values), words=("run.rrd",))
        if entity == "verdict/frame":
            continue
        yield Row(
            f"recording with {what}: report", said("report", entity, **values), words=("run.rrd",), replaced=WRITTEN
        )
    for what, make in PICTURES.items():

        def made(root: Path, make: Callable[[], Any] = make) -> list[str]:
            return said("report", "image", archetype=make())(root)

        yield Row(f"recording with {what}", made, words=("recording",), replaced=WRITTEN)
