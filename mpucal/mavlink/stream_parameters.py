"""Parameters that change what a vehicle's IMU streams hold: corrections, mounting, filters, sensor ids."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

from .firmwares import EKF2_IMU_CTRL, FILTERS, PX4
from .link import Link, S
from .parameters.encoding import decode_parameter, name_bytes
from .parameters.mounting import BOARD_ANGLES, BOARD_ROTATION, CUSTOM_ANGLES, ORIENTATION
from .parameters.slots import all_slots

# A list of all parameters would slow every stream, so they are read by name; ArduPilot does not answer for one that
# it lacks. A name is given up after SILENT_ROUNDS without any answer: over a radio that loses one packet in five each
# way, this misses a parameter once in 10,000.
ROUND_NS, SILENT_ROUNDS = S // 2, 8
AT_ONCE = 12


def stream_parameter_names(firmware: str) -> tuple[str, ...]:
    """Return the names of the parameters between the sensors and the streams, and of the sensors' ids."""
    if firmware == PX4:
        accs = [[slot.sensor_id, str(slot.priority), str(slot.rotation), *slot.names] for slot in all_slots(PX4)]
        gyros = [slot.gyro_offset for slot in all_slots(PX4)]
        return (EKF2_IMU_CTRL, BOARD_ROTATION, *BOARD_ANGLES, *chain(*accs), *chain(*gyros))
    return (ORIENTATION, *FILTERS, *(name for slot in all_slots(firmware) for name in (slot.sensor_id, *slot.names)))


def read_stream_parameters(link: Link, firmware: str) -> dict[str, float]:
    """Return those of `stream_parameter_names` that the vehicle has, and the angles of a custom orientation.

    Raises
    ------
    EndOfCapture, LinkError : see Link.messages.
    """
    held = read_parameters(link, stream_parameter_names(firmware), firmware)
    angles = CUSTOM_ANGLES.get(round(held.get(ORIENTATION, 0)), ())
    return held | read_parameters(link, angles, firmware)


def read_parameters(link: Link, names: Sequence[str], firmware: str) -> dict[str, float]:
    """Return the values of those of `names` that the vehicle has.

    Raises
    ------
    EndOfCapture, LinkError : see Link.messages.
    """
    held: dict[str, float] = {}
    for at in range(0, len(names), AT_ONCE):
        held |= _read_together(link, names[at : at + AT_ONCE], firmware)
    return held


def _read_together(link: Link, names: Sequence[str], firmware: str) -> dict[str, float]:
    held: dict[str, float] = {}
    silent = 0
    while silent < SILENT_ROUNDS:
        before = len(held)
        for name in names:
            if name not in held:
                link.send(link.encode("param_request_read", name_bytes(name), -1))
        for message in link.messages(link.now_ns() + ROUND_NS):
            parameter = decode_parameter(message, firmware == PX4)
            if parameter is not None and parameter.name in names:
                held[parameter.name] = float(parameter.value)
            if len(held) == len(names):
                return held
        silent = silent + 1 if len(held) == before else 0
    return held
