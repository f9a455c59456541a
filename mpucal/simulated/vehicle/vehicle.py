"""Simulated vehicle, which receives and sends packets as its time is moved on."""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Iterable
from typing import Any

from ...clocks import US
from ...clocks.device_clocks import S_US
from ...data import STANDARD_GRAVITY_MPS2
from ...errors import UsageError
from ...mavlink.dialect import Message, Parser, dialect
from ...mavlink.link import OWN_COMPONENT, SEQUENCE
from ...mavlink.parameters.encoding import from_wire, name_bytes, to_wire
from ...mavlink.texts import ReceivedPrompt, decode_prompt
from ..faults import Schedule
from .ardupilot import ArduPilot
from .firmware import Firmware, ParameterStore
from .imus import Imus
from .options import VehicleOptions
from .px4 import Px4


class StreamTimes:
    """Schedule of the streams; a late stream skips the messages that it missed."""

    def __init__(self) -> None:
        self._interval_us: dict[int, int] = {}
        self._due_us: dict[int, int] = {}

    def set(self, message_id: int, interval_us: int, now_us: int) -> None:
        """Schedule a message every `interval_us` from now on; 0: never again."""
        if interval_us <= 0:
            self._interval_us.pop(message_id, None)
            return
        self._interval_us[message_id] = interval_us
        self._due_us[message_id] = now_us + interval_us

    def next_us(self) -> float:
        """Return the time of the next message, infinity if there is none."""
        return min((self._due_us[message_id] for message_id in self._interval_us), default=math.inf)

    def due(self, now_us: int, slower: int = 1) -> list[int]:
        """Return the messages due by `now_us`; `slower` stretches every interval."""
        due = [message_id for message_id in self._interval_us if self._due_us[message_id] <= now_us]
        for message_id in due:
            interval_us = self._interval_us[message_id] * slower
            self._due_us[message_id] = max(self._due_us[message_id] + interval_us, now_us - interval_us)
        return due


FIRMWARES: dict[str, type[Firmware]] = {"ardupilot": ArduPilot, "px4": Px4}

SLOWER_WHILE_BUSY = 4
# Names of MAV_TYPE.
TYPES = {"plane": "FIXED_WING", "copter": "QUADROTOR", "rover": "GROUND_ROVER"}
REBOOT_US = 2 * S_US


class SimulatedVehicle:
    """Vehicle in a hand, switched on at 0 us.

    Parameters
    ----------
    key : 32 bytes with which it signs and requires signatures, or None.
    """

    def __init__(
        self, options: VehicleOptions, gravity: float = STANDARD_GRAVITY_MPS2, key: bytes | None = None
    ) -> None:
        self.options = options
        self.firmware = FIRMWARES[options.firmware](options)
        for name, value in options.parameters.items():
            if name not in self.firmware.store:
                raise UsageError(f"the simulated vehicle has no parameter {name}", "omit it, or correct its name")
            self.firmware.store[name] = value
        self.imus = Imus(options, self.firmware.rotation, S_US / self.firmware.tick_us, gravity)
        self._mav: Any = dialect().MAVLink(None, options.system, dialect().MAV_COMP_ID_AUTOPILOT1)
        if key is not None:
            self._mav.signing.secret_key, self._mav.signing.sign_outgoing = key, True
        self._parser = Parser(self._mav)
        self._now_us = 0
        # Until then it neither sends nor receives, as during a boot.
        self._silent_until_us: float = 0
        self._schedule = Schedule(options.fault)
        self._out: deque[bytes] = deque()
        self._boot()
        if options.rotate_at is not None:
            self.imus.hear(ReceivedPrompt("rotate", None), options.rotate_at)

    @property
    def now_us(self) -> int:
        """Time of its world."""
        return self._now_us

    def receive(self, data: bytes, datagram: bool = True) -> None:
        """Receive a datagram of whole packets, or a piece of a stream."""
        if self._now_us < self._silent_until_us:
            return
        for packet in self._parser.datagram(data) if datagram else self._parser.stream(data):
            # A prompt goes to the hand, not to the firmware.
            kind = packet.message.get_type()
            accepted = kind == "STATUSTEXT" or self.firmware.accepts(packet.message.get_srcSystem())
            answer = getattr(self, f"_on_{kind.lower()}", None) if accepted else None
            if answer is not None and getattr(packet.message, "target_system", 0) in (0, self.options.system):
                answer(packet.message)

    def run_until(self, until_us: int) -> list[bytes]:
        """Move on to `until_us`; return the packets that were sent since the last call."""
        while self._now_us + self.firmware.tick_us <= until_us:
            self._run_ticks(until_us)
        return self._take_sent()

    def run_to_next(self, until_us: int) -> list[bytes]:
        """Move on until a packet may have been sent, at most to the first tick from `until_us` on; see `run_until`."""
        tick_us = self.firmware.tick_us
        self._run_ticks(max(-(-until_us // tick_us), self._now_us // tick_us + 1) * tick_us)
        return self._take_sent()

    def switch_on(self, store: ParameterStore) -> None:
        """Start with the parameters in `store`, and store changes there."""
        if store is not self.firmware.store:
            self.firmware.store = store
            self.firmware.start()

    def truth_document(self) -> dict[str, Any]:
        """Return the truth of IMU 1's stream and, as `others`, of the other streams under the present parameters."""
        of = self.firmware
        first, *others = (self.imus.truth(n, *of.correction(n), of.mounting) for n in range(self.options.imus))
        return {**first, "others": others}

    def _boot(self) -> None:
        self._booted_us = self._now_us
        self._streams = StreamTimes()
        self._set_intervals(((dialect().MAVLINK_MSG_ID_HEARTBEAT, S_US), *self.firmware.streams))
        self._list: deque[str] = deque()
        self.firmware.start()

    def _set_intervals(self, intervals: Iterable[tuple[int, int]]) -> None:
        for message_id, interval_us in intervals:
            self._streams.set(message_id, interval_us, self._now_us)

    def _take_sent(self) -> list[bytes]:
        sent = list(self._out)
        self._out.clear()
        return sent

    def _run_ticks(self, until_us: int) -> None:
        """Run one tick or more, none after `until_us`; only the last of them may send something."""
        tick_us, ticks = self.firmware.tick_us, 1
        if not (self._out or self._list):
            due_us = min(max(self._streams.next_us(), self._silent_until_us), self._schedule.next_ns() / US)
            due_us = min(due_us, until_us // tick_us * tick_us)
            ticks = max(math.ceil((due_us - self._now_us) / tick_us), 1)
        self.firmware.sense(self.imus, ticks - 1)
        self._now_us += ticks * tick_us
        for fault in self._schedule.due(self._now_us * US):
            if fault.kind.begin is not None:
                fault.kind.begin(self)
        self.firmware.sense(self.imus, 1)
        if self._now_us < self._silent_until_us:
            return
        for message_id in self._streams.due(self._now_us, SLOWER_WHILE_BUSY if self._list else 1):
            is_beat = message_id == dialect().MAVLINK_MSG_ID_HEARTBEAT
            message = self._heartbeat() if is_beat else self._message(message_id)
            if message is not None:
                self._send(message)
        if self._list:
            self._send_value(self._list.popleft())

    def _message(self, message_id: int) -> Message | None:
        return self.firmware.message(message_id, self._now_us - self._booted_us)

    def _heartbeat(self) -> Message:
        m = dialect()
        kind = getattr(m, f"MAV_TYPE_{TYPES[self.options.type]}")
        armed = (m.MAV_MODE_FLAG_SAFETY_ARMED, m.MAV_STATE_ACTIVE)
        mode, state = armed if self.firmware.armed else (0, m.MAV_STATE_STANDBY)
        return m.MAVLink_heartbeat_message(kind, self.firmware.autopilot, 81 | mode, 0, state, 3)

    def _send(self, message: Message) -> None:
        data = bytes(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % SEQUENCE
        self._out.append(data)

    def _send_value(self, name: str) -> None:
        store = self.firmware.store
        kind, index = store.type(name), list(store).index(name)
        value = to_wire(store[name], kind, self.firmware.bytewise)
        self._send(dialect().MAVLink_param_value_message(name_bytes(name), value, kind, len(store), index))

    def _on_param_request_read(self, message: Message) -> None:
        store = self.firmware.store
        name = message.param_id
        if message.param_index >= 0:
            name = next(itertools.islice(store, message.param_index, None), "")
        if name in store:
            self._send_value(name)
        elif self.firmware.bytewise:
            self._param_error(name, 1)

    def _on_param_request_list(self, message: Message) -> None:
        self._list = deque(self.firmware.store)

    def _on_param_set(self, message: Message) -> None:
        echoed = self.firmware.set(from_wire(message, self.firmware.bytewise))
        if isinstance(echoed, int):
            self._param_error(message.param_id, echoed)
            return
        for name in echoed:
            self._send_value(name)

    def _param_error(self, name: str, error: int) -> None:
        here = self._mav.srcSystem, self._mav.srcComponent
        self._send(dialect().MAVLink_param_error_message(*here, name_bytes(name), -1, error))

    def _on_request_data_stream(self, message: Message) -> None:
        rate_hz = message.req_message_rate if message.start_stop else 0
        self._set_intervals(self.firmware.group(rate_hz))

    def _on_command_long(self, message: Message) -> None:
        m = dialect()
        handlers = {
            m.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_message_interval,
            m.MAV_CMD_REQUEST_MESSAGE: self._request_message,
            m.MAV_CMD_RUN_PREARM_CHECKS: self._run_prearm_checks,
            m.MAV_CMD_PREFLIGHT_CALIBRATION: self._preflight_calibration,
            m.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: self._preflight_reboot,
        }
        answer = handlers.get(message.command)
        result = m.MAV_RESULT_UNSUPPORTED if answer is None else answer(message)
        self._send(m.MAVLink_command_ack_message(message.command, result))
        if answer == self._preflight_reboot and result == m.MAV_RESULT_ACCEPTED:
            self.reboot()

    def _set_message_interval(self, message: Message) -> int:
        message_id = int(message.param1)
        result, interval_us = self.firmware.interval(message_id, int(message.param2))
        if result == dialect().MAV_RESULT_ACCEPTED:
            self._set_intervals([(message_id, interval_us)])
        return result

    def _request_message(self, message: Message) -> int:
        if int(message.param1) == dialect().MAVLINK_MSG_ID_AUTOPILOT_VERSION:
            self._send(self.firmware.version())
            return int(dialect().MAV_RESULT_ACCEPTED)
        wanted = self._message(int(message.param1))
        if wanted is None:
            return int(dialect().MAV_RESULT_FAILED)
        if not self.firmware.sends_on_request:
            return int(dialect().MAV_RESULT_DENIED)
        self._send(wanted)
        return int(dialect().MAV_RESULT_ACCEPTED)

    def _run_prearm_checks(self, message: Message) -> int:
        if self.firmware.armed:
            return int(dialect().MAV_RESULT_TEMPORARILY_REJECTED)
        for complaint in self.firmware.complaints():
            self._send(dialect().MAVLink_statustext_message(dialect().MAV_SEVERITY_CRITICAL, complaint.encode()))
        return int(dialect().MAV_RESULT_ACCEPTED)

    def _preflight_calibration(self, message: Message) -> int:
        if self.firmware.armed or not self.firmware.calibrate(message.param5):
            return int(dialect().MAV_RESULT_FAILED)
        return int(dialect().MAV_RESULT_ACCEPTED)

    def _preflight_reboot(self, message: Message) -> int:
        if self.firmware.armed or message.param1 != 1:
            return int(dialect().MAV_RESULT_DENIED)
        return int(dialect().MAV_RESULT_ACCEPTED)

    def _on_statustext(self, message: Message) -> None:
        prompt = decode_prompt(message)
        if prompt is not None:
            self.imus.hear(prompt, self._now_us / S_US)

    # Faults.

    def arm(self) -> None:
        """Arm it."""
        self.firmware.armed = True

    def reboot(self) -> None:
        """Boot again, silent meanwhile."""
        self._silent_until_us = self._now_us + REBOOT_US
        self.imus.restart()
        self._boot()

    def learn_offsets(self) -> None:
        """Change the vehicle's own accelerometer offsets, and send them."""
        for name in self.firmware.learn_offsets():
            self._send_value(name)

    def fall_silent(self) -> None:
        """Stop sending and receiving until the end."""
        self._silent_until_us = math.inf

    def obey_second_station(self) -> None:
        """Set the 4 Hz that another ground station requests by default, and pass its HEARTBEAT on."""
        m = dialect()
        station = m.MAVLink_heartbeat_message(m.MAV_TYPE_GCS, m.MAV_AUTOPILOT_INVALID, 0, 0, m.MAV_STATE_ACTIVE, 3)
        self._out.append(bytes(station.pack(m.MAVLink(None, 255, OWN_COMPONENT))))
        self._set_intervals(self.firmware.group(4))
