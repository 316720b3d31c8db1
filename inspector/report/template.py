"""The base of all pages, and the common parts of reports of runs and rigs: verdict, files, pictures under a slider."""

from __future__ import annotations

import re
from collections.abc import Sequence
from html import escape
from importlib import resources
from string import Template
from typing import NamedTuple

from calibnet.verdict import Word
from inspector.report.charts import series_styles
from inspector.report.metrics import State
from inspector.report.pictures import depth_scale
from inspector.report.verdict import GRADES

SERVE_COMMAND = "calib-inspect report {recording} --output . --open"


class Head(NamedTuple):
    """The head of a report.

    Attributes:
        title: title of the page.
        kind: kind of report.
        word: of the verdict, which it is coloured by.
        verdict: the word, and what the result is certain to be within.
        reasons: reasons of the verdict, as HTML items.
        headline: the result in a sentence.
        findings: further findings, as HTML.
        about: subject of the report.
        metrics: content of ``metrics.json``, in words.
    """

    title: str
    kind: str
    word: Word
    verdict: str
    reasons: str
    headline: str
    findings: str
    about: str
    metrics: str


class Side(NamedTuple):
    """A picture under the slider: its file, its name, and its alternative text."""

    file: str
    name: str
    alt: str


def report_page(head: Head, sections: str, recording: str, recording_bytes: int, states: Sequence[State] = ()) -> str:
    """The HTML of a report.

    Args:
        head: head of the report.
        sections: sections as HTML, of which the last is left open for the list of files.
        recording: name of the recording beside the page.
        recording_bytes: size of the recording.
        states: states whose curves have colours.
    """
    header = template("report.html").substitute(
        grade=GRADES[head.word],
        word=escape(head.verdict),
        reasons=head.reasons,
        headline=escape(head.headline),
        findings=head.findings,
        about=escape(head.about),
        recording=escape(recording),
        serve_command=escape(SERVE_COMMAND.format(recording=recording)),
    )
    files = template("files.html").substitute(
        recording=escape(recording), size=f"{recording_bytes / 1e6:.1f} MB", metrics=escape(head.metrics)
    )
    return html_page(head.title, head.kind, header, sections + files, stylesheet(states), _resource("page.js"))


def html_page(title: str, kind: str, header: str, sections: str, style: str, script: str = "") -> str:
    """A whole HTML page that needs no other files than those that it shows.

    Args:
        title: title of the browser's tab.
        kind: kind of page, shown above the header.
        header: header as HTML.
        sections: sections as HTML.
        style: CSS, see `stylesheet`.
        script: JavaScript.
    """
    return template("page.html").substitute(
        title=escape(title),
        kind=escape(kind),
        header=header.strip(),
        sections=sections.strip(),
        style=style.strip(),
        script=f"<script>\n{script.strip()}\n</script>" if script else "",
    )


def figure(caption: str, left: Side, right: Side) -> str:
    """Two pictures with a slider between them.

    Args:
        caption: caption as HTML.
        left: picture of the state before.
        right: picture of the result.
    """
    return f"""<figure>
<figcaption>{caption}</figcaption>
<div class="compare">
{_side("left", left)}
{_side("right", right)}
<input type="range" min="0" max="100" value="50" step="any" aria-label="Boundary between {left.name} and {right.name}">
<div class="handle"></div>
</div>
</figure>"""


def with_code(sentence: str) -> str:
    """A sentence as HTML, with what stands between backticks as code."""
    return re.sub("`(.+?)`", r"<code>\1</code>", escape(sentence))


def scale_of_depth() -> str:
    """The colour scale of depth, with its label."""
    return f'<div class="depth"><span>Depth</span>{depth_scale()}</div>'


def stylesheet(states: Sequence[State] = ()) -> str:
    """The style sheet of a page, with the colours of the curves of some states."""
    return template("page.css").substitute(series_styles(states))


def template(name: str) -> Template:
    """A template of this package."""
    return Template(_resource(name))


def _side(css: str, side: Side) -> str:
    return (
        f'<div class="side {css}"><img src="{escape(side.file)}" alt="{escape(side.alt)}">'
        f'<span class="tag">{escape(side.name)}</span></div>'
    )


def _resource(name: str) -> str:
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
