"""A calibration as functions in C, Python and ROS with its numbers in them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..data import ACCEL_COUNTS, GYRO_COUNTS, STANDARD_GRAVITY_MPS2, Vector
from ..result.calibration import Calibration


def in_c(c: Calibration) -> str:
    """inv(D), b_a, K and b_omega as constants, and the functions for firmware that apply them.

    Their names differ from those of mpucal_apply.h: a file may include both.
    """
    bias = _joined(f"{v:.8e}f" for v in c.b_a_to_subtract)
    rate_bias = _joined(f"{v:.8e}f" for v in np.nan_to_num(c.b_omega))
    return f"""static const float MPUCAL_INV_D[3][3] = {{
{c_matrix(c.inverse)}
}};
static const float MPUCAL_B_A[3] = {{{bias}}}; /* m/s^2 */
static const float MPUCAL_K[3][3] = {{
{c_matrix(c.K)}
}};
static const float MPUCAL_B_OMEGA[3] = {{{rate_bias}}}; /* rad/s */

{_about_counts(c, "/* ", " */")}
static inline void mpucal_correct(const float y[3], float a[3])
{{
    for (int i = 0; i < 3; i++) {{
        a[i] = 0.0f;
        for (int j = 0; j < 3; j++)
            a[i] += MPUCAL_INV_D[i][j] * (y[j] - MPUCAL_B_A[j]);
    }}
}}

{_about_rates(c, "/* ", " */")}
static inline void mpucal_correct_gyro(const float y[3], float w[3])
{{
    for (int i = 0; i < 3; i++) {{
        w[i] = 0.0f;
        for (int j = 0; j < 3; j++)
            w[i] += MPUCAL_K[i][j] * (y[j] - MPUCAL_B_OMEGA[j]);
    }}
}}
"""


def c_matrix(matrix: Vector) -> str:
    """The rows of a C initialiser, in float."""
    return ",\n".join(f"    {{{_joined(f'{v:.8e}f' for v in row)}}}" for row in matrix)


def py_matrix(matrix: Vector) -> str:
    """The rows of a Python list."""
    return ",\n".join(f"    [{_joined(f'{v:.12g}' for v in row)}]" for row in matrix)


def temperatures(c: Calibration) -> tuple[float, float, float]:
    """Where b_a is b_a, and from where to where it follows the temperature [deg C]; zeros: it does not."""
    if not c.follows_temperature or c.sensor.temperature_c is None:
        return 0.0, 0.0, 0.0
    start, end = c.temperature_range_c.tolist()
    return c.sensor.temperature_c, start, end


def in_python(c: Calibration) -> str:
    """A function for NumPy."""
    at, start, end = temperatures(c)
    return f"""import numpy as np

{_matrices(c)}B_A_SLOPE = np.array([{_joined(f"{v:.12g}" for v in c.b_a_slope)}])  # m/s^2 per degree Celsius
AT_C, RANGE_C = {at:.6g}, ({start:.6g}, {end:.6g})


def apply(y, temperature_c=np.nan):
    \"\"\"Calibrated accelerations (..., 3) [m/s^2] of measured ones, at the chip's (...) deg C if known.\"\"\"
    away = np.nan_to_num(np.clip(temperature_c, *RANGE_C) - AT_C)
    return (np.asarray(y) - B_A - np.multiply.outer(away, B_A_SLOPE)) @ INV_D.T
"""


def in_ros(c: Calibration) -> str:
    """A node for ROS 2 that listens to imu/data_raw and publishes imu/data."""
    noise = np.diag(c.noise_std**2)
    known = f"COVARIANCE = {noise.ravel().tolist()}\n" if np.isfinite(noise).all() else ""
    told = "        imu.linear_acceleration_covariance = COVARIANCE\n" if known else ""
    return f"""import numpy as np
import rclpy
from rclpy.node import Node
from sensor_msgs.msg import Imu

{_matrices(c)}{known}

class Calibrated(Node):
    def __init__(self):
        super().__init__("calibrated_imu")
        self.out = self.create_publisher(Imu, "imu/data", 10)
        self.create_subscription(Imu, "imu/data_raw", self.hear, 10)

    def hear(self, imu):
        y = imu.linear_acceleration
        y.x, y.y, y.z = (INV_D @ (np.array([y.x, y.y, y.z]) - B_A)).tolist()
{told}        self.out.publish(imu)


if __name__ == "__main__":
    rclpy.init()
    rclpy.spin(Calibrated())
"""


def _matrices(c: Calibration) -> str:
    rows = py_matrix(c.inverse)
    bias = _joined(f"{v:.12g}" for v in c.b_a_to_subtract)
    return f"INV_D = np.array([\n{rows},\n])\nB_A = np.array([{bias}])  # m/s^2\n"


def _about_counts(c: Calibration, begin: str, end: str) -> str:
    line = f"{begin}y: as measured, a: calibrated, both in m/s^2.{end}"
    if c.sensor.accel_range_g is None:
        return line
    scale = c.sensor.accel_range_g * STANDARD_GRAVITY_MPS2 / ACCEL_COUNTS
    return f"{line}\n{begin}At +-{c.sensor.accel_range_g:g} g one count of the chip is {scale:.9g} m/s^2.{end}"


def _about_rates(c: Calibration, begin: str, end: str) -> str:
    line = f"{begin}The rate w [rad/s] of a measured one.{end}"
    range_dps = c.sensor.gyro_range_dps
    if range_dps is None:
        return line
    lsb, scale = GYRO_COUNTS / range_dps, np.radians(range_dps / GYRO_COUNTS)
    of = f"{range_dps:g} deg/s one count of the chip is {scale:.9g} rad/s, {lsb:g} LSB/(deg/s)"
    return f"{line}\n{begin}At +-{of}; who takes another scale for y changes w by as much.{end}"


def _joined(numbers: Iterable[str]) -> str:
    return ", ".join(numbers)
