"""The page of a report: one HTML file that needs no network and no other file but its pictures."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib import resources
from string import Template
from typing import Any, NamedTuple

from calibnet.geometry import PoseError
from inspector import colors
from inspector.colors import Rgb
from inspector.report.figures_svg import Series, histogram, line_chart
from inspector.report.metrics import DISTANCE_M, Figures, State
from inspector.report.pictures import depth_scale
from inspector.report.verdict import ROTATION, TRANSLATION, Quantity, count, headline, verdict

ON_PAPER = 0.8
"""Brightness of the series' colours on white, where those of the viewer's dark background are too pale."""
SETTING_NAMES = {
    "sequence": "data",
    "rig": "sensors",
    "frames": "frames",
    "camera": "camera",
    "start": "start",
    "seed": "seed",
    "stages": "stages",
    "preset": "network",
    "detail": "recorded detail",
    "calib_inspect": "calib-inspect",
}
"""What settings are called on the page, in its order; others follow under their own names."""
SERVE_COMMAND = "calib-inspect report {recording} --out . --open"
METHOD = (
    "Rotation: the angle of R_est · R_refᵀ in degrees. Translation: |t_est − t_ref| in centimetres, the LiDAR’s origin "
    "seen from the camera. Per axis, in the camera’s frame: roll about z (ahead), pitch about x (right), yaw about y "
    "(down). p95: 95 % of the frames lie below. {against}"
)
AGAINST_REFERENCE = "The reference is the data’s own extrinsic, so no figure can be better than that calibration is."
AGAINST_MEDIAN = (
    "There is no reference: in its place stands the median of all corrected extrinsics, so the figures say how far "
    "the frames scatter, not how right they are."
)


class Example(NamedTuple):
    """A frame with its pictures.

    Attributes:
        name: worst, median or best.
        position: of the frame in the run.
        pictures: file below the report's folder by what it shows, ``corrected`` last.
    """

    name: str
    position: int
    pictures: Mapping[str, str]


def make_page(figures: Figures, examples: Sequence[Example], recording: str, recording_bytes: int) -> str:
    """Fill the template.

    Args:
        figures: what to say.
        examples: what to show.
        recording: name of the recording beside the page.
        recording_bytes: its size.
    """
    run = figures.run
    name = str(run.settings.get("sequence", run.title))
    known = figures.has_reference
    return _template("page.html").substitute(
        title=escape(f"{name}: calibration report"),
        style=_style(figures.states),
        headline=escape(headline(figures)),
        warning=f'<p class="warning">{escape(run.warning)}</p>' if run.warning else "",
        verdict="\n".join(
            f'<li class="{finding.grade}">{escape(finding.sentence)}</li>' for finding in verdict(figures)
        ),
        about=escape(f"{run.title} · {count(len(run.frames))}"),
        recording=escape(recording),
        serve_command=escape(SERVE_COMMAND.format(recording=recording)),
        ranking=escape(_ranking(figures)),
        examples="\n".join(_example(figures, example) for example in examples),
        depth_scale=depth_scale(),
        stages_title=f"{_what(figures)} after every stage",
        stages_table=_stages_table(figures),
        axes_table=_axes_table(figures),
        charts=_charts(figures),
        settings=_settings(figures),
        method=escape(METHOD.format(against=AGAINST_REFERENCE if known else AGAINST_MEDIAN)),
        size=f"{recording_bytes / 1e6:.1f} MB",
        script=_resource("page.js"),
    )


def _resource(name: str) -> str:
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")


def _template(name: str) -> Template:
    return Template(_resource(name))


def _style(states: Sequence[State]) -> str:
    """The style sheet with the series' colours, which are those of the viewer."""
    palette = {_css(state): _color(state) for state in states}
    series = (
        f"svg .line.{css} {{ stroke: var(--{css}); }} svg .dot.{css}, .legend .{css} {{ fill: var(--{css}); "
        f"background: var(--{css}); }} svg .bar.{css} {{ fill: var(--{css}); stroke: var(--{css}); }}"
        for css in palette
    )
    return _template("page.css").substitute(
        colors=_variables({css: _darker(color) for css, color in palette.items()}),
        dark_colors=_variables(palette),
        series="\n".join(series),
    )


def _variables(palette: Mapping[str, Rgb]) -> str:
    return "\n".join(f"  --{css}: rgb{color};" for css, color in palette.items())


def _darker(color: Rgb) -> Rgb:
    red, green, blue = (round(ON_PAPER * channel) for channel in color)
    return red, green, blue


def _color(state: State) -> Rgb:
    return colors.INITIAL if state.number is None else colors.STAGES[state.number]


def _what(figures: Figures) -> str:
    """What the figures measure."""
    if figures.has_reference:
        return "Error"
    return "Distance from the result" if len(figures.run.frames) == 1 else "Distance from the frames’ median"


def _css(state: State) -> str:
    return "initial" if state.number is None else f"stage-{state.number}"


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
    else:
        change = figures.changes[example.position]
        result = f"changed by {_pair(change)}"
        result += "" if single else f", {_pair(after)} from the frames’ median"
    title = "" if single else f"<b>{example.name.capitalize()}:</b> "
    *lefts, right = example.pictures
    return f"""<figure>
<figcaption><span>{title}frame {frame.index} ({escape(frame.source)}), {result}</span>
{_choice(example, lefts)}</figcaption>
<div class="compare">
{_side("left", lefts[0], example.pictures[lefts[0]], frame.index)}
{_side("right", right, example.pictures[right], frame.index)}
<input type="range" min="0" max="100" value="50" step="any" aria-label="Boundary between {lefts[0]} and {right}">
<div class="handle"></div>
</div>
</figure>"""


def _choice(example: Example, lefts: Sequence[str]) -> str:
    """What to compare the corrected picture with, where there is more than one."""
    if len(lefts) < 2:
        return ""
    radios = (
        f'<label><input type="radio" name="{example.name}" value="{escape(example.pictures[left])}" '
        f'data-name="{left}"{" checked" if left == lefts[0] else ""}>{left}</label>'
        for left in lefts
    )
    return f'<span class="choice">Corrected against{"".join(radios)}</span>'


def _side(css: str, name: str, file: str, frame: int) -> str:
    return (
        f'<div class="side {css}"><img src="{escape(file)}" alt="Frame {frame} with the LiDAR points, {name}">'
        f'<span class="tag">{name}</span></div>'
    )


def _stages_table(figures: Figures) -> str:
    """Mean, median, standard deviation and p95 of both errors and, with a reference, the success rates."""
    statistics = ("mean", "median", "std", "p95")
    groups = ["<th></th>"]
    groups += [f'<th class="group" colspan="{len(statistics)}">{name}</th>' for name in ("Rotation", "Translation")]
    heads = ["<th>after</th>", *(f"<th>{name}</th>" for name in statistics * 2)]
    if figures.has_reference:
        groups.append('<th class="group" colspan="2">Frames within</th>')
        heads += ["<th>2° and 5 cm</th>", "<th>1° and 2.5 cm</th>"]
    rows = []
    for state in figures.states:
        metrics = state.metrics
        cells = [ROTATION.say(getattr(metrics.rotation_deg, name)) for name in statistics]
        cells += [TRANSLATION.say(getattr(metrics.translation_cm, name)) for name in statistics]
        if figures.has_reference:
            cells += [f"{share:.0%}" for share in (metrics.success_2deg_5cm, metrics.success_1deg_2_5cm)]
        rows.append(_row(state, cells))
    return _table([groups, heads], rows)


def _axes_table(figures: Figures) -> str:
    heads = ["<th>after</th>"]
    heads += [f"<th>{name}</th>" for name in ("roll", "pitch", "yaw", "x (right)", "y (down)", "z (ahead)")]
    rows = []
    for state in figures.states:
        rotation, translation = state.metrics.rotation_deg, state.metrics.translation_cm
        cells = [ROTATION.say(angle) for angle in (rotation.roll, rotation.pitch, rotation.yaw)]
        cells += [TRANSLATION.say(offset) for offset in (translation.x, translation.y, translation.z)]
        rows.append(_row(state, cells))
    return _table([heads], rows)


def _row(state: State, cells: Iterable[str]) -> str:
    trained_for = ""
    if state.range is not None:
        degrees, metres = state.range.split("/")
        trained_for = f' <span class="range">±{escape(degrees)}° / {escape(metres)} m</span>'
    return f"<th>{state.name}{trained_for}</th>" + "".join(f"<td>{cell}</td>" for cell in cells)


def _table(heads: Iterable[Iterable[str]], rows: Iterable[str]) -> str:
    head = "".join(f"<tr>{''.join(cells)}</tr>" for cells in heads)
    body = "".join(f"<tr>{row}</tr>" for row in rows)
    return f'<table class="figures"><thead>{head}</thead><tbody>{body}</tbody></table>'


def _charts(figures: Figures) -> str:
    """Curves over the frames and histograms; a single frame has neither."""
    if len(figures.run.frames) == 1:
        return ""
    what = _what(figures)
    ends = [figures.initial, figures.corrected] if figures.run.stages else [figures.initial]
    curves = [_curve(figures, quantity, what) for quantity in (ROTATION, TRANSLATION)]
    bars = [_bars(ends, quantity, what) for quantity in (ROTATION, TRANSLATION)]
    return (
        f"<section><h2>{what} over the frames</h2>{_legend(figures.states)}"
        f'<div class="two">{"".join(curves)}</div></section>'
        f"<section><h2>How the frames are distributed</h2>{_legend(ends)}"
        f'<div class="two">{"".join(bars)}</div></section>'
    )


def _curve(figures: Figures, quantity: Quantity, what: str) -> str:
    frames = [frame.index for frame in figures.run.frames]
    series = [_series(state, quantity) for state in figures.states]
    svg = line_chart(f"{quantity.name}: {what.lower()} over the frames", frames, series, quantity.axis, quantity.say)
    return f'<div class="chart"><h3>{quantity.name}</h3>{svg}</div>'


def _bars(states: Sequence[State], quantity: Quantity, what: str) -> str:
    series = [_series(state, quantity) for state in states]
    svg = histogram(f"{quantity.name}: how many frames have which {what.lower()}", series, quantity.axis)
    return f'<div class="chart"><h3>{quantity.name}</h3>{svg}</div>'


def _series(state: State, quantity: Quantity) -> Series:
    return Series(state.name, _css(state), state.rotation_deg if quantity is ROTATION else state.translation_cm)


def _legend(states: Sequence[State]) -> str:
    final = states[-1].number
    items = (
        f'<li><i class="{_css(state)}"></i>{state.name}{" = corrected" if final and state.number == final else ""}</li>'
        for state in states
    )
    return f'<ul class="legend">{"".join(items)}</ul>'


def _settings(figures: Figures) -> str:
    run = figures.run
    known = {**run.settings, **run.provenance}
    if known.get("frames") == ":":
        known["frames"] = "all"
    ordered = {name: known[name] for name in [*SETTING_NAMES, *known] if name in known}
    ordered |= {f"weights of stage {number}": _record(record) for number, record in run.weights.items()}
    return "\n".join(
        f"<tr><th>{escape(SETTING_NAMES.get(name, name))}</th><td>{escape(str(value))}</td></tr>"
        for name, value in ordered.items()
        if str(value)
    )


def _record(record: Mapping[str, Any]) -> str:
    """A training record in short; ``metrics.json`` has it whole."""
    parts = [
        f"{record[name]:,g} {name}" for name in ("minutes", "samples") if isinstance(record.get(name), int | float)
    ]
    data = (record.get("options") or {}).get("data")
    parts += [f"on {', '.join(map(str, data))}"] if data else []
    parts += [f"commit {record['commit']}"] if record.get("commit") else []
    return "; ".join(parts) or "no training record"
