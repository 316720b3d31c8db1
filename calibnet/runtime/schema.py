"""Values of a file held against what they have to be: a dataclass with types and bounds, checked by pydantic."""

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
"""Values that are named of those that are wrong."""


def validated(kind: type[T], values: Any, origin: str, error: type[CalibnetError], remedy: str) -> T:
    """An object of a type, made from what JSON, TOML or YAML says; nothing is converted that is not what it should be.

    Args:
        kind: a dataclass, ``TypedDict`` or other type; bounds are those of `annotated_types`. A dataclass with
            ``__pydantic_config__ = {"extra": "forbid"}`` has no other keys.
        values: what the file says.
        origin: begins the sentence: what file this is.
        error: type of the error.
        remedy: ends the sentence.

    Raises:
        CalibnetError: of type ``error``; the sentence names the first values that are wrong, and why.
    """
    from pydantic import ValidationError
    from pydantic_core import PydanticSerializationError

    try:
        # as JSON: its lists are tuples where those are asked for, and its numbers are never texts
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
