"""The log of a vehicle, such as a .tlog of any ground station, made into a recording of each IMU.

Parts under other corrections that are known are joined; in a session, parts before and after a reboot are joined too.
Of parts that cannot be joined the longest is taken.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from ..clocks import US
from ..clocks.device_clocks import Jump
from ..data import Recording
from ..errors import RecordingError
from ..rests.flat import find_flat
from .dialect import Message, Parser, dialect, read_header
from .firmwares import PX4, Vehicle, vehicle_of
from .imu import HIGHRES, MESSAGE_ID, RAW, Reading, Stream, decode_reading
from .parameters.encoding import decode_parameter
from .segments import ALTERING, SETTLED_US, find_recorrection, join_segments
from .stream_buffers import Row, Segment
from .tlog import RawPacket

# Firmwares make names of these characters; none has more parameters.
NAME = re.compile(r"\w{1,16}", re.ASCII)
MOST_PARAMETERS = 4096
IMU_MESSAGES = frozenset(MESSAGE_ID.values())


class Log:
    """Segments made from the messages of one vehicle, as they come.

    Parameters
    ----------
    over_reboots : join the parts before and after a reboot; otherwise the longest is taken, as an autopilot estimates
        its gyroscope's bias again at each start.

    Attributes
    ----------
    changed : names of the parameters that were changed while the vehicle streamed. first : their values before.
    latest : time of the latest reading [us], and when it was received [ns]; zeros before it.
    """

    def __init__(self, firmware: str, over_reboots: bool = False) -> None:
        self.firmware = firmware
        self._over_reboots = over_reboots
        self.segments = [Segment({})]
        self.changed: list[str] = []
        self.first: dict[str, float] = {}
        self.latest = 0.0, 0
        self._changed_ns: int | None = None
        self._now_ns = 0
        self._own_c = math.nan

    def add(self, message: Message, received_ns: int) -> tuple[Row | None, Jump]:
        """Add a message, which is ignored if it holds neither a parameter nor a reading; see `add_reading`."""
        parameter = decode_parameter(message, self.firmware == PX4)
        if parameter is not None:
            self.add_parameter(parameter.name, float(parameter.value))
        content = decode_reading(message)
        return (None, Jump.NONE) if content is None else self.add_reading(content, received_ns)

    def add_parameter(self, name: str, value: float) -> None:
        """Add a parameter that the vehicle holds from now on; a name that no firmware uses is ignored."""
        now = self.segments[-1]
        known = now.parameters
        if NAME.fullmatch(name) is None or (name not in known and len(known) >= MOST_PARAMETERS):
            return
        if len(now) and name.startswith(ALTERING) and known.get(name, value) != value:
            now = now.following()
            self.segments.append(now)
            self.changed.append(name)
            self.first.setdefault(name, known[name])
            self._changed_ns = self._now_ns
        now.parameters[name] = value

    def add_reading(self, content: Reading, received_ns: int) -> tuple[Row | None, Jump]:
        """Add an IMU's reading.

        Returns
        -------
        The reading as it would be under the first parameters, None if it is late or its correction is being changed;
        and the clock's jump before it.
        """
        self._now_ns = received_ns
        content = self._with_own_temperature(content)
        now = self.segments[-1]
        buffer = now.of(content.stream)
        t_us, jump = buffer.clock.unwrap(content.time, received_ns)
        # Each stream's clock shows the same reboot.
        if jump is Jump.REBOOT and len(buffer):
            now = now.following(rebooted=True)
            if not self._over_reboots:
                now.streams.clear()
                t_us, _ = now.of(content.stream).clock.unwrap(content.time, received_ns)
            self.segments.append(now)
            buffer = now.of(content.stream)
        row, late = Row(t_us, content), jump is Jump.LATE
        self.latest = float(t_us), received_ns
        buffer.add(row, late)
        return (None if late else self._under_first(row)), jump

    def _with_own_temperature(self, content: Reading) -> Reading:
        """Return a reading of IMU 1 with its own temperature: ArduPilot's HIGHRES_IMU has the barometer's."""
        if content.stream == Stream(RAW, 1):
            self._own_c = content.temperature_c
        elif content.stream == Stream(HIGHRES, 1) and self.firmware != PX4:
            return content._replace(temperature_c=self._own_c)
        return content

    def _under_first(self, row: Row) -> Row | None:
        if self._changed_ns is None:
            return row
        if self._now_ns - self._changed_ns < SETTLED_US * US:
            return None
        content, first = row.reading, self.segments[0].parameters
        back = find_recorrection(self.firmware, content.stream.imu, self.segments[-1].parameters, first)
        if back is None:
            return row
        acc, gyr = back.acc(np.array(content.acc)).tolist(), back.gyr(np.array(content.gyr)).tolist()
        return Row(row.t_us, content._replace(acc=tuple(acc), gyr=tuple(gyr)))

    def forget(self) -> None:
        """Drop all readings so far, and go on under the same parameters."""
        self.segments = [self.segments[-1].following()]
        self._changed_ns = None

    def recording(self, name: str) -> Recording:
        """Return the first IMU's recording of the longest segment, with the other IMUs' in `others`.

        The flat segments are found before single lost packets are taken for gaps, of which a radio has one a second.

        Raises
        ------
        RecordingError : it holds no IMU messages that a calibration may take.
        """
        longest = join_segments(self.segments, self.firmware, self._over_reboots)
        recordings = longest.recordings(self.firmware, name, self.first)
        if not recordings:
            raise _no_imu(name, self.firmware, longest)
        first, *others = [replace(recording, flat=find_flat(recording)) for recording in recordings]
        return replace(first, others=tuple(others))


def read_log(
    records: Iterable[RawPacket], name: str, system: int | None = None, over_reboots: bool = False
) -> Recording:
    """Return the recording in the log of one vehicle.

    Parameters
    ----------
    records : read twice. name : of the recording. system : id of one of several vehicles in it.
    over_reboots : see Log.

    Raises
    ------
    RecordingError : it holds no vehicle, several, or no IMU messages that a calibration may take.
    """
    vehicles = _vehicles(records)
    if system is not None:
        vehicles = {ids: vehicle for ids, vehicle in vehicles.items() if ids[0] == system}
    if len(vehicles) != 1:
        raise _not_one(name, vehicles)
    ((ids, vehicle),) = vehicles.items()
    log = Log(vehicle.family, over_reboots)
    for t_ns, message in _messages(records):
        if _sender(message) == ids:
            log.add(message, t_ns)
    return log.recording(name)


def _messages(records: Iterable[RawPacket]) -> Iterator[tuple[int, Message]]:
    parser = Parser(dialect().MAVLink(None))
    for record in records:
        for packet in parser.datagram(record.data):
            yield record.t_ns, packet.message


def _sender(message: Message) -> tuple[int, int]:
    return message.get_srcSystem(), message.get_srcComponent()


def _vehicles(records: Iterable[RawPacket]) -> dict[tuple[int, int], Vehicle]:
    """Return the vehicles by (system, component): those that sent IMU messages or, if none did, all."""
    vehicles: dict[tuple[int, int], Vehicle] = {}
    imu: set[tuple[int, int]] = set()

    def is_identifying(record: RawPacket) -> bool:
        message_id, ids = read_header(record.data)
        return message_id == dialect().MAVLINK_MSG_ID_HEARTBEAT or (ids not in imu and message_id in IMU_MESSAGES)

    # Most of a log are one IMU's messages: it is enough to decode the first of them.
    for _, message in _messages(record for record in records if is_identifying(record)):
        ids = _sender(message)
        vehicle = vehicle_of("", message)
        if vehicle is not None:
            vehicles[ids] = vehicle
        elif ids not in imu and decode_reading(message) is not None:
            imu.add(ids)
    return {ids: vehicle for ids, vehicle in vehicles.items() if ids in imu} or vehicles


def _not_one(name: str, vehicles: Mapping[tuple[int, int], Vehicle]) -> RecordingError:
    if not vehicles:
        return RecordingError(f"{name} holds no autopilot's heartbeat", "give a .tlog of a link to the vehicle")
    listed = ", ".join(f"system {system} ({vehicle.family})" for (system, _), vehicle in sorted(vehicles.items()))
    return RecordingError(f"{name} holds several vehicles: {listed}", "record the one to calibrate alone")


def _no_imu(name: str, firmware: str, segment: Segment) -> RecordingError:
    if firmware == PX4 and segment.streams:
        return RecordingError(
            f"{name} holds only PX4's HIGHRES_IMU, from which the estimator's bias is subtracted already",
            "record SCALED_IMU, as `mpucal session --mavlink` does, or clear bits 0 and 1 of EKF2_IMU_CTRL before",
        )
    return RecordingError(
        f"{name} holds no accelerations and rates",
        "record RAW_IMU or HIGHRES_IMU at 50 Hz or more, or let `mpucal session --mavlink` do it",
    )
