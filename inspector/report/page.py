"""The page of a report: one HTML file that needs no network and no other files than its pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any, NamedTuple

from calibnet.geometry import PoseError
from inspector.read.run import RecordedRun
from inspector.record.contents import Coloring
from inspector.report.charts import charts
from inspector.report.files import AS_ONE, LEFT
from inspector.report.metrics import DISTANCE_M, Figures
from inspector.report.tables import axes_table, stages_table
from inspector.report.template import Head, Side, figure, report_page, scale_of_depth, template, with_code
from inspector.report.verdict import ROTATION, TRANSLATION, Finding, count, findings, headline, verdict
from inspector.verdicts import OF_GIVEN, title

SETTING_NAMES = {
    "sequence": "data",
    "rig": "sensors",
    "frames": "frames",
    "camera": "camera",
    "start": "start",
    "seed": "seed",
    "stages": "stages",
    "preset": "network",
    "as_one_drive": "solved as one drive",
    "detail": "recorded detail",
    "parts": "recorded parts",
    "color": "points coloured by",
    "calib_inspect": "calib-inspect",
}
"""Names of settings on the page, in order; other settings follow under their own names."""
METHOD = (
    "Rotation: the angle of R_est · R_refᵀ in degrees. Translation: |t_est − t_ref| in centimetres, the LiDAR’s origin "
    "seen from the camera. Per axis, in the camera’s frame: roll about z (ahead), pitch about x (right), yaw about y "
    "(down). p95: 95 % of the frames lie below. {against}"
)
AGAINST_REFERENCE = "The reference is the data’s own extrinsic, whose accuracy limits all figures."
AGAINST_MEDIAN = (
    "There is no reference; the median of all corrected extrinsics takes its place, so the figures show how much "
    "the frames scatter, not how accurate they are."
)


class Example(NamedTuple):
    """An example frame with its pictures.

    Attributes:
        name: worst, median or best.
        position: position of the frame in the run.
        pictures: files relative to the report's folder, by what they show, the result last.
    """

    name: str
    position: int
    pictures: Mapping[str, str]


COLORINGS = {
    Coloring.DEPTH: "coloured by depth. Where the calibration is right, colours jump at edges of the image.",
    Coloring.INTENSITY: "coloured by the laser’s intensity. Where the calibration is right, paint and signs match.",
    Coloring.EDGE: "pink at depth edges. Where the calibration is right, pink lies on outlines.",
    Coloring.ERROR: "coloured by their distance from the reference in pixels, from dark (0) to bright (20 or more).",
}
"""Meaning of the points' colours, and what to look for."""


def make_page(figures: Figures, examples: Sequence[Example], recording: str, recording_bytes: int) -> str:
    """Fill the template.

    Args:
        figures: figures of the run.
        examples: frames to show.
        recording: name of the recording beside the page.
        recording_bytes: size of the recording.
    """
    run = figures.run
    name = str(run.settings.get("sequence", run.title))
    known = figures.has_reference
    warning = f'<p class="warning">{escape(run.warning)}</p>\n' if run.warning else ""
    sections = template("run.html").substitute(
        ranking=escape(_ranking(figures)),
        examples="\n".join(_example(figures, example) for example in examples),
        coloring=COLORINGS[_coloring(run)],
        scale=scale_of_depth() if _coloring(run) is Coloring.DEPTH else "",
        stages_title=f"{figures.measure} after every stage",
        stages_table=stages_table(figures),
        axes_table=axes_table(figures),
        charts=charts(figures),
        settings=_settings(figures),
        method=escape(METHOD.format(against=AGAINST_REFERENCE if known else AGAINST_MEDIAN)),
    )
    head = Head(
        title=f"{name}: calibration report",
        kind="Camera–LiDAR calibration report",
        word=run.verdict.word,
        verdict=title(run.verdict, OF_GIVEN if run.given_verdict else ""),
        reasons=_items(verdict(run)),
        headline=headline(figures),
        findings=f'{warning}<ul class="verdict">\n{_items(findings(figures))}\n</ul>',
        about=f"{run.title} · {count(len(run.frames))}",
        metrics="these figures, every frame's errors, verdict and corrected extrinsic.",
    )
    return report_page(head, sections, recording, recording_bytes, figures.states)


def _items(found: Sequence[Finding]) -> str:
    return "\n".join(f'<li class="{finding.grade}">{with_code(finding.sentence)}</li>' for finding in found)


def _coloring(run: RecordedRun) -> Coloring:
    """Colouring of the recorded points; recordings of early versions show depth."""
    return Coloring(run.settings.get("color", Coloring.DEPTH))


def _pair(error: PoseError) -> str:
    return f"{ROTATION.say(error.rotation_deg)} / {TRANSLATION.say(error.translation_cm)}"


def _ranking(figures: Figures) -> str:
    if len(figures.run.frames) == 1:
        return ""
    far = "misplaced" if figures.has_reference else "from where the frames’ median puts it"
    return f"Frames are ranked by how far, at most, the correction leaves a point {DISTANCE_M:g} m away {far}."


def _example(figures: Figures, example: Example) -> str:
    frame = figures.run.frames[example.position]
    single = len(figures.run.frames) == 1
    before, after = (state.errors[example.position] for state in (figures.initial, figures.corrected))
    if figures.has_reference:
        result = f"{_pair(before)} → {_pair(after)}"
        as_one = figures.run.drive_error
        if as_one is not None and AS_ONE in example.pictures:
            alone = LEFT if frame.rejected else f"{_pair(after)} alone"
            result = f"{_pair(before)} → {_pair(as_one)} {AS_ONE}; {alone}"
        elif frame.rejected:
            result = f"{_pair(before)}, {LEFT}"
    else:
        change = figures.changes[example.position]
        result = f"changed by {_pair(change)}"
        result += "" if single else f", {_pair(after)} from the frames’ median"
    title = "" if single else f"<b>{example.name.capitalize()}:</b> "
    *lefts, right = (
        Side(file, shown, f"Frame {frame.index} with the LiDAR points, {shown}")
        for shown, file in example.pictures.items()
    )
    caption = f"<span>{title}frame {frame.index} ({escape(frame.source)}), {result}</span>\n"
    return figure(caption + _choice(example, [side.name for side in lefts]), lefts[0], right)


def _choice(example: Example, lefts: Sequence[str]) -> str:
    """Buttons that choose the picture to compare the corrected one with, if there are several."""
    if len(lefts) < 2:
        return ""
    radios = (
        f'<label><input type="radio" name="{example.name}" value="{escape(example.pictures[left])}" '
        f'data-name="{left}"{" checked" if left == lefts[0] else ""}>{left}</label>'
        for left in lefts
    )
    *_, result = example.pictures
    return f'<span class="choice">{result.capitalize()} against{"".join(radios)}</span>'


def _settings(figures: Figures) -> str:
    run = figures.run
    known = {**run.settings, **run.provenance}
    if known.get("frames") == ":":
        known["frames"] = "all"
    ordered = {name: known[name] for name in [*SETTING_NAMES, *known] if name in known}
    cells = {SETTING_NAMES.get(name, name): _told(value) for name, value in ordered.items()}
    cells |= {f"weights of stage {number}": _record(record) for number, record in run.weights.items()}
    return "\n".join(f"<tr><th>{escape(name)}</th><td>{escape(told)}</td></tr>" for name, told in cells.items() if told)


def _told(value: object) -> str:
    return {True: "yes", False: "no"}[value] if isinstance(value, bool) else str(value).replace(",", ", ")


def _record(record: Mapping[str, Any]) -> str:
    """A short form of a training record; ``metrics.json`` has all of it."""
    parts = [
        f"{record[name]:,g} {name}" for name in ("minutes", "samples") if isinstance(record.get(name), int | float)
    ]
    data = (record.get("options") or {}).get("data")
    parts += [f"on {', '.join(map(str, data))}"] if data else []
    parts += [f"commit {record['commit']}"] if record.get("commit") else []
    return "; ".join(parts) or "no training record"
