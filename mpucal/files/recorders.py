"""Table of the drivers that record captures: the version in the head says how to decode and replay the records."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from ..chip.config import Config, RateOnlyConfig
from ..chip.driver import DRIVER_VERSION
from ..errors import CaptureError
from ..iio import IIO_VERSION
from ..mavlink import MAVLINK_VERSION

# Key of a capture's head.
DRIVER = "driver"


class Recorder(NamedTuple):
    """Driver that records captures.

    Attributes
    ----------
    version : number, or a word and a number. A capture of another version of the same driver is decoded, not replayed.
    config : class of the sensor's settings in the head.
    opened : "module:class" of an OpenedSource, whose `replayed` opens a replay.
    decoder : "module:class" of the decoder of its accesses.
    """

    version: int | str
    config: type[Config]
    opened: str
    decoder: str = ""

    @property
    def family(self) -> str:
        """Name of the driver without its version; empty for the driver of chips."""
        return _family(self.version)


CHIP = Recorder(DRIVER_VERSION, Config, "mpucal.sources.chip:OpenedChip", "mpucal.chip.decode:Decoder")
VEHICLE = Recorder(MAVLINK_VERSION, RateOnlyConfig, "mpucal.vehicle.source:OpenedVehicle")
RECORDERS = [
    CHIP,
    VEHICLE,
    Recorder(IIO_VERSION, RateOnlyConfig, "mpucal.iio_device.source:OpenedIio", "mpucal.iio.decode:IioDecoder"),
]


def recorder_of(meta: Mapping[str, Any], name: str, same: bool = False) -> Recorder:
    """Return what recorded the capture `name` with that head; a chip's driver if the head does not say it.

    Parameters
    ----------
    same : it must be of the same version, for a replay.

    Raises
    ------
    CaptureError : an unknown driver, or another version of it.
    """
    version = meta.get(DRIVER)
    for recorder in RECORDERS:
        if version == recorder.version or (not same and _family(version) == recorder.family):
            return recorder
    present = next((recorder.version for recorder in RECORDERS if recorder.family == _family(version)), DRIVER_VERSION)
    raise CaptureError(
        f"{name} was recorded by version {version} of the driver, and this is {present}",
        "use `mpucal calibrate`, which reads captures of every version" if same else "use the mpucal that recorded it",
    )


def _family(version: Any) -> str:
    return version.rpartition(" ")[0] if isinstance(version, str) else ""
