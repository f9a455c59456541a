"""Validator of calibration.json by its published schema (calibration.schema.json), for the keywords used there.

These are type, const, enum, pattern, required, properties, additionalProperties, items, minItems
and maxItems of JSON Schema 2020-12; unknown keys of a document are accepted.
"""

from __future__ import annotations

import json
import re
import reprlib
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

_IS: Mapping[str, Callable[[Any], bool]] = {
    "object": lambda value: isinstance(value, Mapping),
    "array": lambda value: isinstance(value, list),
    "string": lambda value: isinstance(value, str),
    "boolean": lambda value: isinstance(value, bool),
    "null": lambda value: value is None,
    "number": lambda value: isinstance(value, int | float) and not isinstance(value, bool),
    "integer": lambda value: isinstance(value, int) and not isinstance(value, bool),
}


def check_document(document: Any) -> None:
    """Check a document, and those of a vehicle's further IMUs in it, by the schema.

    Raises
    ------
    ValueError : the first violation, with its path.
    """
    schema = _schema()
    _check(document, schema, "it")
    for number, other in enumerate(document.get("others", ())):
        _check(other, schema, f"others[{number}]")


@cache
def _schema() -> Any:
    return json.loads(Path(__file__).with_name("calibration.schema.json").read_bytes())


def _check(value: Any, schema: Mapping[str, Any], where: str) -> None:
    kinds = schema.get("type", ())
    kinds = [kinds] if isinstance(kinds, str) else kinds
    if kinds and not any(_IS[kind](value) for kind in kinds):
        raise _wrong(where, value, f"not of type {' or '.join(kinds)}")
    if "const" in schema and value != schema["const"]:
        raise _wrong(where, value, f"not {schema['const']!r}")
    if value not in schema.get("enum", [value]):
        raise _wrong(where, value, f"not one of {', '.join(map(str, schema['enum']))}")
    if isinstance(value, str) and not re.search(schema.get("pattern", ""), value):
        raise _wrong(where, value, f"not of the form {schema['pattern']}")
    if isinstance(value, Mapping):
        _check_object(value, schema, where)
    elif isinstance(value, list):
        if not schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", len(value)):
            raise _wrong(where, value, f"{len(value)} values long, not {schema['minItems']}")
        for at, item in enumerate(value):
            _check(item, schema.get("items", {}), f"{where}[{at}]")


def _check_object(value: Mapping[str, Any], schema: Mapping[str, Any], where: str) -> None:
    known = schema.get("properties", {})
    for key in schema.get("required", ()):
        if key not in value:
            raise ValueError(f"{where} has no {key!r}")
    for key, item in value.items():
        of_item = known.get(key, schema.get("additionalProperties", {}))
        _check(item, of_item, key if where == "it" else f"{where}.{key}")


def _wrong(where: str, value: Any, what: str) -> ValueError:
    return ValueError(f"{where} is {reprlib.repr(value)}, {what}")
