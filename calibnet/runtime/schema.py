"""Checks values of a file against a dataclass with types and bounds, by pydantic."""

from __future__ import annotations

import json
from collections.abc import Hashable
from functools import lru_cache
from typing import TYPE_CHECKING, Any, TypeVar, cast

from calibnet.errors import CalibnetError
from calibnet.runtime.text import one_line

if TYPE_CHECKING:
    from pydantic import TypeAdapter

T = TypeVar("T")
MOST_SAID = 3
"""Largest number of invalid values named in a message."""


def validated(kind: type[T], values: Any, origin: str, error: type[CalibnetError], remedy: str) -> T:
    """Make an object of a type from values of JSON, TOML or YAML, without converting values of another type.

    Args:
        kind: a dataclass, ``TypedDict`` or other type, with bounds from `annotated_types`. A dataclass with
            ``__pydantic_config__ = {"extra": "forbid"}`` allows no other keys.
        values: values from the file.
        origin: begin of the message, which names the file.
        error: type of the error.
        remedy: end of the message.

    Raises:
        CalibnetError: of type ``error``; the message names the first invalid values and the reasons.
    """
    from pydantic import ValidationError
    from pydantic_core import PydanticSerializationError

    try:
        # as JSON, where lists become tuples if required, and numbers are never text
        return cast(T, _adapter(cast(Hashable, kind)).validate_json(json.dumps(values, default=str), strict=True))
    except ValidationError as problem:
        found = problem.errors(include_url=False, include_input=False)
        said = ", ".join(_in_words(one["type"], one["loc"], one["msg"]) for one in found[:MOST_SAID])
        more = f", and {len(found) - MOST_SAID} more" if len(found) > MOST_SAID else ""
        raise error(f"{origin}: {said}{more}; {remedy}.") from None
    except (ValueError, TypeError, RecursionError, PydanticSerializationError):
        raise error(f"{origin} cannot be read: it is nested too deeply or holds other than text; {remedy}.") from None


@lru_cache
def _adapter(kind: Hashable) -> TypeAdapter[Any]:
    from pydantic import TypeAdapter

    return TypeAdapter(cast(Any, kind))


def _in_words(kind: str, place: tuple[int | str, ...], message: str) -> str:
    key = one_line(".".join(map(str, place)), 80) or "it"
    if kind in ("missing", "unexpected_keyword_argument", "extra_forbidden"):
        return f"{key} is {'missing' if kind == 'missing' else 'unknown'}"
    said = one_line(message.rstrip("."), 200)
    return f"{key}: {said[:1].lower()}{said[1:]}"
