"""A calibration for ROS: YAML for imu_calib's apply node, Kalibr's imu.yaml and OpenVINS's kalibr_imu_chain.yaml.

imu_calib (dpkoch/imu_calib, AccelCalib::applyCalib) publishes SM raw - bias: the bias is subtracted after the matrix,
so SM = inv(D) and bias = inv(D) b_a. Its node subtracts the mean of the gyroscope's first samples itself
(calibrate_gyros, the default). It ignores unknown keys.

Kalibr reads only noise: densities [m/s^2/sqrt(Hz), rad/s/sqrt(Hz)], which it multiplies by the root of the rate
(ethz-asl/kalibr, wiki "IMU Noise Model"). OpenVINS (rpng/open_vins, VioManagerOptions.h and Propagator) computes

    a = R_IMUtoACC^T inv(Ta) (a_m - b_a),  w = R_IMUtoGYRO^T inv(Tw) (w_m - b_g - Tg a)

with its model "kalibr", where inv(Ta) and inv(Tw) are lower triangular, and estimates both biases itself:
inv(D) = Q L, with a rotation Q, gives R_IMUtoACC = Q^T and Ta = inv(L); K in the same way.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..data import Vector
from ..errors import WriteBackError
from ..result.calibration import Calibration
from ..result.clock import duration
from ..result.noise import ACCELEROMETER, GYROSCOPE, KEY, WHITE
from ..result.noise import WALK as RANDOM_WALK
from .losses import heading
from .templates import yaml_number, yaml_row

# random walks over densities, as a calibration does not measure random walks
WALK = 0.1
UNMEASURED = (
    "A calibration does not measure random walks: a tenth of the noise densities is used. `mpucal noise` measures them"
    " in a rest of hours; pass its noise.json with --noise."
)


def kalibr(calibration: Calibration, notes: Sequence[str]) -> str:
    """Return imu.yaml.

    Raises
    ------
    WriteBackError : the noise or rate of the calibration is not known.
    """
    return "\n".join([*heading(calibration, notes, "# "), "#", *_noise(calibration)]) + "\n"


def openvins(calibration: Calibration, notes: Sequence[str]) -> str:
    """Return kalibr_imu_chain.yaml for OpenCV's FileStorage; see kalibr."""
    Q_a, L_a = rotation_and_lower(calibration.inverse)
    Q_w, L_w = rotation_and_lower(calibration.K)
    lines = ["%YAML:1.0", *heading(calibration, notes, "# "), "", "imu0:"]
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


def kalibr_losses(calibration: Calibration) -> tuple[str, ...]:
    """Return notes on Kalibr, which needs corrected samples."""
    note = "It holds only the noise: give Kalibr the samples that `mpucal apply` has corrected."
    return (note, *_noise_notes(calibration))


def openvins_losses(calibration: Calibration) -> tuple[str, ...]:
    """Return notes on OpenVINS, which estimates biases."""
    return (
        "It holds no biases: OpenVINS estimates b_a and b_omega itself. Give it the samples as measured.",
        *_noise_notes(calibration),
    )


def _noise_notes(calibration: Calibration) -> tuple[str, ...]:
    known = calibration.extra.get(KEY)
    if known is None:
        return (UNMEASURED,)
    unsure = [
        f"{sensor}_random_walk" for sensor in (ACCELEROMETER, GYROSCOPE) if RANDOM_WALK in known[sensor]["at_most"]
    ]
    note = f"Its noise is from a rest of {duration(known['seconds'])}."
    return (f"{note} Not significant, and given as upper limits: {', '.join(unsure)}." if unsure else note,)


def rotation_and_lower(M: Vector) -> tuple[Vector, Vector]:
    """Factor M = Q L, (3, 3) each: Q a rotation, L lower triangular with a positive diagonal."""
    # reversing rows and columns turns QR into QL
    Q, R = np.linalg.qr(M[::-1, ::-1])
    sign = np.sign(np.diag(R))
    return (Q * sign)[::-1, ::-1], (R * sign[:, None])[::-1, ::-1]


def _noise(calibration: Calibration) -> list[str]:
    rate_hz = calibration.sensor.rate_hz
    known = calibration.extra.get(KEY)
    stds = calibration.noise_std, calibration.gyro_noise_std
    if known is not None:
        rate_hz = rate_hz or known["rate_hz"]
        densities = [(known[sensor][WHITE], known[sensor][RANDOM_WALK]) for sensor in (ACCELEROMETER, GYROSCOPE)]
    elif not rate_hz or not all(np.isfinite(std).all() and std.any() for std in stds):
        raise WriteBackError(
            "nothing was exported: the calibration lacks the noise of a sample or the sample rate",
            "calibrate with mpucal from a recording in which the board lies still",
        )
    else:
        whites = [float(np.sqrt(np.mean(std**2) / rate_hz)) for std in stds]
        densities = [(white, WALK * white) for white in whites]
    return [
        *(
            line
            for sensor, (white, walk) in zip((ACCELEROMETER, GYROSCOPE), densities, strict=True)
            for line in (f"{sensor}_noise_density: {yaml_number(white)}", f"{sensor}_random_walk: {yaml_number(walk)}")
        ),
        "rostopic: /imu/data",
        f"update_rate: {yaml_number(rate_hz)}",
    ]


def _block(key: str, matrix: Vector) -> list[str]:
    return [f"  {key}:", *(f"    - {yaml_row(row)}" for row in matrix)]


def imu_calib(calibration: Calibration, notes: Sequence[str]) -> str:
    """Return the file's text, with `notes` in its heading."""
    SM = calibration.inverse
    lines = [
        *heading(calibration, notes, "# "),
        "# corrected = SM * raw - bias, as in imu_calib's apply_calib: bias is inv(D) b_a",
        f"SM: {yaml_row(SM.ravel())}",
        f"bias: {yaml_row(SM @ calibration.b_a_to_subtract)}",
    ]
    known, rate_hz = calibration.extra.get(KEY), calibration.sensor.rate_hz
    for key, sensor, noise in (
        ("linear_acceleration_covariance", ACCELEROMETER, calibration.noise_std),
        ("angular_velocity_covariance", GYROSCOPE, calibration.gyro_noise_std),
    ):
        if known is not None:
            # from a density to one sample
            noise = np.full(3, known[sensor][WHITE] * np.sqrt(rate_hz or known["rate_hz"]))  # noqa: PLW2901
        if np.isfinite(noise).all():
            lines.append(f"{key}: {yaml_row(np.diag(noise**2).ravel())}")
    return "\n".join(lines) + "\n"


def imu_calib_losses(calibration: Calibration) -> tuple[str, ...]:
    """Return notes on imu_calib's handling of the gyroscope."""
    scale = 100.0 * float(np.abs(calibration.K - np.eye(3)).max())
    remaining = f": up to {scale:.2f} % of a rate remain" if scale else ""
    return (
        "imu_calib subtracts the gyroscope's bias at the start of its node, when the sensor must be still; it does not"
        f" correct scale factor errors and misalignments of the gyroscope{remaining}.",
    )
