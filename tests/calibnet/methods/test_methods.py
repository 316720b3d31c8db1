"""Every method keeps to the interface; one of another package is a method like ours."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from calibnet.calibrator import DriveCalibrator
from calibnet.conformance import check_method
from calibnet.geometry import RANGES
from calibnet.methods.learned.networks import NETWORKS
from calibnet.methods.registry import METHODS, open_method
from tests.calibnet.cascade.test_cascade import cascade
from tests.support.boxes import boxes
from tests.support.methods import save_random
from tests.support.scene import make_frame
from tests.support.toy_package import install_toys


@pytest.fixture
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Searches that are as short as their promises allow."""
    monkeypatch.setattr("calibnet.methods.information_distance.STARTS", 2)
    monkeypatch.setattr("calibnet.methods.calib_anything.method.ROUNDS", ((1.0, 1.0, 20),))


@pytest.mark.usefixtures("_quick")
@pytest.mark.parametrize("name", [name for name in METHODS.own if name != "pcba"])  # in test_pcba.py: it needs a drive
def test_methods_keep_their_promises(name: str, tmp_path: Path) -> None:
    if name in NETWORKS:
        save_random(name, RANGES[4], tmp_path)
        check_method(open_method(name, RANGES[4], weights=tmp_path), boxes())
    else:
        check_method(open_method(name, RANGES[4]), boxes())


def test_the_cascade_keeps_them_too_and_those_of_drives() -> None:
    ours = cascade((4, 5))
    assert isinstance(ours, DriveCalibrator)
    check_method(ours, make_frame())


def test_a_method_of_another_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install_toys(tmp_path, monkeypatch)
    method = open_method("nothing", RANGES[2])
    assert not isinstance(method, DriveCalibrator)
    check_method(method, boxes())


def test_the_method_that_the_documents_show_is_one() -> None:
    document = (Path(__file__).parents[3] / "docs/methods.md").read_text(encoding="utf-8")
    code = document.split("```python\n")[1].split("```")[0]
    space: dict[str, Any] = {}
    exec(code, space)
    check_method(space["BestOfFifty"](RANGES[4]), boxes())
