"""A calibration as a Python module: `apply` for accelerations, `apply_gyro` for rates.

One needs only NumPy; the other is for MicroPython or CircuitPython, and corrects one sample at a time.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..data import mps2_per_count, rad_s_per_count
from ..result.calibration import Calibration
from .losses import heading, temperature_range
from .templates import fill, row, rows


def numpy_text(calibration: Calibration, notes: Sequence[str]) -> str:
    """Return the text of the module for NumPy, with `notes` in its docstring."""
    head = "\n\n".join(heading(calibration, notes, "", "m/s^2, rad/s"))
    return _text("module.py", calibration, head, "{:.12g}", "[]", "{:.6g}")


def micropython_text(calibration: Calibration, notes: Sequence[str]) -> str:
    """Return the text of the module for MicroPython, with `notes` in its heading."""
    return _text(
        "micropython.py",
        calibration,
        "\n".join(heading(calibration, notes, "# ", "m/s^2, rad/s")),
        "{:.9g}",
        "()",
        "{:.9g}",
        ranges=f"{calibration.sensor.accel_range_g}, {calibration.sensor.gyro_range_dps}",
        mps2_per_g_count=f"{mps2_per_count(1.0):.9g}",
        rad_s_per_dps_count=f"{rad_s_per_count(1.0):.9g}",
    )


def _text(name: str, c: Calibration, head: str, form: str, brackets: str, of_t: str, **more: str) -> str:
    return fill(
        name,
        heading=head,
        inv_D=rows(c.inverse, form, brackets),
        b_a=row(c.b_a_to_subtract, form),
        slope=row(c.b_a_slope, form),
        temperatures=row(temperature_range(c), of_t),
        K=rows(c.K, form, brackets),
        b_omega=row(np.nan_to_num(c.b_omega), form),
        **more,
    )
