"""The report of a rig: one page with all its cameras, before and after, and what each leaves."""

from __future__ import annotations

import json
from collections.abc import Iterator
from html import escape
from importlib import resources
from pathlib import Path
from string import Template

from calibnet.runtime.claim import Claim
from calibnet.runtime.writing import Kind, write_whole
from inspector import entities
from inspector.read.rig import RecordedRig
from inspector.report.charts import series_styles
from inspector.report.page import SERVE_COMMAND
from inspector.report.pictures import depth_scale, draw_overlay
from inspector.report.verdict import GRADES
from inspector.report.write import METRICS, PAGE, PICTURES, RECORDING, cannot_write, check_folder, copy_recording
from inspector.run.rig_solved import COLUMNS, SolvedCamera
from inspector.verdicts import explained


def write_rig_report(rig: RecordedRig, folder: Path) -> Path:
    """Write the report of a rig; of what the folder holds only files of the same names are replaced.

    Args:
        rig: the recording.
        folder: created if it does not exist.

    Returns:
        The page.

    Raises:
        ConfigError: the folder cannot be written, for instance because the disk is full.
        CalibnetError: a picture of the recording cannot be read.
    """
    check_folder(folder)
    claim = Claim(folder / PAGE, Kind.PAGE)
    try:
        figures = [
            figure(rig, number, camera, folder)
            for number, camera in enumerate(rig.solved.cameras)
            if rig.moments[camera.name]
        ]
        metrics = json.dumps({"title": rig.title, **rig.solved.as_dict()}, indent=1, allow_nan=False)
        write_whole(folder / METRICS, metrics.encode(), Kind.JSON)
        copy_recording(rig.path, folder / RECORDING)
        page = _page(rig, figures, (folder / RECORDING).stat().st_size)
        write_whole(folder / PAGE, page.encode(errors="backslashreplace"), Kind.PAGE)
    except OSError as error:
        raise cannot_write(error, folder) from None
    finally:
        claim.release()
    return folder / PAGE


def figure(rig: RecordedRig, number: int, camera: SolvedCamera, folder: Path) -> str:
    """Draw a frame of a camera before and after; returns the HTML that shows them."""
    pictures, size = rig.pictures(camera.name), (camera.camera.width, camera.camera.height)
    moments = rig.moments[camera.name]
    index = moments[len(moments) // 2]
    image, sides = pictures.image(index), []
    shown = {"as given": entities.OVERLAY_MISCALIBRATED, camera.verdict.word: entities.OVERLAY_CORRECTED}
    for side, (name, entity) in zip(("left", "right"), shown.items(), strict=True):
        file = f"{PICTURES}/camera_{number}_{side}.jpg"
        write_whole(folder / file, draw_overlay(image, *pictures.overlay(entity, index), size), Kind.JPEG)
        alt = f"{camera.name} with the LiDAR points, {name}"
        sides.append(
            f'<div class="side {side}"><img src="{escape(file)}" alt="{escape(alt)}">'
            f'<span class="tag">{escape(name)}</span></div>'
        )
    return f"""<figure>
<figcaption><span><b>{escape(camera.name)}</b>, frame {index}</span></figcaption>
<div class="compare">
{sides[0]}
{sides[1]}
<input type="range" min="0" max="100" value="50" step="any" aria-label="Boundary between as given and found">
<div class="handle"></div>
</div>
</figure>"""


def _page(rig: RecordedRig, figures: list[str], recording_bytes: int) -> str:
    solved = rig.solved
    return _template("rig.html").substitute(
        title=escape(f"{rig.title}: calibration report"),
        style=_template("page.css").substitute(series_styles([])),
        word=solved.word.capitalize(),
        grade=GRADES[solved.word],
        reasons="\n".join(_reasons(solved.cameras)),
        headline=escape(f"{len(solved.cameras)} cameras, solved {solved.how}."),
        about=escape(rig.title),
        table=_table(solved.cameras),
        figures="\n".join(figures),
        scale=f'<div class="depth"><span>Depth</span>{depth_scale()}</div>',
        recording=RECORDING,
        serve_command=escape(SERVE_COMMAND.format(recording=RECORDING)),
        size=f"{recording_bytes / 1e6:.1f} MB",
        script=_resource("page.js"),
    )


def _reasons(cameras: tuple[SolvedCamera, ...]) -> Iterator[str]:
    """The reasons of the verdicts, each with the cameras that it is of."""
    named: dict[str, list[SolvedCamera]] = {}
    for camera in cameras:
        named.setdefault(explained(camera.verdict), []).append(camera)
    for reason, of in named.items():
        names = "" if len(of) == len(cameras) else f"{', '.join(camera.name for camera in of)}: "
        yield f'<li class="{GRADES[of[0].verdict.word]}">{escape(names + reason)}</li>'


def _table(cameras: tuple[SolvedCamera, ...]) -> str:
    rows = [camera.row() for camera in cameras]
    kept = [column for column in range(len(COLUMNS)) if any(row[column] for row in rows)]
    head = "".join(f"<th>{escape(COLUMNS[column])}</th>" for column in kept)
    body = "\n".join(f"<tr>{''.join(f'<td>{escape(row[column])}</td>' for column in kept)}</tr>" for row in rows)
    return f"<table>\n<thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody>\n</table>"


def _resource(name: str) -> str:
    return resources.files("inspector.report").joinpath(name).read_text(encoding="utf-8")


def _template(name: str) -> Template:
    return Template(_resource(name))
