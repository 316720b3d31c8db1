"""What ``import inspector`` gives by name."""

from __future__ import annotations

from pathlib import Path

import pytest

import inspector


def test_every_name_is_there() -> None:
    assert inspector.__all__ == ["Coloring", "Contents", "Detail", "Part", "blueprint", "log_trace"]
    for name in inspector.__all__:
        assert getattr(inspector, name).__name__ == name
    assert set(inspector.__all__) <= set(dir(inspector))


def test_type_checkers_see_the_same_names() -> None:
    source = Path(inspector.__file__).read_text(encoding="utf-8")
    seen = {line.split()[-1] for line in source.splitlines() if line.startswith("    from inspector.")}
    assert seen == set(inspector.__all__)


def test_a_name_that_is_not_there_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="log_traces"):
        _ = inspector.log_traces  # type: ignore[attr-defined]
