"""Parameters in the text files of ground stations. Knows no link.

`.param` is what Mission Planner and MAVProxy load: `NAME,VALUE` a line. `.params` is QGroundControl's: vehicle,
component, name, value and MAV_PARAM_TYPE, with tabs between. Both take lines that begin with # as remarks.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from .encoding import REAL32, as_float32

PARAM, PARAMS = ".param", ".params"


def param_text(values: Mapping[str, float], remarks: Iterable[str] = ()) -> str:
    """A .param file; floats with the nine digits that make the same float32 again."""
    lines = [f"# {remark}" for remark in remarks]
    return "\n".join([*lines, *(f"{name},{_digits(value)}" for name, value in values.items())]) + "\n"


def params_text(
    values: Mapping[str, float],
    remarks: Iterable[str] = (),
    system: int = 1,
    component: int = 1,
    types: Mapping[str, int] | None = None,
) -> str:
    """A .params file; `types` are MAV_PARAM_TYPE where they are not floats."""
    lines = [f"# {remark}" for remark in remarks]
    lines += ["#", "# Vehicle-Id Component-Id Name Value Type"]
    kinds = types or {}
    for name, value in values.items():
        lines.append(f"{system}\t{component}\t{name}\t{_digits(value)}\t{kinds.get(name, REAL32)}")
    return "\n".join(lines) + "\n"


def _digits(value: float) -> str:
    return f"{as_float32(value):.9g}"
