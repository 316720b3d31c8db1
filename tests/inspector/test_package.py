"""What `import inspector` gives by name, without loading it."""

from __future__ import annotations

import pytest

import inspector


def test_every_name_is_there_and_listed() -> None:
    assert inspector.__all__ == ["Coloring", "Contents", "Detail", "Part", "blueprint", "log_trace"]
    assert set(inspector.__all__) <= set(dir(inspector))
    assert all(getattr(inspector, name).__name__ == name for name in inspector.__all__)


def test_other_names_are_not() -> None:
    with pytest.raises(AttributeError, match="'inspector' has no attribute 'log_traces'"):
        inspector.log_traces  # noqa: B018
