"""The documents: README stays short, and what they point at exists."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from calibnet.geometry import RANGES
from calibnet.weights import read_record, weights_path

ROOT = Path(__file__).resolve().parents[1]
ARCHIVE = ROOT / "docs" / "archive"
"""Logs as they were written, with the names of their time."""
DOCUMENTS = [
    path
    for path in sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("[!.]*/README.md")])
    if not path.is_relative_to(ARCHIVE)
]
ALL_DOCUMENTS = [*DOCUMENTS, *sorted(ARCHIVE.glob("*.md"))]

LINK = re.compile(r"\]\(([^)\s]+)\)")
CODE = re.compile(r"`([^`\s]+)`")
FENCED = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)
TOP_LEVEL = ("calibnet", "inspector", "tests", "docs", "examples", "recordings", ".ci")
MADE_BY_A_RUN = ("recordings/demo.rrd",)
PATTERN_CHARACTERS = set("*{}<>…")


def links(text: str) -> Iterator[str]:
    """Targets of the links and pictures of a document that are not on the web."""
    for target in LINK.findall(FENCED.sub("", text)):
        if not re.match(r"[a-z]+:", target):
            yield target


def anchors(text: str) -> set[str]:
    """What GitHub makes of a document's headings."""
    headings = re.findall(r"^#+ (.*)$", FENCED.sub("", text), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def broken_links(document: Path) -> list[str]:
    """Targets of a document's links that are not there."""
    text, broken = document.read_text(encoding="utf-8"), []
    for target in links(text):
        name, _, anchor = target.partition("#")
        file = (document.parent / name).resolve() if name else document
        if not file.exists() or (anchor and anchor not in anchors(file.read_text(encoding="utf-8"))):
            broken.append(target)
    return broken


def named_paths(text: str) -> Iterator[str]:
    """Paths of the repository that a text names in backticks."""
    for name in CODE.findall(text):
        if name.split("/")[0] in TOP_LEVEL and "/" in name and not PATTERN_CHARACTERS & set(name):
            yield name


def missing_paths(text: str) -> list[str]:
    """Those that are not there."""
    return [name for name in named_paths(text) if name not in MADE_BY_A_RUN and not (ROOT / name).exists()]


def test_the_readme_is_read_in_five_minutes() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").split()) < 1000  # as `wc -w` counts


@pytest.mark.parametrize("document", ALL_DOCUMENTS, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(document: Path) -> None:
    assert broken_links(document) == []


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_files_that_are_named_exist(document: Path) -> None:
    assert missing_paths(document.read_text(encoding="utf-8")) == []


def test_documents_that_the_code_cites_exist() -> None:
    cited = {
        (path.relative_to(ROOT).as_posix(), name)
        for package in ("calibnet", "inspector")
        for path in (ROOT / package).rglob("*.py")
        for name in re.findall(r"[\w./-]+\.md\b", path.read_text(encoding="utf-8"))
    }
    assert {(path, name) for path, name in cited if not (ROOT / name).is_file()} == set()


def test_every_document_is_reached_from_the_readme() -> None:
    reached, todo = set(), [ROOT / "README.md"]
    while todo:
        document = todo.pop()
        if document in reached or document.suffix != ".md":
            continue
        reached.add(document)
        targets = (target.partition("#")[0] for target in links(document.read_text(encoding="utf-8")))
        todo += [(document.parent / target).resolve() for target in targets if target]
    assert {path for path in ALL_DOCUMENTS if path.is_relative_to(ROOT / "docs")} <= reached


def test_pictures_are_used_and_small() -> None:
    used = {
        (document.parent / target).resolve()
        for document in ALL_DOCUMENTS
        for target in links(document.read_text(encoding="utf-8"))
    }
    pictures = set((ROOT / "docs" / "pictures").iterdir())
    assert pictures <= used
    assert max(picture.stat().st_size for picture in pictures) < 1_500_000


@pytest.mark.parametrize("number", range(1, len(RANGES) + 1))
def test_the_row_of_a_stage_says_what_its_weights_say(number: int) -> None:
    text = (ROOT / "docs" / "weights.md").read_text(encoding="utf-8")
    (row,) = re.findall(rf"^\| {number} \|.*$", text, flags=re.MULTILINE)
    record = read_record(weights_path("compact", RANGES[number - 1]))
    found = record["validation"]
    assert f"| {record['samples']:,} |" in row
    assert (
        f"| {found['initial_rotation_deg']:.2f}° → {found['rotation_deg']:.2f}° ({found['rotation_p95_deg']:.2f}°), "
        f"{found['initial_translation_cm']:.0f} → {found['translation_cm']:.0f} cm |"
    ) in row


def test_the_checks_see_what_is_wrong(tmp_path: Path) -> None:
    document = tmp_path / "a.md"
    document.write_text(
        "# Über `x`: y\n[a](#über-x-y) [b](gone.md) [c](a.md#no) [d](https://x.y/z)\n```\n[e](f)\n```\n"
    )
    assert broken_links(document) == ["gone.md", "a.md#no"]
    text = "`calibnet/gone.py` `calibnet/errors.py` `images/` `inspector/*.py` `recordings/demo.rrd`"
    assert missing_paths(text) == ["calibnet/gone.py"]
