"""Read the parameters that change what a vehicle's IMU streams hold: corrections, mounting, filters, sensor ids."""

from __future__ import annotations

from collections.abc import Sequence

from .dialect import Message
from .firmwares import EKF2_IMU_CTRL, FILTERS, PX4
from .link import Link, S
from .parameters.encoding import decode_parameter, name_bytes
from .parameters.names import CUSTOM_ANGLES

ORIENTATION = "AHRS_ORIENTATION"
AXES = "XYZ"
IMUS = 3
SLOTS = 4
# by name rather than as a list, which slows every stream: what one does not hold it does not answer (ArduPilot)
# a name is given up after so many rounds without any: over a radio that loses a packet in five each way, once in 10,000
ROUND_NS, SILENT_ROUNDS = S // 2, 8
AT_ONCE = 12


def stream_parameter_names(firmware: str) -> tuple[str, ...]:
    """Names of the parameters that stand between the sensors and the streams, and of the sensors' ids."""
    if firmware == PX4:
        kinds = ("ID", "PRIO", "ROT", *(f"{axis}{kind}" for kind in ("OFF", "SCALE") for axis in AXES))
        slots = [f"CAL_ACC{slot}_{kind}" for slot in range(SLOTS) for kind in kinds]
        board = [f"SENS_BOARD_{axis}_OFF" for axis in AXES]
        rates = [f"CAL_GYRO{slot}_{axis}OFF" for slot in range(SLOTS) for axis in AXES]
        return (EKF2_IMU_CTRL, "SENS_BOARD_ROT", *board, *slots, *rates)
    accs = ["INS_ACC", *(f"INS_ACC{imu}" for imu in range(2, IMUS + 1))]
    kinds = ("_ID", *(f"{kind}_{axis}" for kind in ("OFFS", "SCAL") for axis in AXES))
    return (ORIENTATION, *FILTERS, *(f"{acc}{kind}" for acc in accs for kind in kinds))


def read_stream_parameters(link: Link, firmware: str) -> dict[str, float]:
    """The values of `stream_parameter_names` that the vehicle holds, and the angles of a custom orientation.

    Raises
    ------
    EndOfCapture, LinkError : see Link.messages.
    """
    held = read_parameters(link, stream_parameter_names(firmware), firmware)
    angles = CUSTOM_ANGLES.get(round(held.get(ORIENTATION, 0)), ())
    return held | read_parameters(link, angles, firmware)


def read_parameters(link: Link, names: Sequence[str], firmware: str) -> dict[str, float]:
    """The values of those of `names` that the vehicle holds.

    Raises
    ------
    EndOfCapture, LinkError : see Link.messages.
    """
    held: dict[str, float] = {}
    for at in range(0, len(names), AT_ONCE):
        held |= _some(link, names[at : at + AT_ONCE], firmware)
    return held


def _some(link: Link, names: Sequence[str], firmware: str) -> dict[str, float]:
    held: dict[str, float] = {}
    silent = 0
    while silent < SILENT_ROUNDS:
        missing = [name for name in names if name not in held]
        _request(link, missing)
        before = len(held)
        for message in link.messages(link.now_ns() + ROUND_NS):
            _take(message, held, names, firmware)
            if len(held) == len(names):
                return held
        silent = silent + 1 if len(held) == before else 0
    return held


def _request(link: Link, names: Sequence[str]) -> None:
    vehicle = link.vehicle
    for name in names:
        link.send(link.mav.param_request_read_encode(vehicle.system, vehicle.component, name_bytes(name), -1))


def _take(message: Message, held: dict[str, float], names: Sequence[str], firmware: str) -> None:
    parameter = decode_parameter(message, firmware == PX4)
    if parameter is not None and parameter.name in names:
        held[parameter.name] = float(parameter.value)
