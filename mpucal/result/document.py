"""calibration.json: written, read and checked by the table of its keys (keys.py), and protected by a digest.

The digest is "sha256:" and the hexadecimal SHA-256 of the document without `digest` and `created`, as JSON with sorted
keys, without blanks, in ASCII, and with every number as Python's repr of the double: the shortest decimal digits that
give it again. Without `created`, a replayed session has the digest of the original.

The validator knows the keywords of calibration.schema.json: type, const, enum, pattern, required, properties,
additionalProperties, items, minItems and maxItems of JSON Schema 2020-12; unknown keys of a document are accepted.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
import reprlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, fields, is_dataclass
from datetime import datetime
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import LARGEST, LEAST_GRAVITY_MPS2, MOST_GRAVITY_MPS2
from ..data import Sensor, Vector
from .blob import is_invertible
from .correlation import KEY, LOWER, from_lower
from .keys import ACCELEROMETER_FORMULA, ARRAYS, FORMAT, GYROSCOPE_FORMULA, VERSION, Extra

# written if b_a(T) is known
TEMPERATURE = ("b_a_slope", "b_a_slope_std", "temperature_range_c")
# fromisoformat would accept any character between date and time
DATE = re.compile(r"[0-9]{4}-[0-9]{2}-[0-9]{2}([T ][0-9:]{5,8}([.,][0-9]{1,9})?(Z|[+-][0-9:]{2,8})?)?")
DIGEST, CREATED, HARDWARE = "digest", "created", "applied_in_hardware"
# top-level keys that are kept unchanged
EXTRA = tuple(Extra.__annotations__)


def to_document(fields: Mapping[str, Any], follows_temperature: bool) -> dict[str, Any]:
    """Return the content of calibration.json from a Calibration's fields by name; NaN becomes None."""
    left_out = () if follows_temperature else TEMPERATURE
    values = {
        "format": FORMAT,
        "version": VERSION,
        "created": fields["created"],
        "accelerometer": {**_written(fields, "accelerometer", left_out), "formula": ACCELEROMETER_FORMULA},
        "gyroscope": {**_written(fields, "gyroscope"), "formula": GYROSCOPE_FORMULA},
        "fit": fields["fit"],
        "quality": fields["quality"],
        "sensor": asdict(fields["sensor"]),
        "applied_in_hardware": _written(fields, "applied_in_hardware"),
        **({KEY: below} if (below := fields[KEY][LOWER]).any() else {}),
        **fields["extra"],
    }
    return {key: plain(value) for key, value in values.items()}


def from_document(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments of a Calibration; unknown keys are ignored, missing ones get its defaults.

    Raises
    ------
    ValueError : the document, or one in `others`, does not satisfy its schema, or holds numbers that cannot be used.
    """
    if not isinstance(document, Mapping):
        raise ValueError(f"it is a {type(document).__name__}, not an object")
    if document.get("format") != FORMAT:
        has = reprlib.repr(document["format"]) if "format" in document else "missing"
        raise ValueError(f'"format" is {has}, not {FORMAT!r}')
    version = document.get("version", VERSION)
    if isinstance(version, int) and version > VERSION:
        raise ValueError(f"version {version} is newer than {VERSION}")
    check_document({"version": VERSION, **document})
    for one in (document, *document.get("others", ())):
        _check_numbers(one)
    return {
        "D": np.full((3, 3), np.nan),
        "b_a": np.full(3, np.nan),
        **_arrays(document),
        **({KEY: from_lower(_array(document[KEY], LOWER[0].shape))} if KEY in document else {}),
        "fit": document.get("fit", {}),
        "quality": document.get("quality", {}),
        "sensor": Sensor.of(document.get("sensor", {})),
        "created": _date(document.get("created", "")),
        "extra": {key: document[key] for key in EXTRA if key in document},
    }


def digest(document: Mapping[str, Any]) -> str:
    """Return the digest of a document, regardless of its own `digest`."""
    text = json.dumps(
        _doubles({key: value for key, value in document.items() if key not in (DIGEST, CREATED)}),
        sort_keys=True,
        separators=(",", ":"),
    )
    return f"sha256:{hashlib.sha256(text.encode()).hexdigest()}"


def digest_warning(document: Mapping[str, Any]) -> str:
    """Return why a document's numbers may not be those that were saved; empty if its digest matches."""
    held = document.get(DIGEST)
    if held is None:
        return "it has no digest, so damage to a number in it cannot be noticed"
    return "" if held == digest(document) else "its digest does not match: it was changed or damaged after it was saved"


def _doubles(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _doubles(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_doubles(item) for item in value]
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value


def drop_unserialisable(fields: Mapping[str, Any]) -> dict[str, Vector]:
    """Return a Calibration's arrays by name, with NaN for numbers and matrices that a reader refuses."""
    arrays = {
        name: np.where(np.abs(fields[name]) <= LARGEST, fields[name], np.nan)
        for part, _, name, _ in ARRAYS
        if part != HARDWARE and name not in TEMPERATURE
    }
    return {name: array if _is_usable(name, array) else np.full_like(array, np.nan) for name, array in arrays.items()}


def _is_usable(name: str, array: Vector) -> bool:
    """Return False for a matrix that must be inverted and cannot be; a wholly unknown one is usable."""
    if name not in ("D", "K") or np.isnan(array).all():
        return True
    return is_invertible(array.ravel().tolist())


def _check_numbers(document: Mapping[str, Any]) -> None:
    if np.nanmax(np.abs(np.array(document.get(KEY, ()), float)), initial=0.0) > 1.0:
        raise ValueError(f"{KEY} holds a number beyond 1")
    arrays = _arrays(document)
    for name, array in arrays.items():
        # no sensor has larger numbers, and products of these are finite
        if np.nanmax(np.abs(array), initial=0.0) > LARGEST:
            raise ValueError(f"{name} holds a number beyond {LARGEST:g}")
        if name.endswith("_std") and np.nanmin(array, initial=0.0) < 0.0:
            raise ValueError(f"{name} holds a standard deviation below 0")
        if not _is_usable(name, array):
            raise ValueError(f"{name} cannot be inverted")
    if np.isnan(arrays.get(HARDWARE, 0.0)).any():
        raise ValueError(f"{HARDWARE} holds null")
    gravity = document.get("fit", {}).get("gravity")
    if gravity is not None and not LEAST_GRAVITY_MPS2 <= gravity <= MOST_GRAVITY_MPS2:
        raise ValueError(f"fit.gravity is {gravity:g} m/s^2")
    # b_a(T) is a line through b_a at a sensor temperature within its range
    if np.any(slope := arrays.get("b_a_slope", 0.0)):
        T = document.get("sensor", {}).get("temperature_c")
        low, high = arrays.get("temperature_range_c", (np.nan, np.nan))
        if T is None or not (low <= T <= high and np.isfinite(slope).all()):
            raise ValueError("b_a_slope is given without its temperatures")


def _written(fields: Mapping[str, Any], part: str, left_out: Sequence[str] = ()) -> dict[str, Vector]:
    """Return the arrays of an object of the document from a Calibration's fields by name."""
    return {row.key: fields[row.attribute] for row in ARRAYS if row.part == part and row.key not in left_out}


def _arrays(document: Mapping[str, Any]) -> dict[str, Vector]:
    """Return the arrays that a document holds, by their names in a Calibration."""
    return {
        attribute: _array(document[part][key], shape)
        for part, key, attribute, shape in ARRAYS
        if document.get(part, {}).get(key) is not None
    }


def _date(text: str) -> str:
    """Return a time of ISO 8601, or "" if it is unknown."""
    if text:
        if not DATE.fullmatch(text):
            raise ValueError(f"created is {reprlib.repr(text)}, which is not an ISO 8601 time")
        datetime.fromisoformat(text)
    return text


def _array(values: Any, shape: tuple[int, ...]) -> Vector:
    array = np.array(values, dtype=np.float64)  # None becomes NaN
    if array.shape != shape:
        raise ValueError(f"an array has the shape {array.shape}, not {shape}")
    return array


def plain(value: Any) -> Any:
    """Return a value of JSON types: a dataclass or named tuple as its fields, NaN and infinities as None."""
    if value is None or isinstance(value, str | int):
        return value
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if is_dataclass(value):
        value = {field.name: getattr(value, field.name) for field in fields(value)}
    elif hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return plain(value.tolist()) if isinstance(value, np.ndarray | np.generic) else value


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
