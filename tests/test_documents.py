"""The documents: README stays short, and what they point at exists."""

from __future__ import annotations

import itertools
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

from calibnet.geometry import RANGES
from calibnet.weights import read_record, weights_path
from inspector.cli.main import cli

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


def commands(text: str) -> Iterator[list[str]]:
    """The words of every `calib-inspect` in the shell blocks of a document; ``…`` and ``[OPTION]`` stand for more."""
    for block in re.findall(r"^ *```sh$(.*?)^ *```$", text, flags=re.MULTILINE | re.DOTALL):
        for line in block.replace("\\\n", " ").splitlines():
            try:
                words = shlex.split(line, comments=True)
            except ValueError:  # of a language with quotes over several lines
                continue
            starts = [place for place, word in enumerate(words) if word.endswith("calib-inspect")]
            for start, end in itertools.pairwise([*starts, len(words)]):
                one = words[start + 1 : end]
                stop = next(
                    (place for place, word in enumerate(one) if word in ("&&", "|", ">", ";", "…", "...")), len(one)
                )
                if one[:stop] and "…" not in line:
                    yield one[:stop]


def parsed(words: list[str]) -> click.Command:
    """The command that some words name, which takes all of them; raises what click says otherwise."""
    group: click.Command = cli
    while isinstance(group, click.Group):
        command = group.get_command(click.Context(group), words[0])
        if command is None:
            raise click.UsageError(f"there is no command {words[0]!r}")
        group, words = command, words[1:]
    group.make_context("calib-inspect", list(words))
    return group


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_commands_are_taken_as_printed(document: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    wrong = []
    for words in commands(document.read_text(encoding="utf-8")):
        try:
            parsed(words)
        except click.UsageError as error:
            if "does not exist" not in error.format_message():  # a file of the reader's
                wrong.append(f"{' '.join(words)}: {error.format_message()}")
        except click.exceptions.Exit:
            continue
    assert not wrong


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
