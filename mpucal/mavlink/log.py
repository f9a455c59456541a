"""A whole log of a vehicle, a .tlog of any ground station among them, made into a recording of each IMU.

What was measured under other corrections that are known is joined with what follows, in a session also what was
measured before a reboot; of stretches that cannot be joined the longest is taken.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from ..data import Recording
from ..errors import RecordingError
from ..rests.flat import find_flat
from .clock import US, Jump
from .dialect import Message, Parser, dialect, header
from .firmwares import ARDUPILOT, PX4, preferred_messages
from .imu import MESSAGE_ID, Reading, decode_reading
from .parameters.encoding import decode_parameter
from .segments import BEYOND, CORRECTIONS, SETTLED_US, Segment, find_recorrection, join_segments
from .stream_buffers import Row, StreamBuffers
from .tlog import Record

# whose change alters the streams
SHAPING = (*CORRECTIONS, *BEYOND)
# what firmwares' names are made of, and more of them than any has
NAME, MOST_PARAMETERS = re.compile(r"\w{1,16}", re.ASCII), 4096
IMU_MESSAGES = frozenset(MESSAGE_ID.values())


class Log:
    """Segments from the messages of one vehicle, as they come.

    Parameters
    ----------
    over_reboots : join what was measured before and after one; else the longest is taken, as an autopilot takes its
        gyroscope's bias anew at each start.

    Attributes
    ----------
    changed : the names of the parameters that were changed while it streamed.
    """

    def __init__(self, firmware: str, over_reboots: bool = False) -> None:
        self.firmware = firmware
        self._over_reboots = over_reboots
        self.segments = [Segment({})]
        self.changed: list[str] = []
        self._changed_ns: int | None = None
        self._now_ns = 0

    def add(self, message: Message, received_ns: int) -> None:
        """Take one message: an IMU's, or a parameter's."""
        self.add_other(message)
        content = decode_reading(message)
        if content is not None:
            self.add_reading(content, received_ns)

    def add_other(self, message: Message) -> None:
        """Take a message that is no IMU's."""
        parameter = decode_parameter(message, self.firmware == PX4)
        if parameter is not None:
            self.add_parameter(parameter.name, float(parameter.value))

    def add_parameter(self, name: str, value: float) -> None:
        """A parameter as the vehicle holds it from now on; one that no firmware has is none."""
        now = self.segments[-1]
        known = now.parameters
        if NAME.fullmatch(name) is None or (name not in known and len(known) >= MOST_PARAMETERS):
            return
        if len(now) and name.startswith(SHAPING) and now.parameters.get(name, value) != value:
            now = Segment(dict(now.parameters), now.buffers.following())
            self.segments.append(now)
            self.changed.append(name)
            self._changed_ns = self._now_ns
        now.parameters[name] = value

    def add_reading(self, content: Reading, received_ns: int) -> tuple[Row | None, Jump]:
        """An IMU's reading, as it would be under the first parameters; and what the clock did. See StreamBuffer.add."""
        self._now_ns = received_ns
        now = self.segments[-1]
        buffer = now.buffers.of(content.stream)
        t_us, jump = buffer.clock.unwrap(content.time, received_ns)
        # each stream's clock tells of the same reboot
        if jump is Jump.REBOOT and len(buffer):
            after = now.buffers.following() if self._over_reboots else StreamBuffers()
            now = Segment(dict(now.parameters), after, rebooted=True)
            self.segments.append(now)
            buffer = after.of(content.stream)
            t_us = t_us if self._over_reboots else buffer.clock.unwrap(content.time, received_ns)[0]
        row = buffer.keep(t_us, content)
        return (None if row is None else self._as_at_first(row)), jump

    def _as_at_first(self, row: Row) -> Row | None:
        """A row whose correction was changed meanwhile; None while it changes."""
        if self._changed_ns is None:
            return row
        if self._now_ns - self._changed_ns < SETTLED_US * US:
            return None
        content = row.reading
        back = find_recorrection(
            self.firmware, content.stream.imu, self.segments[-1].parameters, self.segments[0].parameters
        )
        if back is None:
            return row
        acc, gyr = back.acc(np.array(content.acc)).tolist(), back.gyr(np.array(content.gyr)).tolist()
        return Row(row.t_us, replace(content, acc=tuple(acc), gyr=tuple(gyr)))

    def forget(self) -> None:
        """Let go of all readings so far, and go on under the same parameters."""
        self.segments = self.segments[-1:]
        self._changed_ns = None
        self.segments[0].buffers.forget()

    def recording(self, name: str) -> Recording:
        """The first IMU's recording of the longest segment, with the others' in `others`.

        Raises
        ------
        RecordingError : it holds no IMU messages that tell the truth.
        """
        longest = join_segments(self.segments, self.firmware, self._over_reboots)
        order = preferred_messages(self.firmware, longest.parameters)
        recordings = longest.buffers.recordings(order, name, self.firmware, longest.parameters)
        if not recordings:
            raise _no_imu(name, self.firmware, longest.buffers)
        return with_others(recordings)


def with_others(recordings: list[Recording]) -> Recording:
    """The first of a vehicle's recordings, holding the others, each with its flat segment.

    The flat segment is sought before single lost packets are taken for gaps, of which a radio has one a second.
    """
    first, *others = [replace(recording, flat=find_flat(recording)) for recording in recordings]
    return replace(first, others=tuple(others))


def read_log(records: Iterable[Record], name: str, system: int | None = None) -> Recording:
    """The recording in a .tlog.

    Parameters
    ----------
    records : of the .tlog, gone through twice. name : what to call it. system : whose, of several vehicles in it.

    Raises
    ------
    RecordingError : it holds none, or several vehicles, or no IMU messages that tell the truth.
    """
    vehicles = _vehicles(records)
    if system is not None:
        vehicles = {ids: firmware for ids, firmware in vehicles.items() if ids[0] == system}
    if len(vehicles) != 1:
        raise _not_one(name, vehicles)
    ((ids, firmware),) = vehicles.items()
    log = Log(firmware)
    for t_ns, message in _messages(records):
        if _sender(message) == ids:
            log.add(message, t_ns)
    return log.recording(name)


def _messages(records: Iterable[Record]) -> Iterator[tuple[int, Message]]:
    parser = Parser(dialect().MAVLink(None))
    for record in records:
        for packet in parser.datagram(record.data):
            yield record.t_ns, packet.message


def _sender(message: Message) -> tuple[int, int]:
    return message.get_srcSystem(), message.get_srcComponent()


def _vehicles(records: Iterable[Record]) -> dict[tuple[int, int], str]:
    """(system, component) of those who sent an autopilot's HEARTBEAT and IMU messages, with their firmware."""
    m = dialect()
    firmware: dict[tuple[int, int], str] = {}
    imu: set[tuple[int, int]] = set()

    def is_identifying(record: Record) -> bool:
        message_id, ids = header(record.data)
        return message_id == m.MAVLINK_MSG_ID_HEARTBEAT or (ids not in imu and message_id in IMU_MESSAGES)

    # most of a log is one IMU's messages: decoding the first of them is enough
    for _, message in _messages(record for record in records if is_identifying(record)):
        ids = _sender(message)
        if message.get_type() == "HEARTBEAT" and message.autopilot != m.MAV_AUTOPILOT_INVALID:
            firmware[ids] = PX4 if message.autopilot == m.MAV_AUTOPILOT_PX4 else ARDUPILOT
        elif ids not in imu and decode_reading(message) is not None:
            imu.add(ids)
    return {ids: name for ids, name in firmware.items() if ids in imu} or firmware


def _not_one(name: str, vehicles: Mapping[tuple[int, int], str]) -> RecordingError:
    if not vehicles:
        return RecordingError(f"{name} holds no autopilot's heartbeat", "give a .tlog of a link to the vehicle")
    listed = ", ".join(f"system {system} ({firmware})" for (system, _), firmware in sorted(vehicles.items()))
    return RecordingError(f"{name} holds several vehicles: {listed}", "record the one to calibrate alone")


def _no_imu(name: str, firmware: str, buffers: StreamBuffers) -> RecordingError:
    if firmware == PX4 and buffers.streams:
        return RecordingError(
            f"{name} holds only PX4's HIGHRES_IMU, from which the estimator's bias is subtracted already",
            "record SCALED_IMU, as `mpucal session --mavlink` does, or clear bits 0 and 1 of EKF2_IMU_CTRL before",
        )
    return RecordingError(
        f"{name} holds no accelerations and rates",
        "record RAW_IMU or HIGHRES_IMU at 50 Hz or more, or let `mpucal session --mavlink` do it",
    )
