"""Every export format keeps its promises; one of another package is a format like ours."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calibnet.errors import ConfigError
from inspector.export.conformance import check_export_format, example
from inspector.export.exported import Exported
from inspector.export.formats import as_json
from inspector.export.registry import FORMATS, export_as
from tests.support.toy_package import install_toys


@pytest.mark.parametrize("name", FORMATS.own)
def test_formats_keep_their_promises(name: str) -> None:
    check_export_format(FORMATS.load(name))


@pytest.mark.parametrize(
    ("write", "sentence"),
    [
        (lambda exported: as_json(exported).encode(), "returns bytes instead of text"),
        (lambda exported: as_json(exported).strip(), "line break"),
        (lambda exported: as_json(replace(exported, origin="me")), "where the calibration comes from"),
        (lambda exported: f"{np.round(exported.camera_from_lidar, 3)} {exported.origin}\n", "show a change"),
    ],
)
def test_what_a_format_does_wrong_is_named(write: Callable[[Exported], str], sentence: str) -> None:
    with pytest.raises(AssertionError, match=sentence):
        check_export_format(write)


def test_a_format_of_another_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install_toys(tmp_path, monkeypatch)
    assert FORMATS.names() == ("kitti", "ros", "opencv", "json", "yaml", "urdf", "autoware", "koide3", "broken", "csv")
    check_export_format(FORMATS.load("csv"))
    assert export_as("csv", example()).startswith(repr(float(example().camera_from_lidar[0, 0])))
    with pytest.raises(ConfigError, match="export format 'broken' of package broken_package cannot be imported"):
        export_as("broken", example())
