"""JSON of unknown origin: a strict subset of RFC 8259, within limits far beyond any file of mpucal.

Refused are numbers that are not finite or have more digits than a double or a 64-bit integer, duplicate keys, strings
with control characters or lone surrogates, deep nesting, and long documents.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from functools import partial
from typing import Any

MOST_BYTES = 16 << 20
DEEPEST = 32
LONGEST_STRING = 1 << 16
MOST_DIGITS = 40
LARGEST_INTEGER = 1 << 64
# its square is finite
LARGEST = 1e150
# characters that control a terminal, and lone surrogates
FORBIDDEN = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")


def parse_json(data: bytes | str) -> Any:
    """Return the document.

    Raises
    ------
    ValueError : it is not JSON, or exceeds a limit; the message says which.
    """
    parse = partial(
        json.loads, parse_constant=_not_finite, parse_int=_integer, parse_float=_number, object_pairs_hook=_object
    )
    return _parse_checked(data, parse, _check_string)


def parse_own_json(data: bytes | str) -> Any:
    """Return a document in a capture, written by Python's json; it may hold infinities, NaN and any string.

    Raises
    ------
    ValueError : it is not JSON, too long or too deep.
    """
    return _parse_checked(data, json.loads, lambda text: None)


def _parse_checked(data: bytes | str, parse: Callable[[bytes | str], Any], check_string: Callable[[str], None]) -> Any:
    if len(data) > MOST_BYTES:
        raise ValueError(f"{len(data)} bytes are more than {MOST_BYTES}")
    try:
        document = parse(data)
    except UnicodeDecodeError:
        raise ValueError("it is not text") from None
    except json.JSONDecodeError as error:
        raise ValueError(f"it is not JSON: {error}") from None
    except RecursionError:
        raise _too_deep() from None
    level = [document]
    # level by level, without recursion
    for _ in range(DEEPEST):
        inner: list[Any] = []
        for value in level:
            if isinstance(value, dict):
                inner += [*value, *value.values()]
            elif isinstance(value, list):
                inner += value
            elif isinstance(value, str):
                check_string(value)
        level = inner
        if not level:
            return document
    raise _too_deep()


def _check_string(text: str) -> None:
    if len(text) > LONGEST_STRING:
        raise ValueError(f"a string of {len(text)} characters is longer than {LONGEST_STRING}")
    if (found := FORBIDDEN.search(text)) is not None:
        raise ValueError(f"a string holds the character {found[0]!a}")


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    document = dict(pairs)
    if len(document) != len(pairs):
        raise ValueError("a key occurs twice in one object")
    return document


def _integer(digits: str) -> int:
    if len(digits) > MOST_DIGITS or abs(int(digits)) > LARGEST_INTEGER:
        raise ValueError(f"an integer of {len(digits)} digits is too large")
    return int(digits)


def _number(digits: str) -> float:
    value = float(digits) if len(digits) <= LONGEST_STRING else math.inf
    if abs(value) > LARGEST:
        raise ValueError("a number is too large")
    return value


def _not_finite(name: str) -> float:
    raise ValueError(f"{name} is not a number")


def _too_deep() -> ValueError:
    return ValueError(f"it is nested deeper than {DEEPEST} levels")
