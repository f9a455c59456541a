"""A vehicle's IMU streams: requested, their rates watched, and requested again when they fall."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Mapping

from ..clocks import S
from ..errors import LinkError
from .dialect import Message, dialect
from .firmwares import PX4, preferred_messages
from .imu import HIGHRES, MESSAGE_ID, RAW, Stream, decode_reading
from .link import Link
from .requests import encode_command, interval_command, send_command

# ArduPilot's rates at a loop of 400 Hz: the next lower one is requested after one that it denies.
LADDER_HZ = (200.0, 100.0, 50.0, 25.0, 10.0)
# A stream is there if so many messages come within ARRIVE_NS: over a slow radio the first ones come late. Its rate is
# measured over RATE_NS.
ARRIVE_NS, FEWEST_MESSAGES, RATE_NS = 3 * S, 3, S
ACK_S, ACK_TRIES = 0.7, 4
OTHER_IMUS = ("SCALED_IMU2", "SCALED_IMU3")

# Remedies, if another station lowers a stream. --streamrate is of stream groups. HIGHRES_IMU is in none, and PX4 has no
# groups: a station that lowers these requests them by name.
STREAMRATE, STOP_IT = "start MAVProxy with --streamrate=-1", "stop that one"
# PX4 sends everything less often when a link's bandwidth is used up.
TOO_MUCH = ", or its link is too slow for that (MAV_0_RATE and the like; give a lower --rate)"
# A stream is slow below this share of the requested rate. Of a PX4 then this multiple of the rate is requested.
SLOW_SHARE, PX4_MULTIPLE = 0.8, 2.0

WATCH_NS = 2 * S
FALLEN = 0.6
SAY_AGAIN_NS = 15 * S


class Streams:
    """The streams of all IMUs of the vehicle that `link` is locked to.

    Parameters
    ----------
    rate_hz : to request; the vehicle decides what it sends. say : shows the operator a sentence.
    """

    def __init__(
        self, link: Link, firmware: str, parameters: Mapping[str, float], rate_hz: float, say: Callable[[str], None]
    ) -> None:
        self._link = link
        self._is_px4 = firmware == PX4
        self._order = [name for name in preferred_messages(firmware, parameters) if name in MESSAGE_ID]
        self._parameters = parameters
        self._rate_hz = rate_hz
        self._say = say
        self._times: defaultdict[Stream, set[int]] = defaultdict(set)
        self._requested_hz: dict[str, float] = {}
        self._best_hz: dict[Stream, float] = {}
        self._fallen: list[Stream] = []
        self._takes_temperature = False
        self._window_ns = self._quiet_until_ns = 0
        link.subscribe(self._on_message)

    def start(self) -> Stream:
        """Request the streams of all IMUs; return that of the first IMU.

        Raises
        ------
        LinkError : the vehicle sends no accelerations and rates, whatever is requested.
        """
        first = self._start_first()
        for name in OTHER_IMUS:
            self._request_and_wait(name)
        self._takes_temperature = first.name == HIGHRES and not self._is_px4
        self._request_temperature()
        if self._measure_hz(first) < SLOW_SHARE * self._rate_hz and self._is_px4:
            # PX4 omits samples that come before the interval is over: it sends 125 Hz of 250 if 200 are requested.
            for name in self._requested_hz:
                self._requested_hz[name] = PX4_MULTIPLE * self._rate_hz
                self._request(name)
            list(self._link.messages(self._link.now_ns() + RATE_NS))
        self._restart_window()
        return first

    def watch(self) -> None:
        """Request again the streams that come slower than they did; call this often."""
        now_ns = self._link.now_ns()
        if now_ns - self._window_ns < WATCH_NS:
            return
        seconds = (now_ns - self._window_ns) / S
        rates = {stream: _rate_hz(stream, times, seconds) for stream, times in self._times.items()}
        self._restart_window()
        self._report_fallen(rates)
        if not self._best_hz:
            self._report_rates(rates)
        for stream in self._best_hz:
            if stream.name in self._requested_hz and rates.get(stream, 0.0) < FALLEN * self._expected_hz(stream):
                # The next window shows whether the rate is back: its answer is not waited for.
                self._request(stream.name)
                self._fallen.append(stream)
        for stream, rate_hz in rates.items():
            best_hz = max(rate_hz, self._best_hz.get(stream, 0.0))
            # A link may send at once what it held back, and then the stream seems faster than it was requested.
            self._best_hz[stream] = min(best_hz, self._requested_hz.get(stream.name, best_hz))

    def request_again(self) -> None:
        """Request all streams of a vehicle that was away, without waiting for answers."""
        for name in self._requested_hz:
            self._request(name)
        self._request_temperature()
        # A vehicle that was away was not slowed by another station.
        self._fallen = []
        self._restart_window()

    def _request_temperature(self) -> None:
        """Request RAW_IMU for IMU 1's own temperature, which ArduPilot's HIGHRES_IMU lacks; nothing depends on it."""
        if self._takes_temperature:
            self._link.send(encode_command(self._link, *interval_command(RAW, 500_000)))

    def _restart_window(self) -> None:
        self._times.clear()
        self._window_ns = self._link.now_ns()

    def _on_message(self, message: Message) -> None:
        content = decode_reading(message)
        if content is not None:
            self._times[content.stream].add(content.time)

    def _start_first(self) -> Stream:
        for name in self._order:
            if name not in OTHER_IMUS and self._request_and_wait(name) and self._arrives(name):
                return Stream(name, 1)
        # Older firmwares know REQUEST_DATA_STREAM (66); PX4 ignores it.
        group = dialect().MAV_DATA_STREAM_RAW_SENSORS
        self._link.send(self._link.encode("request_data_stream", group, round(self._rate_hz), 1))
        for name in self._order:
            if self._arrives(name):
                return Stream(name, 1)
        raise self._no_stream()

    def _request_and_wait(self, name: str) -> bool:
        """Request a message, at lower rates if it is denied; return False if it is refused."""
        m = dialect()
        for rate_hz in (self._rate_hz, *(rate for rate in LADDER_HZ if rate < self._rate_hz)):
            self._requested_hz[name] = rate_hz
            result = send_command(self._link, *self._interval_command(name), timeout_s=ACK_S, tries=ACK_TRIES)
            if result != m.MAV_RESULT_DENIED:
                # Without an answer the request may have been accepted; the messages that arrive will show it.
                return result in (m.MAV_RESULT_ACCEPTED, None)
        return False

    def _request(self, name: str) -> None:
        self._link.send(encode_command(self._link, *self._interval_command(name)))

    def _interval_command(self, name: str) -> tuple[int, int, int]:
        return interval_command(name, round(1e6 / self._requested_hz[name]))

    def _arrives(self, name: str) -> bool:
        """Wait for IMU 1's messages of that name; return True once enough came."""
        self._times.clear()
        until_ns = self._link.now_ns() + ARRIVE_NS
        return any(len(self._times[Stream(name, 1)]) >= FEWEST_MESSAGES for _ in self._link.messages(until_ns))

    def _measure_hz(self, stream: Stream) -> float:
        self._times.clear()
        begun_ns = self._link.now_ns()
        list(self._link.messages(begun_ns + RATE_NS))
        return len(self._times[stream]) * S / (self._link.now_ns() - begun_ns)

    def _expected_hz(self, stream: Stream) -> float:
        """Return a stream's best rate or, if it was slow from the beginning, the rate that the fastest stream has."""
        best_hz, fastest_hz = self._best_hz[stream], max(self._best_hz.values())
        return best_hz if best_hz >= FALLEN * fastest_hz else min(self._requested_hz[stream.name], fastest_hz)

    def _report_fallen(self, rates: Mapping[Stream, float]) -> None:
        """Say that a stream had become slow, unless it stopped: then no other station slowed it."""
        alive = [stream for stream in self._fallen if rates.get(stream)]
        self._fallen = []
        now_ns = self._link.now_ns()
        if not alive or now_ns < self._quiet_until_ns:
            return
        self._quiet_until_ns = now_ns + SAY_AGAIN_NS
        stream, best_hz = alive[0], self._best_hz[alive[0]]
        slowed = f"from {best_hz:.0f} Hz"
        if best_hz != self._expected_hz(stream):
            slowed = f"to {rates[stream]:.0f} Hz, where {self._requested_hz[stream.name]:.0f} were asked for"
        remedy = STOP_IT if self._is_px4 or stream.name == HIGHRES else STREAMRATE
        self._say(
            f"{stream.name} was slowed down {slowed}, and has been asked for again: "
            f"probably another ground station lowers it ({remedy}){TOO_MUCH if self._is_px4 else ''}."
        )

    def _report_rates(self, rates: Mapping[Stream, float]) -> None:
        """Say which streams the vehicle sends slower than requested, in the first window."""
        slow = [
            f"{s.name} at {hz:.0f} Hz"
            for s, hz in rates.items()
            if s.name in self._requested_hz and hz < SLOW_SHARE * self._rate_hz
        ]
        if slow:
            self._say(f"{self._rate_hz:.0f} Hz were asked for; the vehicle sends {', '.join(slow)}.")

    def _no_stream(self) -> LinkError:
        names = f"{self._order[0]} was" if self._is_px4 else f"{HIGHRES} and {RAW} were"
        remedy = "check that the link goes both ways, then start again"
        if self._link.signed_only:
            names, remedy = "they were", "give the vehicle's --signing-key: it signs, and ignores unsigned packets"
        elif not self._parameters:
            remedy = (
                f"check that the link goes both ways, as it answers nothing to system {self._link.own_system}; an"
                " ArduPilot with MAV_OPTIONS 1 hears one ground station alone: give that one's id (MAV_GCS_SYSID or"
                " SYSID_MYGCS, usually 255) with --source-system"
            )
        return LinkError(f"{self._link.vehicle} sends no IMU messages, though {names} asked for", remedy)


def _rate_hz(stream: Stream, times: Collection[int], seconds: float) -> float:
    """Return a stream's rate by its own clock, which a burst or a busy vehicle does not change."""
    span_us = (max(times) - min(times)) * stream.unit_us
    return (len(times) - 1) * 1e6 / span_us if len(times) > FEWEST_MESSAGES else len(times) / seconds
