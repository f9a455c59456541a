"""A calibration for visual-inertial estimators: Kalibr's imu.yaml and OpenVINS's kalibr_imu_chain.yaml.

Kalibr reads noise alone: densities [m/s^2/sqrt(Hz), rad/s/sqrt(Hz)], which it multiplies by the root of the rate
(ethz-asl/kalibr, wiki "IMU Noise Model"). OpenVINS (rpng/open_vins, VioManagerOptions.h and Propagator) computes

    a = R_IMUtoACC^T inv(Ta) (a_m - b_a),  w = R_IMUtoGYRO^T inv(Tw) (w_m - b_g - Tg a)

with its model "kalibr", of which inv(Ta) and inv(Tw) are lower triangular, and estimates both biases itself:
inv(D) = Q L with Q a rotation gives R_IMUtoACC = Q^T and Ta = inv(L), and so does K.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..data import Vector
from ..errors import WriteBackError
from ..result.calibration import Calibration
from ..result.noise import ACCELEROMETER, GYROSCOPE, KEY, WHITE
from ..result.noise import WALK as RANDOM_WALK
from .losses import check_usable, head

# of the densities, for the random walks that a calibration does not measure
WALK = 0.1
UNMEASURED = (
    "A calibration measures no random walks: a tenth of the noise densities stands for them. `mpucal noise` measures"
    " them in a rest of hours; give its noise.json with --noise."
)


def kalibr(calibration: Calibration, notes: Sequence[str]) -> str:
    """imu.yaml.

    Raises
    ------
    RefusedError : the calibration must not be used. WriteBackError : it does not say the noise or the rate.
    """
    lines = [f"# {line}" for line in (f"{head(calibration)}.", *notes)]
    return "\n".join([*lines, "#", *_noise(calibration)]) + "\n"


def openvins(calibration: Calibration, notes: Sequence[str]) -> str:
    """kalibr_imu_chain.yaml, as OpenCV's FileStorage reads it; see kalibr."""
    check_usable(calibration)
    Q_a, L_a = rotation_and_lower(calibration.inverse)
    Q_w, L_w = rotation_and_lower(calibration.K)
    lines = ["%YAML:1.0", *(f"# {line}" for line in (f"{head(calibration)}.", *notes)), "", "imu0:"]
    lines += _block("T_i_b", np.eye(4))
    lines += [f"  {line}" for line in (*_noise(calibration), "time_offset: 0.0", 'model: "kalibr"')]
    for key, matrix in (
        ("Tw", np.linalg.inv(L_w)),
        ("R_IMUtoGYRO", Q_w.T),
        ("Ta", np.linalg.inv(L_a)),
        ("R_IMUtoACC", Q_a.T),
        ("Tg", np.zeros((3, 3))),
    ):
        lines += _block(key, np.asarray(matrix, float))
    return "\n".join(lines) + "\n"


def left_by_kalibr(calibration: Calibration) -> tuple[str, ...]:
    """Kalibr takes corrected samples."""
    said = "It holds the noise alone: give Kalibr the samples that `mpucal apply` has corrected."
    return (said, *_of_noise(calibration))


def left_by_openvins(calibration: Calibration) -> tuple[str, ...]:
    """OpenVINS estimates biases."""
    return (
        "It holds no biases: OpenVINS estimates b_a and b_omega itself. Give it the samples as measured.",
        *_of_noise(calibration),
    )


def _of_noise(calibration: Calibration) -> tuple[str, ...]:
    known = calibration.extra.get(KEY)
    if known is None:
        return (UNMEASURED,)
    unsure = [
        f"{sensor}_random_walk" for sensor in (ACCELEROMETER, GYROSCOPE) if RANDOM_WALK in known[sensor]["at_most"]
    ]
    said = f"Its noise is that of a rest of {known['seconds'] / 3600.0:.2f} h."
    return (f"{said} Not told from zero, and given as at most: {', '.join(unsure)}." if unsure else said,)


def rotation_and_lower(M: Vector) -> tuple[Vector, Vector]:
    """M = Q L, (3, 3) each: Q a rotation, L lower triangular with a positive diagonal."""
    # the QR decomposition of the matrix turned by half a turn
    Q, R = np.linalg.qr(M[::-1, ::-1])
    sign = np.sign(np.diag(R))
    return (Q * sign)[::-1, ::-1], (R * sign[:, None])[::-1, ::-1]


def _noise(calibration: Calibration) -> list[str]:
    check_usable(calibration)
    rate_hz = calibration.sensor.rate_hz
    known = calibration.extra.get(KEY)
    stds = calibration.noise_std, calibration.gyro_noise_std
    if known is not None:
        rate_hz = rate_hz or known["rate_hz"]
        densities = [(known[sensor][WHITE], known[sensor][RANDOM_WALK]) for sensor in (ACCELEROMETER, GYROSCOPE)]
    elif not rate_hz or not all(np.isfinite(std).all() and std.any() for std in stds):
        raise WriteBackError(
            "nothing was exported: the calibration does not say the noise of a sample and its rate",
            "calibrate with mpucal from a recording in which the board lies still",
        )
    else:
        whites = [float(np.sqrt(np.mean(std**2) / rate_hz)) for std in stds]
        densities = [(white, WALK * white) for white in whites]
    return [
        *(
            line
            for sensor, (white, walk) in zip((ACCELEROMETER, GYROSCOPE), densities, strict=True)
            for line in (f"{sensor}_noise_density: {_number(white)}", f"{sensor}_random_walk: {_number(walk)}")
        ),
        "rostopic: /imu/data",
        f"update_rate: {_number(rate_hz)}",
    ]


def _block(key: str, matrix: Vector) -> list[str]:
    return [f"  {key}:", *(f"    - [{', '.join(map(_number, row))}]" for row in matrix)]


def _number(value: float) -> str:
    # YAML takes 1e-05 for a word: a number needs its point
    return np.format_float_positional(value + 0.0, trim="0")
