"""A vehicle's parameters read and set over its link, and the list of those that act on its IMU streams."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain

from ...clocks import S
from ...errors import LinkError
from ..dialect import Message
from ..firmwares import EKF2_IMU_CTRL, FILTERS, PX4
from ..link import Link
from ..requests import ask
from .encoding import ERRORS, REAL32, as_float32, decode_parameter, name_bytes, to_wire
from .mounting import BOARD_ANGLES, BOARD_ROTATION, CUSTOM_ANGLES, ORIENTATION
from .slots import all_slots

# Over a radio that loses one packet in five each way, ten tries fail once in 30,000.
ANSWER_NS, TRIES = S // 2, 10
# A list of all parameters would slow every stream, so they are read by name; ArduPilot does not answer for one that
# it lacks. A name is given up after SILENT_ROUNDS without any answer: over a radio that loses one packet in five each
# way, this misses a parameter once in 10,000.
SILENT_ROUNDS = 8
AT_ONCE = 12


def stream_parameter_names(firmware: str) -> tuple[str, ...]:
    """Return the names of the parameters between the sensors and the streams, and of the sensors' ids."""
    if firmware == PX4:
        accs = [[slot.sensor_id, str(slot.priority), str(slot.rotation), *slot.names] for slot in all_slots(PX4)]
        gyros = [slot.gyro_offset for slot in all_slots(PX4)]
        return (EKF2_IMU_CTRL, BOARD_ROTATION, *BOARD_ANGLES, *chain(*accs), *chain(*gyros))
    return (ORIENTATION, *FILTERS, *(name for slot in all_slots(firmware) for name in (slot.sensor_id, *slot.names)))


def read_stream_parameters(link: Link) -> dict[str, float]:
    """Return those of `stream_parameter_names` that the vehicle has, and the angles of a custom orientation.

    Raises
    ------
    EndOfCapture, LinkError : see Link.messages.
    """
    held = read_parameters(link, stream_parameter_names(link.vehicle.family))
    return held | read_parameters(link, CUSTOM_ANGLES.get(round(held.get(ORIENTATION, 0)), ()))


def read_parameters(link: Link, names: Sequence[str]) -> dict[str, float]:
    """Return the values of those of `names` that the vehicle has.

    Raises
    ------
    EndOfCapture, LinkError : see Link.messages.
    """
    return dict(_request(link, names))


def require_parameters(link: Link, names: Sequence[str]) -> dict[str, float]:
    """Return the values of all of `names`.

    Raises
    ------
    LinkError : one does not come. EndOfCapture : a replay holds no more.
    """
    held = read_parameters(link, names)
    for name in names:
        if name not in held:
            raise LinkError(f"{link.vehicle} does not report {name}", "check the link and the firmware's version")
    return held


def read_agreed(link: Link, names: Sequence[str]) -> dict[str, float]:
    """Return the values of all of `names` if all answers agree: two senders with one vehicle's id do not.

    Raises
    ------
    LinkError : one does not come, or comes with two values. EndOfCapture : a replay holds no more.
    """
    held = require_parameters(link, names)
    for name, value in [*_request(link, names), *_answers(link, names)]:
        if value != held[name]:
            raise LinkError(
                f"{link.vehicle} answers {name} = {held[name]:.6g} and {value:.6g}",
                "find out who else writes parameters or answers as this vehicle; signing (--signing-key) excludes them",
            )
    return held


def set_parameter(link: Link, name: str, value: float, kind: int = REAL32) -> None:
    """Set a parameter of MAV_PARAM_TYPE `kind`, and wait until the vehicle confirms this value.

    Raises
    ------
    LinkError : it refused, or confirmed nothing, or another value. EndOfCapture : a replay holds no more.
    """
    bytewise = link.vehicle.family == PX4
    wanted = as_float32(value) if kind == REAL32 else value
    message = link.encode("param_set", name_bytes(name), to_wire(wanted, kind, bytewise), kind)

    def refusal(received: Message) -> str | None:
        """Return the reason of a refusal, "" of a confirmation; ArduPilot echoes earlier values before it."""
        if received.get_type() == "PARAM_ERROR" and received.param_id == name:
            return ERRORS.get(received.error, f"error {received.error}")
        parameter = decode_parameter(received, bytewise)
        return "" if parameter is not None and (parameter.name, parameter.value) == (name, wanted) else None

    why = ask(link, message, refusal, ANSWER_NS / S, TRIES)
    if why != "":
        raise LinkError(
            f"{link.vehicle} did not take {name} = {value:.6g}: {why or 'it did not confirm it'}",
            "check whether it is read-only there",
        )


def _request(link: Link, names: Sequence[str]) -> list[tuple[str, float]]:
    """Request `names` until all have come, or no more come; return every name and value that came."""
    heard: list[tuple[str, float]] = []
    for at in range(0, len(names), AT_ONCE):
        missing, silent = list(names[at : at + AT_ONCE]), 0
        while missing and silent < SILENT_ROUNDS:
            silent += 1
            for name in missing:
                link.send(link.encode("param_request_read", name_bytes(name), -1))
            for name, value in _answers(link, names):
                heard.append((name, value))
                if name in missing:
                    missing.remove(name)
                    silent = 0
                if not missing:
                    break
    return heard


def _answers(link: Link, names: Sequence[str]) -> Iterator[tuple[str, float]]:
    """Yield name and value of each of `names` that comes within ANSWER_NS."""
    for message in link.messages(link.now_ns() + ANSWER_NS):
        parameter = decode_parameter(message, link.vehicle.family == PX4)
        if parameter is not None and parameter.name in names:
            yield parameter.name, float(parameter.value)
