"""Recordings of rigs, comparisons, trainings and watched drives: foreign, or met by a command that is not theirs."""

from __future__ import annotations

import functools
import json
import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from tests.hostile.recordings import CAMERA, COMMANDS, MATRIX, VERDICT, whole
from tests.hostile.rows import BAD, FINE, Make, Row

APPLICATIONS = {
    "a training": "calib_inspect_training",
    "a comparison": "calib-inspect-compare",
    "somebody else's": "rerun_example_app",
}
CAMERA_OF_RIG: dict[str, Any] = {
    "verdict": VERDICT,
    "residual": {"match_error_px": 1.0, "rotation_deg": 0.1, "translation_cm": 1.0},
    "reference": None,
    "initial": [MATRIX[row : row + 4] for row in range(0, 16, 4)],
    "camera": {
        "width": 400,
        "height": 120,
        "matrix": CAMERA["camera_matrix"],
        "model": "plumb_bob",
        "coefficients": [0.0] * 5,
    },
}
NAN4 = [[float("nan")] * 4] * 4


def rig_of(**changes: Any) -> str:
    """What the recording of a rig says of one camera, changed."""
    return json.dumps({"cameras": {"c0": CAMERA_OF_RIG | changes}, "rigid": False, "tolerance": ""})


RIGS: dict[str, str] = {
    "no JSON": "{",
    "nested": "[" * 100_000,
    "a list": "[]",
    "null": "null",
    "no cameras": '{"cameras": {}, "rigid": false, "tolerance": ""}',
    "cameras that are a list": '{"cameras": [1], "rigid": false, "tolerance": ""}',
    "a camera of null": '{"cameras": {"c0": null}, "rigid": false, "tolerance": ""}',
    "a huge number": '{"cameras": ' + "9" * 9000 + "}",
    "no verdict": rig_of(verdict=None),
    "a verdict of another word": rig_of(verdict=VERDICT | {"verdict": "splendid"}),
    "an initial of NaN": rig_of(initial=NAN4),
    "a reference of NaN": rig_of(reference=NAN4),
    "a residual of texts": rig_of(residual={"match_error_px": "a", "rotation_deg": "b", "translation_cm": "c"}),
    "no residual": rig_of(residual={}),
    "a camera of no width": rig_of(camera=CAMERA_OF_RIG["camera"] | {"width": 0}),
    "a camera of 2^40 pixels": rig_of(camera=CAMERA_OF_RIG["camera"] | {"width": 2**20, "height": 2**20}),
    "a lens that there is not": rig_of(camera=CAMERA_OF_RIG["camera"] | {"model": "eye"}),
    "a lens of a thousand coefficients": rig_of(camera=CAMERA_OF_RIG["camera"] | {"coefficients": [0.1] * 1000}),
}
NAMES = {
    "a path": "../../c0",
    "a key of YAML": "c0\nmine: 1",
    "escapes": "c0\x1b[2J",
    "markup": "<b>c0</b>[red]",
    "nothing": "",
    "3000 characters": "c" * 3000,
}


def recorded(application: str, entities: Callable[[Any], None]) -> Path:
    """A recording of an application."""
    import rerun as rr

    file = Path(tempfile.mkdtemp(prefix="calib-inspect-hostile-")) / "run.rrd"
    rec = rr.RecordingStream(application, recording_id="hostile")
    rec.save(file)
    entities(rec)
    rec.disconnect()
    return file


@functools.cache
def of_rig(text: str) -> Path:
    """A recording that says this of a rig, and nothing else."""
    import rerun as rr

    from inspector import entities

    def log(rec: Any) -> None:
        rec.log(entities.RIG, rr.AnyValues(**{entities.RIG_JSON: text}), static=True)

    return recorded(entities.APPLICATION_ID, log)


@functools.cache
def of_application(application: str) -> Path:
    """A recording with a curve."""
    import rerun as rr

    def log(rec: Any) -> None:
        for step in range(3):
            rec.set_time("samples", sequence=step)
            rec.log("training/loss", rr.Scalars(float(step)))

    return recorded(application, log)


def read_by(command: list[str], file: Callable[[], Path]) -> Make:
    """A command that is given a recording beside another one."""

    def made(root: Path) -> list[str]:
        whole("check")(root)
        shutil.copyfile(file(), root / "run.rrd")
        return command

    return made


def rows() -> Iterator[Row]:
    """Of each kind, read by every command."""
    of_rigs = {
        "report": ["report", "run.rrd", "--output", "report"],
        "export": ["export", "run.rrd", "--format", "json", "--output", "out"],
        "check": ["check", "run.rrd"],
    }
    for what, text in RIGS.items():
        for command, words in of_rigs.items():
            yield Row(
                f"recording of a rig, {what}: {command}", read_by(words, lambda t=text: of_rig(t)), BAD, ("run.rrd",)
            )
    for what, name in NAMES.items():
        text = json.dumps({"cameras": {name: CAMERA_OF_RIG}, "rigid": False, "tolerance": ""})
        for form in ("json", "ros", "yaml", "urdf"):
            words = ["export", "run.rrd", "--format", form, "--output", "out"]
            yield Row(f"a rig's camera called {what}: {form}", read_by(words, lambda t=text: of_rig(t)), FINE)
        yield Row(
            f"a rig's camera that is asked for, called {what}",
            read_by(["export", "run.rrd", "--format", "json", "--camera", "none"], lambda t=text: of_rig(t)),
        )
    for what, application in APPLICATIONS.items():
        for command, words in COMMANDS.items():
            yield Row(
                f"{what} given to {command}", read_by(words, lambda a=application: of_application(a)), BAD, ("run.rrd",)
            )
        animate = ["pictures", "run.rrd", "--animate", "x.webp"]
        yield Row(
            f"{what} given to pictures", read_by(animate, lambda a=application: of_application(a)), BAD, ("run.rrd",)
        )
