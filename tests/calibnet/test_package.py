"""What ``import calibnet`` gives by name."""

from __future__ import annotations

from pathlib import Path

import pytest

import calibnet


def test_every_name_is_there() -> None:
    for name in calibnet.__all__:
        assert getattr(calibnet, name).__name__ == name
    assert {*calibnet.__all__, "__version__"} <= set(dir(calibnet))


def test_type_checkers_see_the_same_names() -> None:
    source = Path(calibnet.__file__).read_text(encoding="utf-8")
    seen = {line.split()[-1] for line in source.splitlines() if line.startswith("    from calibnet.")}
    assert seen == set(calibnet.__all__)


def test_a_name_that_is_not_there_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="Cascadee"):
        _ = calibnet.Cascadee  # type: ignore[attr-defined]
