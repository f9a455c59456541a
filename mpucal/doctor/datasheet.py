"""What the product specifications promise, by family. Knows no measurement.

Source: PS-MPU-6000A r3.4, sections 6.1 and 6.2; PS-MPU-9250A r1.0, sections 3.1 and 3.2.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..chip.families import Family


@dataclass(frozen=True)
class DataSheet:
    """Typical values and tolerances of one family.

    Attributes
    ----------
    accel_noise_ug, gyro_noise_dps : noise densities, ug/sqrt(Hz) and deg/s/sqrt(Hz).
    zero_rate_dps : within which a gyroscope at rest shows zero.
    """

    accel_noise_ug: float
    gyro_noise_dps: float
    zero_rate_dps: float


RATE_TOLERANCE = 0.01
OF_6050, OF_6500 = DataSheet(400.0, 0.005, 20.0), DataSheet(300.0, 0.01, 5.0)


def data_sheet(family: Family) -> DataSheet:
    """The one that holds for `family`."""
    return OF_6050 if family.packed_self_test else OF_6500
