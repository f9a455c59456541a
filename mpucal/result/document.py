"""calibration.json: written and read by one table of keys, checked, and protected by a digest.

The digest is "sha256:" and the hexadecimal SHA-256 of the document without `digest` and `created`, as JSON with sorted
keys, without blanks, in ASCII, and with every number as Python's repr of the double: the shortest decimal digits that
give it again. Without `created`, a replayed session has the digest of the original.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
import reprlib
from collections.abc import Mapping
from dataclasses import asdict
from datetime import datetime
from typing import Any

import numpy as np

from ..arguments import LARGEST, LEAST_GRAVITY_MPS2, MOST_GRAVITY_MPS2
from ..data import Sensor, Vector
from .correlation import KEY, LOWER, from_lower
from .schema import check_document

FORMAT, VERSION = "mpucal.calibration", 1
# (key, attribute of a Calibration, shape) of each object
ACCELEROMETER = (
    ("D", "D", (3, 3)),
    ("b_a", "b_a", (3,)),
    ("D_std", "D_std", (3, 3)),
    ("b_a_std", "b_a_std", (3,)),
    ("noise_std", "noise_std", (3,)),
)
# written if b_a(T) is known
TEMPERATURE = (
    ("b_a_slope", "b_a_slope", (3,)),
    ("b_a_slope_std", "b_a_slope_std", (3,)),
    ("temperature_range_c", "temperature_range_c", (2,)),
)
GYROSCOPE = (
    ("K", "K", (3, 3)),
    ("b_omega", "b_omega", (3,)),
    ("K_std", "K_std", (3, 3)),
    ("b_omega_std", "b_omega_std", (3,)),
    ("noise_std", "gyro_noise_std", (3,)),
)
HARDWARE = (("b_a", "applied_in_hardware", (3,)),)
_NUMBERS = ACCELEROMETER + GYROSCOPE
# the largest condition number of a matrix near the identity
WORST_CONDITION = 1e9
ACCELEROMETER_FORMULA = "a = inv(D) @ (y - b_a)"
GYROSCOPE_FORMULA = "w = K @ (y - b_omega)"
# fromisoformat would accept any character between date and time
DATE = re.compile(r"[0-9]{4}-[0-9]{2}-[0-9]{2}([T ][0-9:]{5,8}([.,][0-9]{1,9})?(Z|[+-][0-9:]{2,8})?)?")
DIGEST, CREATED = "digest", "created"
# top-level keys that are kept unchanged
EXTRA = ("name", "autopilot", "others", "written", "merged", "updated_from", "noise")


def to_document(fields: Mapping[str, Any], follows_temperature: bool) -> dict[str, Any]:
    """Return the content of calibration.json from a Calibration's fields by name; NaN becomes None."""
    values = {
        "format": FORMAT,
        "version": VERSION,
        "created": fields["created"],
        "accelerometer": {
            **_select(fields, ACCELEROMETER),
            "formula": ACCELEROMETER_FORMULA,
            **_select(fields, TEMPERATURE if follows_temperature else ()),
        },
        "gyroscope": {**_select(fields, GYROSCOPE), "formula": GYROSCOPE_FORMULA},
        "fit": fields["fit"],
        "quality": fields["quality"],
        "sensor": asdict(fields["sensor"]),
        "applied_in_hardware": {"b_a": fields["applied_in_hardware"]},
        **({KEY: below} if (below := fields[KEY][LOWER]).any() else {}),
        **fields["extra"],
    }
    return {key: _plain(value) for key, value in values.items()}


def _check_format(document: Mapping[str, Any]) -> None:
    if document.get("format") != FORMAT:
        raise ValueError(f'"format" is {reprlib.repr(document.get("format"))}, not {FORMAT!r}')
    version = document.get("version", VERSION)
    if isinstance(version, int) and version > VERSION:
        raise ValueError(f"version {version} is newer than {VERSION}")


def from_document(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments of a Calibration; unknown keys are ignored, missing ones get its defaults.

    Raises
    ------
    ValueError, KeyError, TypeError, AttributeError : it is not such a document.
    """
    _check_format(document)
    acc = document["accelerometer"]
    for key in ("D", "b_a"):
        if key not in acc:
            raise KeyError(key)
    return {
        "D": np.full((3, 3), np.nan),
        "b_a": np.full(3, np.nan),
        **_read(acc, ACCELEROMETER + TEMPERATURE),
        **_read(document.get("gyroscope", {}), GYROSCOPE),
        **_read(document.get("applied_in_hardware", {}), HARDWARE),
        **({KEY: from_lower(_array(document[KEY], LOWER[0].shape))} if KEY in document else {}),
        "fit": dict(document.get("fit", {})),
        "quality": dict(document.get("quality", {})),
        "sensor": Sensor.of(document.get("sensor", {})),
        "created": _date(document.get("created") or ""),
        "extra": {key: document[key] for key in EXTRA if key in document},
    }


def check(document: Any) -> dict[str, Any]:
    """Return a document from a file if it satisfies its schema and D and K can be inverted, also those in `others`.

    Raises
    ------
    ValueError : the first error.
    """
    if not isinstance(document, dict):
        raise ValueError(f"it is a {type(document).__name__}, not an object")
    _check_format(document)
    document.setdefault("version", VERSION)
    check_document(document)
    for one in (document, *document.get("others", ())):
        _check_numbers(one)
    return document


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
    """Return a Calibration's arrays by name, with NaN for numbers and matrices that `check` refuses."""
    arrays = {name: np.where(np.abs(fields[name]) <= LARGEST, fields[name], np.nan) for _, name, _ in _NUMBERS}
    return {name: array if _is_usable(name, array) else np.full_like(array, np.nan) for name, array in arrays.items()}


def _is_usable(name: str, array: Vector) -> bool:
    """Return False for a matrix that must be inverted and cannot be; a wholly unknown one is usable."""
    if name not in ("D", "K") or np.isnan(array).all():
        return True
    return bool(np.isfinite(array).all() and np.linalg.cond(array) <= WORST_CONDITION)


def _check_numbers(document: Mapping[str, Any]) -> None:
    if np.nanmax(np.abs(np.array(document.get(KEY, ()), float)), initial=0.0) > 1.0:
        raise ValueError(f"{KEY} holds a number beyond 1")
    for key, rows in (
        ("accelerometer", ACCELEROMETER + TEMPERATURE),
        ("gyroscope", GYROSCOPE),
        ("applied_in_hardware", HARDWARE),
    ):
        values = _read(document.get(key, {}), rows)
        # no sensor has larger numbers, and products of these are finite
        if any(np.nanmax(np.abs(array), initial=0.0) > LARGEST for array in values.values()):
            raise ValueError(f"{key} holds a number beyond {LARGEST:g}")
        if any(
            np.nanmin(values[name], initial=0.0) < 0.0
            for _, name, _ in rows
            if name.endswith("_std") and name in values
        ):
            raise ValueError(f"{key} holds a standard deviation below 0")
        for name, array in values.items():
            if not _is_usable(name, array):
                raise ValueError(f"{name} cannot be inverted")
        if np.isnan(values.get("applied_in_hardware", 0.0)).any():
            raise ValueError("applied_in_hardware holds null")
    gravity = document.get("fit", {}).get("gravity")
    if gravity is not None and not LEAST_GRAVITY_MPS2 <= gravity <= MOST_GRAVITY_MPS2:
        raise ValueError(f"fit.gravity is {gravity:g} m/s^2")
    _check_slope(document)


def _check_slope(document: Mapping[str, Any]) -> None:
    """Check that b_a(T), if given, is a line through b_a at a sensor temperature within its range."""
    of = _read(document.get("accelerometer", {}), TEMPERATURE)
    if not np.any(of.get("b_a_slope", 0.0)):
        return
    T = document.get("sensor", {}).get("temperature_c")
    low, high = of.get("temperature_range_c", (np.nan, np.nan))
    if T is None or not (low <= T <= high and np.isfinite(of["b_a_slope"]).all()):
        raise ValueError("b_a_slope is given without its temperatures")


Rows = tuple[tuple[str, str, tuple[int, ...]], ...]


def _select(fields: Mapping[str, Any], rows: Rows) -> dict[str, Vector]:
    return {key: fields[attribute] for key, attribute, _ in rows}


def _read(values: Mapping[str, Any], rows: Rows) -> dict[str, Vector]:
    return {attribute: _array(values[key], shape) for key, attribute, shape in rows if values.get(key) is not None}


def _date(text: Any) -> str:
    """Return a time of ISO 8601, or "" if it is unknown."""
    if text == "":
        return ""
    if not isinstance(text, str) or not DATE.fullmatch(text):
        raise ValueError(f"created is {reprlib.repr(text)}, which is not an ISO 8601 time")
    datetime.fromisoformat(text)
    return text


def _array(values: Any, shape: tuple[int, ...]) -> Vector:
    array = np.array(values, dtype=np.float64)  # None becomes NaN
    if array.shape != shape:
        raise ValueError(f"an array has the shape {array.shape}, not {shape}")
    return array


def _plain(value: Any) -> Any:
    """Return a value of JSON types; NaN and infinities become None."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
