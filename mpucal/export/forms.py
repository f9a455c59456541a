"""The export forms of a calibration for other programs, a row each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from ..mavlink.firmwares import ARDUPILOT, PX4
from ..result.calibration import Calibration
from . import code, esphome, offset_words, ros, vehicles
from .losses import (
    LossNotes,
    check_usable,
    float_rounding,
    hardware_offsets,
    optional_temperature,
    scale_of_rates,
    without_gyroscope,
    without_temperature,
)


@dataclass(frozen=True)
class Form:
    """Export form of a calibration.

    Attributes
    ----------
    name : for `--to`. suffix : of the file's name.
    read_by : the program that reads it. applied : how that program applies it. Both are Markdown for docs/use.md.
    text : (calibration, notes) -> the file's text, with the notes if the format has comments.
    losses : functions that return notes on the parts of a calibration that the form cannot hold.
    only_usable : refuse an unusable calibration before `text` is called.
    """

    name: str
    suffix: str
    read_by: str
    applied: str
    text: Callable[[Calibration, tuple[str, ...]], str]
    losses: tuple[LossNotes, ...] = ()
    only_usable: bool = True

    def export(self, calibration: Calibration) -> tuple[str, tuple[str, ...]]:
        """Return the file's text, and sentences on the parts that it cannot hold and the remaining error.

        Raises
        ------
        RefusedError : the calibration must not be used. WriteBackError : this form cannot hold it.
        """
        if self.only_usable:
            check_usable(calibration)
        notes = tuple(sentence for loss in self.losses for sentence in loss(calibration))
        if calibration.doubt:
            notes += (f"About the calibration: {calibration.doubt}.",)
        return self.text(calibration, notes), notes


FORMS = (
    Form(
        "c-header",
        ".h",
        "C99, C++11",
        "`mpucal_correct_at(y, temperature_c, a)`, `mpucal_correct_gyro(y, w)`; of counts, with a check of the range",
        code.header,
        (float_rounding, scale_of_rates, optional_temperature, hardware_offsets),
    ),
    Form(
        "arduino",
        ".ino",
        "the Arduino IDE",
        "a sketch that reads the chip over Wire and prints accelerations and rates",
        code.sketch,
        (float_rounding, code.sketch_losses, hardware_offsets),
    ),
    Form(
        "python",
        ".py",
        "NumPy",
        "`apply(y, temperature_c)`, `apply_gyro(y)`",
        code.numpy_text,
        (scale_of_rates, optional_temperature, hardware_offsets),
    ),
    Form(
        "ros",
        ".yaml",
        "imu_calib's apply node",
        "`SM raw - bias`: its bias is inv(D) b_a; with covariances for filters",
        ros.imu_calib,
        (ros.imu_calib_losses, without_temperature, hardware_offsets),
    ),
    Form(
        "linux-iio",
        ".sh",
        "`sh FILE /sys/bus/iio/devices/iio:deviceN`",
        "calibbias (only of an MPU-6050: the kernel's driver uses wrong addresses of an MPU-6500's offset registers), "
        "calibscale; it prints the line for udev's ACCEL_MOUNT_MATRIX",
        offset_words.linux_iio,
        (offset_words.linux_iio_losses, without_gyroscope, without_temperature),
    ),
    Form(
        "ardupilot",
        ".param",
        "Mission Planner, MAVProxy",
        "ArduPilot's offsets and scales",
        partial(vehicles.text, firmware=ARDUPILOT),
        (partial(vehicles.losses, firmware=ARDUPILOT),),
        only_usable=False,
    ),
    Form(
        "px4",
        ".params",
        "QGroundControl",
        "PX4's offsets and scales",
        partial(vehicles.text, firmware=PX4),
        (partial(vehicles.losses, firmware=PX4),),
        only_usable=False,
    ),
    Form(
        "kalibr",
        ".yaml",
        "Kalibr",
        "imu.yaml: noise densities; correct the samples before",
        ros.kalibr,
        (ros.kalibr_losses,),
    ),
    Form(
        "openvins",
        ".yaml",
        "OpenVINS",
        "kalibr_imu_chain.yaml: `Ta`, `R_IMUtoACC` of inv(D), `Tw`, `R_IMUtoGYRO` of K; it estimates the biases",
        ros.openvins,
        (ros.openvins_losses,),
    ),
    Form(
        "i2cdevlib",
        ".h",
        "sketches with i2cdevlib's MPU6050",
        "`setOffsets(mpu)`: setXAccelOffset and the like, only biases",
        offset_words.i2cdevlib,
        (offset_words.i2cdevlib_losses, without_temperature),
    ),
    Form(
        "micropython",
        ".py",
        "MicroPython, CircuitPython",
        "`apply(y, temperature_c)`, `apply_gyro(y)` of one sample, without NumPy; of counts, with a check of the range",
        code.micropython_text,
        (float_rounding, scale_of_rates, optional_temperature, hardware_offsets),
    ),
    Form(
        "esphome",
        ".yaml",
        "ESPHome",
        "template sensors of the calibrated axes and its mpu6050 sensor",
        esphome.text,
        (float_rounding, esphome.losses, hardware_offsets),
    ),
    Form(
        "json",
        ".json",
        "anything",
        "calibration.json; a blob's content is kept to the last digit",
        lambda calibration, _notes: calibration.json(),
        only_usable=False,
    ),
)


def form(name: str) -> Form:
    """Return the form of that name in FORMS."""
    return next(row for row in FORMS if row.name == name)
