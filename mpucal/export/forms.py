"""The forms in which other programs read a calibration, a row each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ..result.calibration import Calibration
from . import arduino, c_header, esphome, i2cdevlib, linux_iio, micropython, python, ros, vehicles, vio
from .losses import (
    Loss,
    check_usable,
    in_float,
    where_temperature_is_not_given,
    with_hardware,
    without_gyroscope,
    without_temperature,
)


@dataclass(frozen=True)
class Form:
    """A form in which another program reads a calibration.

    Attributes
    ----------
    name : as `--to` spells it. suffix : of the file's name.
    read_by : who reads it, and applied : how that applies it; in Markdown, as docs/use.md has them.
    text : (calibration, notes) -> the file's text, which states the notes where it can.
    losses : what the form cannot carry; each gives its sentences for a calibration.
    only_usable : whether a calibration that must not be used is refused before `text` is asked for.
    """

    name: str
    suffix: str
    read_by: str
    applied: str
    text: Callable[[Calibration, tuple[str, ...]], str]
    losses: tuple[Loss, ...] = ()
    only_usable: bool = True

    def export(self, calibration: Calibration) -> tuple[str, tuple[str, ...]]:
        """The file's text, and what it cannot carry and what error that leaves, a sentence each.

        Raises
        ------
        RefusedError : a calibration that must not be used. WriteBackError : one that this form cannot hold.
        """
        if self.only_usable:
            check_usable(calibration)
        notes = tuple(sentence for loss in self.losses for sentence in loss(calibration))
        if calibration.doubt:
            notes += (f"Of the calibration, {calibration.doubt}.",)
        return self.text(calibration, notes), notes


FORMS = (
    Form(
        "c-header",
        ".h",
        "C99, C++11",
        "`mpucal_correct_at(y, temperature_c, a)`, `mpucal_correct_gyro(y, w)`, and of counts, which check the range",
        c_header.text,
        (in_float, where_temperature_is_not_given, with_hardware),
    ),
    Form(
        "arduino",
        ".ino",
        "the Arduino IDE",
        "a sketch that reads the chip over Wire, and prints accelerations and rates",
        arduino.text,
        (in_float, arduino.left, with_hardware),
    ),
    Form(
        "python",
        ".py",
        "NumPy",
        "`apply(y, temperature_c)`, `apply_gyro(y)`",
        python.text,
        (where_temperature_is_not_given, with_hardware),
    ),
    Form(
        "ros",
        ".yaml",
        "imu_calib's apply node",
        "`SM raw - bias`: its bias is inv(D) b_a; covariances for filters besides",
        ros.text,
        (ros.left, without_temperature, with_hardware),
    ),
    Form(
        "linux-iio",
        ".sh",
        "`sh FILE /sys/bus/iio/devices/iio:deviceN`",
        "calibbias (of an MPU-6050 alone: of an MPU-6500 the kernel's driver takes the offset registers to lie two "
        "addresses apart, and they lie three apart), calibscale; the line for udev's ACCEL_MOUNT_MATRIX is printed",
        linux_iio.text,
        (linux_iio.left, without_gyroscope, without_temperature),
    ),
    Form(
        "ardupilot",
        ".param",
        "Mission Planner, MAVProxy",
        "ArduPilot's offsets and scales",
        vehicles.ardupilot,
        (vehicles.left_by_ardupilot,),
        only_usable=False,
    ),
    Form(
        "px4",
        ".params",
        "QGroundControl",
        "PX4's offsets and scales",
        vehicles.px4,
        (vehicles.left_by_px4,),
        only_usable=False,
    ),
    Form(
        "kalibr",
        ".yaml",
        "Kalibr",
        "imu.yaml: noise densities; the samples are corrected before",
        vio.kalibr,
        (vio.left_by_kalibr,),
        only_usable=False,
    ),
    Form(
        "openvins",
        ".yaml",
        "OpenVINS",
        "kalibr_imu_chain.yaml: `Ta`, `R_IMUtoACC` of inv(D), `Tw`, `R_IMUtoGYRO` of K; it estimates the biases",
        vio.openvins,
        (vio.left_by_openvins,),
        only_usable=False,
    ),
    Form(
        "i2cdevlib",
        ".h",
        "sketches with i2cdevlib's MPU6050",
        "`setOffsets(mpu)`: setXAccelOffset and the like, biases alone",
        i2cdevlib.text,
        (i2cdevlib.left, without_temperature),
    ),
    Form(
        "micropython",
        ".py",
        "MicroPython, CircuitPython",
        "`apply(y, temperature_c)`, `apply_gyro(y)` of one sample, without NumPy, and of counts, which check the range",
        micropython.text,
        (in_float, where_temperature_is_not_given, with_hardware),
    ),
    Form(
        "esphome",
        ".yaml",
        "ESPHome",
        "template sensors of the calibrated axes, beside its mpu6050 sensor",
        esphome.text,
        (in_float, esphome.left, with_hardware),
    ),
    Form(
        "json",
        ".json",
        "anything",
        "calibration.json; of a blob, what the blob holds, with no digit lost",
        lambda calibration, _notes: calibration.json(),
        only_usable=False,
    ),
)


def form(name: str) -> Form:
    """The form of that name in FORMS."""
    return next(row for row in FORMS if row.name == name)
