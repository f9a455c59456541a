"""Parameters of the model, in one table. Run as a program, this file writes the kernel's header from it.

A row is a field of Theta. From the rows follow names and order of the parameters, their places in vectors and matrices,
priors, starting values, which model estimates which, and the structures and lanes of the kernel. CMake runs this file
before anything is installed, so that only the standard library is imported.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path


class Form(Enum):
    """Shape of a row's numbers: the endings of their names, and their declaration in C++."""

    MATRIX = ("xx", "xy", "xz", "yx", "yy", "yz", "zx", "zy", "zz"), "{0}[3][3]"  # row-major
    SYMMETRIC = ("xx", "xy", "xz", "yy", "yz", "zz"), "{0}[3][3]"
    VECTOR = ("x", "y", "z"), "{0}[3]"
    SCALAR = ("",), "{0}"
    DIRECTION = ("0", "1"), "{0}[3], d{0}[2][3]"  # a unit vector; it has two parameters, the tilts across it


# Each model estimates the parameters of the one before it, and more.
MODELS = ("accel", "imu", "hand")


@dataclass(frozen=True)
class Parameter:
    """Row of the table.

    Attributes
    ----------
    name : of the row; the names of its parameters begin with it. form : their shape.
    model : the simplest of MODELS that estimates it; simpler ones leave it at its start.
    lanes : places of its parameters in the kernel's gradient; four lanes in a row are one group (kernel/filter.hpp).
    meaning : description and unit. start : starting value and mean of the prior; times the identity for a matrix.
    sd : standard deviation of the prior of each parameter; empty: it has none, or the recording gives it.
    stored_as : field of Theta and of the kernel's structures; empty: the name.
    """

    name: str
    form: Form
    model: str
    lanes: Sequence[int]
    meaning: str
    start: float = 0.0
    sd: tuple[float, ...] = ()
    stored_as: str = ""

    @property
    def field(self) -> str:
        """Name of the field of Theta and of the kernel's structures."""
        return self.stored_as or self.name

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its parameters."""
        return tuple(f"{self.name}_{ending}".rstrip("_") for ending in self.form.value[0])

    @property
    def mean(self) -> tuple[float, ...]:
        """Start of each parameter."""
        return tuple(self.start if len(set(ending)) <= 1 else 0.0 for ending in self.form.value[0])


# Priors. K: a data sheet's +-3 % of scale and +-2 % across axes, taken as uniform. tau: what filters of chips and
# streams leave. r: how far a hand's pivot is from the sensor. b_omega: the flat segment's mean.
TABLE = (
    Parameter("D", Form.MATRIX, "accel", (0, 1, 2, 4, 5, 6, 8, 9, 10), "accelerometer's matrix", start=1.0),
    Parameter("b_a", Form.VECTOR, "accel", (3, 7, 11), "accelerometer's bias, m/s^2"),
    Parameter("tilt", Form.DIRECTION, "accel", (15, 16), "gravity's direction at the start", stored_as="u"),
    Parameter("b_omega", Form.VECTOR, "accel", (12, 13, 14), "gyroscope's bias, rad/s"),
    Parameter(
        "K", Form.SYMMETRIC, "imu", range(17, 23), "gyroscope's matrix", 1.0, (0.02, 0.01, 0.01, 0.02, 0.01, 0.02)
    ),
    Parameter("tau", Form.SCALAR, "hand", (23,), "delay of the accelerometer, s", sd=(0.002,)),
    Parameter("r", Form.VECTOR, "hand", (24, 25, 26), "lever arm, m", sd=(0.3, 0.3, 0.3)),
)


def estimated(model: str) -> tuple[Parameter, ...]:
    """Return the rows that a model estimates; they come first in the table."""
    return tuple(row for row in TABLE if MODELS.index(row.model) <= MODELS.index(model))


def lanes_used(model: str) -> int:
    """Return the number of the kernel's lanes that a model uses."""
    return 1 + max(lane for row in estimated(model) for lane in row.lanes)


BY_NAME = {row.name: row for row in TABLE}
NAMES = tuple(name for row in TABLE for name in row.names)
LANES = tuple(lane for row in TABLE for lane in row.lanes)
# Slices of vectors and matrices in the order of NAMES, by the rows' names.
PLACES = {row.name: slice(NAMES.index(row.names[0]), NAMES.index(row.names[-1]) + 1) for row in TABLE}

D_NAMES, B_A_NAMES, K_NAMES, B_OMEGA_NAMES = (BY_NAME[name].names for name in ("D", "b_a", "K", "b_omega"))
# The accelerometer's parameters: D row-major, then b_a.
ACCELEROMETER = slice(PLACES["D"].start, PLACES["b_a"].stop)

# Number of parameters of each model.
ACCEL, IMU, HAND = (sum(len(row.names) for row in estimated(model)) for model in MODELS)

# S, the gyroscope's sensitivity to acceleration, row-major: its columns are groups of lanes after the hand's.
LANES_OF_S = tuple(-(-lanes_used("hand") // 4) * 4 + 4 * j + i for i in range(3) for j in range(3))
SENSITIVE = HAND + len(LANES_OF_S)

# A kernel that was built for another table must not run.
LAYOUT = ", ".join(f"{row.name} {row.form.name} {row.model} {[*row.lanes]}" for row in TABLE)


def header() -> str:
    """Return the kernel's parameters.hpp: lanes, and structures of doubles in the order of the table."""

    def fields(rows: Sequence[Parameter]) -> list[str]:
        return [f"  double {row.form.value[1].format(row.field)};  // {row.meaning}" for row in rows]

    exact = estimated("imu")
    first = ", ".join(f"{row.name} = {row.lanes[0]}" for row in TABLE)
    used = ", ".join(f"{model} = {lanes_used(model)}" for model in MODELS)
    lines = [
        f"// Written by {Path(__file__).name} from its table: change that instead.",
        "#pragma once",
        "namespace mpucal {",
        f"struct Lanes {{  // the first of each\n  static constexpr int {first};\n}};",
        f"struct LanesUsed {{  // by each model\n  static constexpr int {used};\n}};",
        "\n".join(["struct Parameters {", *fields(exact), "};"]),
        "\n".join(["struct HandParameters : Parameters {", *fields(TABLE[len(exact) :]), "};"]),
        f'constexpr char kLayout[] = "{LAYOUT}";',
        "}  // namespace mpucal\n",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(header(), encoding="utf-8")
