"""A vehicle's parameters read and set over its link, and the list of those that act on its IMU streams."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain

from ...errors import LinkError
from ..dialect import Message
from ..firmwares import EKF2_IMU_CTRL, FILTERS, PX4
from ..link import Link, S
from ..requests import ask
from .encoding import REAL32, as_float32, decode_parameter, error_name, name_bytes, to_wire
from .mounting import BOARD_ANGLES, BOARD_ROTATION, CUSTOM_ANGLES, ORIENTATION
from .slots import all_slots

# Over a radio that loses one packet in five each way, ten tries fail once in 30,000.
TIMEOUT_S, TRIES = 0.5, 10
# A second answer may come this much later than the first.
LATE_NS = S // 2


class ParameterClient:
    """Client of the parameters of the vehicle that `link` is locked to."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._bytewise = link.vehicle.family == PX4
        self._received: dict[str, set[float]] = {}
        link.subscribe(self._on_message)

    def read(self, names: Sequence[str]) -> dict[str, float]:
        """Return the values of all of `names`.

        Raises
        ------
        LinkError : one does not come. EndOfCapture : a replay holds no more.
        """
        held = read_parameters(self._link, names, self._link.vehicle.family)
        if missing := [name for name in names if name not in held]:
            raise LinkError(
                f"{self._link.vehicle} does not report {missing[0]}", "check the link and the firmware's version"
            )
        return held

    def read_agreed(self, names: Sequence[str]) -> dict[str, float]:
        """Return the values of all of `names` if all answers agree: two senders with one vehicle's id do not.

        Raises
        ------
        LinkError : one does not come, or comes with two values. EndOfCapture : a replay holds no more.
        """
        self._received = {name: set() for name in names}
        for _ in range(2):
            held = self.read(names)
        list(self._link.messages(self._link.now_ns() + LATE_NS))
        received, self._received = self._received, {}
        for name, values in received.items():
            if len(values) > 1:
                some = " and ".join(f"{value:.6g}" for value in sorted(values)[:2])
                raise LinkError(
                    f"{self._link.vehicle} answers {name} = {some}",
                    "find out who else writes parameters or answers as this vehicle; signing (--signing-key) excludes"
                    " them",
                )
        return held

    def set(self, name: str, value: float, kind: int = REAL32) -> None:
        """Set one, and wait until the vehicle confirms this value.

        Raises
        ------
        LinkError : it refused, or confirmed nothing, or another value. EndOfCapture : a replay holds no more.
        """
        wanted = as_float32(value) if kind == REAL32 else value
        message = self._link.encode("param_set", name_bytes(name), to_wire(wanted, kind, self._bytewise), kind)

        def refusal(received: Message) -> str | None:
            """Return the reason of a refusal, "" of a confirmation; ArduPilot echoes earlier values before it."""
            if received.get_type() == "PARAM_ERROR" and received.param_id == name:
                return error_name(received.error)
            parameter = decode_parameter(received, self._bytewise)
            return "" if parameter is not None and (parameter.name, parameter.value) == (name, wanted) else None

        why = ask(self._link, message, refusal, TIMEOUT_S, TRIES)
        if why != "":
            raise LinkError(
                f"{self._link.vehicle} did not take {name} = {value:.6g}: {why or 'it did not confirm it'}",
                "check whether it is read-only there",
            )

    def find_mismatches(self, values: Mapping[str, float]) -> dict[str, float]:
        """Read `values` back; return those that the vehicle holds otherwise, as it holds them."""
        held = self.read(tuple(values))
        return {name: held[name] for name, value in values.items() if held[name] != as_float32(value)}

    def _on_message(self, message: Message) -> None:
        parameter = decode_parameter(message, self._bytewise) if self._received else None
        if parameter is not None and parameter.name in self._received:
            self._received[parameter.name].add(parameter.value)


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
