"""A vehicle's IMU streams: asked for, their rates watched, asked for again."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Mapping

from ..errors import LinkError
from .dialect import Message, dialect
from .firmwares import PX4, preferred_messages
from .imu import HIGHRES, MESSAGE_ID, RAW, Stream, decode_reading
from .link import Link, S
from .request import send_command

US_PER_S = 1e6
# what ArduPilot gives at a loop of 400 Hz: a rate that it denies is followed by the next lower one
LADDER_HZ = (200.0, 100.0, 50.0, 25.0, 10.0)
# over a slow radio the first ones come late
ARRIVE_NS, ENOUGH, RATE_NS = 3 * S, 3, S
ACK_S, ACK_TRIES = 0.7, 4

# HIGHRES_IMU is in no stream group, and PX4 knows none: who lowers it asks for it by name
STREAMRATE, STOP_IT = "start MAVProxy with --streamrate=-1", "stop that one"
# of PX4, which sends everything less often where a link's bandwidth is used up
TOO_MUCH = ", or its link is too slow for that (MAV_0_RATE and the like; give a lower --rate)"
# of the rate asked for: where less comes of a PX4, it is asked for so much more
MOST, SOONER = 0.8, 2.0

WATCH_NS = 2 * S
FALLEN = 0.6
SAY_AGAIN_NS = 15 * S


class Streams:
    """The streams of all IMUs of the vehicle that `link` is locked to.

    Parameters
    ----------
    rate_hz : asked for; what comes is what the vehicle makes of it. say : tells the person a sentence.
    """

    def __init__(
        self, link: Link, firmware: str, parameters: Mapping[str, float], rate_hz: float, say: Callable[[str], None]
    ) -> None:
        self._link = link
        self._firmware = firmware
        self._order = [name for name in preferred_messages(firmware, parameters) if name in MESSAGE_ID]
        self._parameters = parameters
        self._rate_hz = rate_hz
        self._say = say
        self._times: defaultdict[Stream, set[int]] = defaultdict(set)
        self._wanted: dict[str, float] = {}
        self._best_hz: dict[Stream, float] = {}
        self._fallen: list[Stream] = []
        self._window_ns = self._quiet_until_ns = 0
        link.subscribe(self._hear)

    def start(self) -> Stream:
        """Ask for all of them; the stream of the first IMU.

        Raises
        ------
        LinkError : the vehicle sends no accelerations and rates, whatever it is asked.
        """
        first = self._first()
        for name in ("SCALED_IMU2", "SCALED_IMU3"):
            self._ask(name)
        if self._came_hz(first) < MOST * self._rate_hz and self._firmware == PX4:
            self._ask_sooner()
        self._times.clear()
        self._window_ns = self._link.now_ns()
        return first

    def _came_hz(self, stream: Stream) -> float:
        self._times.clear()
        begun_ns = self._link.now_ns()
        list(self._link.messages(begun_ns + RATE_NS))
        return len(self._times[stream]) * S / (self._link.now_ns() - begun_ns)

    def _ask_sooner(self) -> None:
        """PX4 leaves out every sample that comes before its interval is over: 125 Hz of 250 where 200 are asked for."""
        for name in self._wanted:
            self._wanted[name] = SOONER * self._rate_hz
            self._request(name)
        list(self._link.messages(self._link.now_ns() + RATE_NS))

    def watch(self) -> None:
        """Ask again for what comes slower than it did; call this often."""
        now_ns = self._link.now_ns()
        if now_ns - self._window_ns < WATCH_NS:
            return
        seconds = (now_ns - self._window_ns) / S
        rates = {stream: _rate_hz(stream, times, seconds) for stream, times in self._times.items()}
        self._times.clear()
        self._window_ns = now_ns
        self._tell(rates)
        if not self._best_hz:
            self._tell_what_comes(rates)
        for stream, best_hz in self._best_hz.items():
            if stream.name in self._wanted and rates.get(stream, 0.0) < FALLEN * self._expected_hz(stream, best_hz):
                self._again(stream)
        for stream, rate_hz in rates.items():
            best_hz = max(rate_hz, self._best_hz.get(stream, 0.0))
            # what a link held back comes in a burst
            self._best_hz[stream] = min(best_hz, self._wanted.get(stream.name, best_hz))

    def _expected_hz(self, stream: Stream, best_hz: float) -> float:
        """The rate to hold a stream to: its best, or, where it was slow from the beginning, what the fastest shows."""
        fastest_hz = max(self._best_hz.values())
        return best_hz if best_hz >= FALLEN * fastest_hz else min(self._wanted[stream.name], fastest_hz)

    def ask_again(self) -> None:
        """Ask for all of them without waiting for answers: of a vehicle that was away."""
        for name in self._wanted:
            self._request(name)
        # nobody slowed what was away
        self._fallen = []
        self._times.clear()
        self._window_ns = self._link.now_ns()

    def _hear(self, message: Message) -> None:
        content = decode_reading(message)
        if content is not None:
            self._times[content.stream].add(content.time)

    def _first(self) -> Stream:
        for name in self._order:
            stream = Stream(name, 1)
            if name not in ("SCALED_IMU2", "SCALED_IMU3") and self._ask(name) and self._arrives(stream):
                return stream
        self._request_data_stream()
        for name in self._order:
            if self._arrives(Stream(name, 1)):
                return Stream(name, 1)
        raise self._nothing()

    def _ask(self, name: str) -> bool:
        """Ask for a message by SET_MESSAGE_INTERVAL, at lower rates where it is denied; whether it was not refused."""
        m = dialect()
        for rate_hz in (self._rate_hz, *(rate for rate in LADDER_HZ if rate < self._rate_hz)):
            self._wanted[name] = rate_hz
            result = send_command(
                self._link,
                m.MAV_CMD_SET_MESSAGE_INTERVAL,
                MESSAGE_ID[name],
                round(US_PER_S / rate_hz),
                timeout_s=ACK_S,
                tries=ACK_TRIES,
            )
            if result != m.MAV_RESULT_DENIED:
                # no answer at all may be a lost one: what arrives tells
                return result in (m.MAV_RESULT_ACCEPTED, None)
        return False

    def _arrives(self, stream: Stream) -> bool:
        """Whether `stream` comes, waiting for it where it did not yet."""
        self._times.clear()
        until_ns = self._link.now_ns() + ARRIVE_NS
        return any(len(self._times[stream]) >= ENOUGH for _ in self._link.messages(until_ns))

    def _request_data_stream(self) -> None:
        """REQUEST_DATA_STREAM (66), which older firmwares know; PX4 ignores it."""
        vehicle, raw_sensors = self._link.vehicle, dialect().MAV_DATA_STREAM_RAW_SENSORS
        request = self._link.mav.request_data_stream_encode(
            vehicle.system, vehicle.component, raw_sensors, round(self._rate_hz), 1
        )
        self._link.send(request)

    def _again(self, stream: Stream) -> None:
        # its answer is not waited for: whether the rate is back shows in the next window
        self._request(stream.name)
        self._fallen.append(stream)

    def _request(self, name: str) -> None:
        vehicle, interval_us = self._link.vehicle, round(US_PER_S / self._wanted[name])
        params = (MESSAGE_ID[name], interval_us, 0, 0, 0, 0, 0)
        number = dialect().MAV_CMD_SET_MESSAGE_INTERVAL
        self._link.send(self._link.mav.command_long_encode(vehicle.system, vehicle.component, number, 0, *params))

    def _tell(self, rates: Mapping[Stream, float]) -> None:
        """Say what had fallen, where it still comes: a vehicle that fell silent was slowed by nobody."""
        alive = [stream for stream in self._fallen if rates.get(stream)]
        self._fallen = []
        now_ns = self._link.now_ns()
        if not alive or now_ns < self._quiet_until_ns:
            return
        self._quiet_until_ns = now_ns + SAY_AGAIN_NS
        is_px4 = self._firmware == PX4
        remedy = STOP_IT if is_px4 or alive[0].name == HIGHRES else STREAMRATE
        self._say(
            f"{alive[0].name} was slowed down {self._slowed(alive[0], rates)}, and has been asked for again: "
            f"another ground station lowers it ({remedy}){TOO_MUCH if is_px4 else ''}."
        )

    def _tell_what_comes(self, rates: Mapping[Stream, float]) -> None:
        """Say at first what a vehicle makes of the rate asked for."""
        slow = [
            f"{s.name} at {hz:.0f} Hz"
            for s, hz in rates.items()
            if s.name in self._wanted and hz < MOST * self._rate_hz
        ]
        if slow:
            self._say(f"{self._rate_hz:.0f} Hz were asked for; the vehicle sends {', '.join(slow)}.")

    def _slowed(self, stream: Stream, rates: Mapping[Stream, float]) -> str:
        best_hz = self._best_hz[stream]
        if best_hz == self._expected_hz(stream, best_hz):
            return f"from {best_hz:.0f} Hz"
        return f"to {rates[stream]:.0f} Hz, where {self._wanted[stream.name]:.0f} were asked for"

    def _nothing(self) -> LinkError:
        signed = self._link.signed_only
        names = f"{self._order[0]} was" if self._firmware == PX4 else f"{HIGHRES} and {RAW} were"
        remedy = "give the vehicle's --signing-key: it signs, and hears nobody who does not"
        check = "check that the link goes both ways, then start again"
        if not self._parameters:
            check = (
                f"check that the link goes both ways, as it answers nothing to system {self._link.own_system}; an"
                " ArduPilot with MAV_OPTIONS 1 hears one ground station alone: give that one's id (MAV_GCS_SYSID or"
                " SYSID_MYGCS, usually 255) with --source-system"
            )
        return LinkError(
            f"{self._link.vehicle} sends no IMU messages, though {'they were' if signed else names} asked for",
            remedy if signed else check,
        )


def _rate_hz(stream: Stream, times: Collection[int], seconds: float) -> float:
    """How often it came by its own clock; a burst or a busy vehicle are no other rate."""
    span_us = (max(times) - min(times)) * stream.unit_us
    return (len(times) - 1) * US_PER_S / span_us if len(times) > ENOUGH else len(times) / seconds
