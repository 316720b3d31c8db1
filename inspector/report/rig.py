"""The report of a rig: one page with all its cameras before and after, and their residuals."""

from __future__ import annotations

import json
from collections.abc import Iterator
from html import escape
from pathlib import Path

from calibnet.runtime.writing import Kind, write_whole
from inspector import entities
from inspector.read.rig import RecordedRig
from inspector.report.files import PICTURES, RECORDING
from inspector.report.pictures import draw_overlay
from inspector.report.template import Head, Side, figure, report_page, scale_of_depth, template, with_code
from inspector.report.verdict import GRADES
from inspector.report.write import write_files
from inspector.rig_result import CameraResult
from inspector.verdicts import explained


def write_rig_report(rig: RecordedRig, folder: Path) -> Path:
    """Write the report of a rig; existing files are replaced only by files of the same names.

    Args:
        rig: the recording.
        folder: folder of the report, created if it does not exist.

    Returns:
        The page.

    Raises:
        ConfigError: the folder cannot be written, for instance because the disk is full.
        CalibnetError: a picture of the recording cannot be read.
    """
    metrics = json.dumps({"title": rig.title, **rig.solved.as_dict()}, indent=1, allow_nan=False)

    def draw() -> list[str]:
        shown = [(number, one) for number, one in enumerate(rig.solved.cameras) if rig.moments[one.name]]
        return [_draw(rig, number, camera, folder) for number, camera in shown]

    return write_files(folder, rig.path, draw, metrics, lambda figures, size: _page(rig, figures, size))


def _draw(rig: RecordedRig, number: int, camera: CameraResult, folder: Path) -> str:
    """Draw a frame of a camera before and after; returns the HTML that shows both."""
    pictures, size = rig.pictures(camera.name), (camera.camera.width, camera.camera.height)
    moments = rig.moments[camera.name]
    index = moments[len(moments) // 2]
    image, sides = pictures.image(index), list[Side]()
    start = "as given" if camera.reference is None else "miscalibrated"
    result = f"corrected, {camera.verdict.word}"
    shown = {start: entities.OVERLAY_MISCALIBRATED, result: entities.OVERLAY_CORRECTED}
    for side, (name, entity) in zip(("left", "right"), shown.items(), strict=True):
        file = f"{PICTURES}/camera_{number}_{side}.jpg"
        write_whole(folder / file, draw_overlay(image, *pictures.overlay(entity, index), size), Kind.JPEG)
        sides.append(Side(file, name, f"{camera.name} with the LiDAR points, {name}"))
    return figure(f"<span><b>{escape(camera.name)}</b>, frame {index}</span>", *sides)


def _page(rig: RecordedRig, figures: list[str], recording_bytes: int) -> str:
    solved = rig.solved
    sections = template("rig.html").substitute(
        table=_table(*solved.table()), figures="\n".join(figures), scale=scale_of_depth()
    )
    head = Head(
        title=f"{rig.title}: calibration report",
        kind="Camera–LiDAR calibration report of a rig",
        word=solved.word,
        verdict=solved.word.capitalize(),
        reasons="\n".join(_reasons(solved.cameras)),
        headline=solved.headline,
        findings="",
        about=rig.title,
        metrics="verdict, extrinsic and covariance of every camera.",
    )
    return report_page(head, sections, RECORDING, recording_bytes)


def _reasons(cameras: tuple[CameraResult, ...]) -> Iterator[str]:
    """The reasons of the verdicts, each with its cameras."""
    named: dict[str, list[CameraResult]] = {}
    for camera in cameras:
        named.setdefault(explained(camera.verdict), []).append(camera)
    for reason, of in named.items():
        names = "" if len(of) == len(cameras) else f"{', '.join(camera.name for camera in of)}: "
        yield f'<li class="{GRADES[of[0].verdict.word]}">{with_code(names + reason)}</li>'


def _table(columns: list[str], rows: list[list[str]]) -> str:
    head = "".join(f"<th>{escape(column)}</th>" for column in columns)
    body = "\n".join(f"<tr>{''.join(f'<td>{escape(_whole(cell))}</td>' for cell in row)}</tr>" for row in rows)
    return f'<table class="figures">\n<thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody>\n</table>'


def _whole(cell: str) -> str:
    """A cell in which no line break separates a number from its unit."""
    return cell.replace(" cm", "\u00a0cm").replace(" px", "\u00a0px")
