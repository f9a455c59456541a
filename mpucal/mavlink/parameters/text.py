"""Parameter files of ground stations.

Mission Planner and MAVProxy load `.param`: `NAME,VALUE` a line. QGroundControl loads `.params`: vehicle, component,
name, value and MAV_PARAM_TYPE, separated by tabs. In both, lines that begin with # are remarks.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from ...errors import RecordingError
from .encoding import REAL32, as_float32

PARAMS_COLUMNS = 5


def param_text(values: Mapping[str, float], remarks: Iterable[str] = ()) -> str:
    """Return a .param file; its floats have the nine digits that identify a float32."""
    lines = [f"# {remark}" for remark in remarks]
    return "\n".join([*lines, *(f"{name},{_digits(value)}" for name, value in values.items())]) + "\n"


def params_text(
    values: Mapping[str, float],
    remarks: Iterable[str] = (),
    system: int = 1,
    component: int = 1,
    types: Mapping[str, int] | None = None,
) -> str:
    """Return a .params file; `types` holds the MAV_PARAM_TYPE of parameters that are not floats."""
    lines = [f"# {remark}" for remark in remarks]
    lines += ["#", "# Vehicle-Id Component-Id Name Value Type"]
    kinds = types or {}
    for name, value in values.items():
        lines.append(f"{system}\t{component}\t{name}\t{_digits(value)}\t{kinds.get(name, REAL32)}")
    return "\n".join(lines) + "\n"


def read_parameters_file(path: Path) -> dict[str, float]:
    """Return the values in either kind of file, by name.

    Raises
    ------
    RecordingError : it cannot be read, or is neither.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
        rows = [re.split(r"[\s,]+", line.strip()) for line in lines if line.strip() and not line.startswith("#")]
        # QGroundControl's rows begin with vehicle and component.
        pairs = [row[2:4] if len(row) == PARAMS_COLUMNS else row for row in rows]
        return {name: as_float32(float(value)) for name, value in pairs}
    except OSError as error:
        raise RecordingError(f"cannot read {path} ({error.strerror})", "check the path") from error
    except ValueError as error:
        raise RecordingError(f"{path} is not a parameter file ({error})", "give a .param or .params file") from error


def _digits(value: float) -> str:
    return f"{as_float32(value):.9g}"
