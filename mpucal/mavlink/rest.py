"""A vehicle at rest: its mean accelerations, its rotation between two rests, and its horizon against gravity."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..calibration.rotation import rotation
from ..clocks import S
from ..data import Vector
from ..errors import LinkError
from ..rests.limits import QUIET
from ..rests.stillness import Detector, Still
from ..rests.windows import of_rows
from .dialect import Message, dialect
from .imu import Reading, Stream, decode_reading
from .link import Link
from .parameters.mounting import attitude_deg
from .requests import interval_command, send_command

# A stream that fills no window in SLOW_NS does not come at all.
WINDOW_NS, PATIENCE_NS, SLOW_NS = 2 * S, 30 * S, 60 * S
FEWEST = 20
LONGEST_STEP_S = 1.0


@dataclass(frozen=True)
class RestMeans:
    """The streams of a vehicle at rest.

    Attributes
    ----------
    mean : (3,) m/s^2 of each stream. error : (3,) standard deviations of the means.
    attitude : (3, 3) at the end, from the vehicle's axes to those at the start, by the first stream's gyroscope.
    """

    mean: dict[Stream, Vector]
    error: dict[Stream, Vector]
    attitude: Vector


class RestMonitor:
    """Listener to the streams of a locked link, which waits for rests.

    Parameters
    ----------
    streams : one of each IMU; they are requested, and left on.
    """

    def __init__(self, link: Link, streams: Sequence[Stream]) -> None:
        self._link = link
        self._streams = tuple(streams)
        self._attitude: Vector = np.eye(3)
        self._gyro_bias: Vector | None = None
        self._last: int | None = None
        self._window: dict[Stream, list[Reading]] = {}
        link.subscribe(self._on_message)

    def wait(self) -> RestMeans | None:
        """Wait until all streams were at rest for two windows; return the second, None if they were not.

        There are two because an operator who is told to set the vehicle down takes a second to begin.

        Raises
        ------
        LinkError : a stream does not come. EndOfCapture : a replay holds no more.
        """
        end_ns = self._link.now_ns() + PATIENCE_NS
        self._request()
        # An autopilot has subtracted the gyroscopes' biases.
        detectors = {stream: Detector(QUIET, bias=np.zeros(3)) for stream in self._streams}
        before: list[int | None] | None = None
        while True:
            self._listen()
            runs = [_rest_number(detectors[stream], self._window[stream]) for stream in self._streams]
            now = None if None in runs else self._means()
            if now is not None and runs == before:
                return now
            before = runs
            if self._link.now_ns() >= end_ns:
                return None

    def _listen(self) -> None:
        """Fill a window, which takes longer where the vehicle is slow, or has forgotten the request in a reboot."""
        self._window = {stream: [] for stream in self._streams}
        end_ns = self._link.now_ns() + SLOW_NS
        while True:
            list(self._link.messages(self._link.now_ns() + WINDOW_NS))
            fewest = min(self._streams, key=lambda stream: len(self._window[stream]))
            if len(self._window[fewest]) >= FEWEST:
                return
            if self._link.now_ns() >= end_ns:
                raise LinkError(
                    f"{self._link.vehicle} does not send {fewest.name} though it was asked for",
                    "check the link, and that no other ground station lowers its rates",
                )
            self._request()

    def _request(self) -> None:
        for stream in self._streams:
            send_command(self._link, *interval_command(stream.name), tries=5)

    def _on_message(self, message: Message) -> None:
        content = decode_reading(message)
        if content is None or content.stream not in self._streams:
            return
        self._window.setdefault(content.stream, []).append(content)
        if content.stream != self._streams[0]:
            return
        step_s = 0.0 if self._last is None else (content.time - self._last) * content.stream.unit_us * 1e-6
        self._last = content.time
        if self._gyro_bias is not None and 0 < step_s < LONGEST_STEP_S:
            self._attitude = self._attitude @ rotation((np.array(content.gyr) - self._gyro_bias) * step_s)

    def _means(self) -> RestMeans:
        mean, error = {}, {}
        for stream, readings in self._window.items():
            acc = np.array([r.acc for r in readings])
            mean[stream] = acc.mean(axis=0)
            # A hand trembles slowly: its samples are not independent.
            error[stream] = acc.std(axis=0) / 4
        self._gyro_bias = np.mean([r.gyr for r in self._window[self._streams[0]]], axis=0)
        return RestMeans(mean, error, self._attitude)


def _rest_number(detector: Detector, readings: Sequence[Reading]) -> int | None:
    """Return the detector's number of the rest that lasts throughout `readings`, None if they moved."""
    rows = np.array([(r.acc, r.gyr) for r in readings])
    # By halves: a steady rotation is in another orientation in the second.
    sights = [detector.add(of_rows(half[:, 0], half[:, 1])) for half in np.array_split(rows, 2)]
    runs = {sight.run if isinstance(sight, Still) else None for sight in sights}
    return runs.pop() if len(runs) == 1 else None


ATTITUDE = "ATTITUDE"
HEARD_NS, BACK_NS, SETTLED_NS = 5 * S, 60 * S, 60 * S
# Two comparisons in succession that differ by no more show that the estimator has settled.
STEADY_DEG = 0.05


class Attitude(NamedTuple):
    """Attitude that a vehicle at rest reports, as roll and pitch (2,) [deg], and its difference from gravity."""

    roll_pitch_deg: Vector
    error_deg: Vector


class Horizon:
    """Listener to the attitude of the vehicle that `link` is locked to."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._boot_ms: int | None = None
        # Time [ns] of the link, roll and pitch [deg]
        self._heard: deque[tuple[int, float, float]] = deque(maxlen=1000)
        link.subscribe(self._on_message)

    def reboot(self) -> bool:
        """Reboot the vehicle, and wait until it is back; return False if it refused.

        Raises
        ------
        LinkError : it does not come back.
        """
        m = dialect()
        self._request()
        self._listen(HEARD_NS)
        before_ms, self._boot_ms = self._boot_ms or 0, None
        # Only once: a second command might reach the vehicle after its start.
        answer = send_command(self._link, m.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1, timeout_s=3, tries=1)
        if answer not in (None, m.MAV_RESULT_ACCEPTED):
            return False
        self._link.seek()

        def is_back() -> bool:
            self._boot_ms = None
            self._request()
            self._listen(S)
            return self._boot_ms is not None and self._boot_ms < before_ms

        if not self._link.succeeds(is_back, BACK_NS):
            raise LinkError(f"{self._link.vehicle} did not come back after its reboot", "check its power and the link")
        self._heard.clear()
        return True

    def settled(self, stream: Stream, trim_deg: Vector) -> Attitude | None:
        """Return the attitude once it has settled, compared with gravity; None if the vehicle does not rest.

        Parameters
        ----------
        stream : of the first IMU. trim_deg : (3,) the vehicle's.

        Raises
        ------
        LinkError : a stream does not come.
        """
        monitor = RestMonitor(self._link, [stream])
        end_ns = self._link.now_ns() + SETTLED_NS
        before: Vector | None = None
        while True:
            self._request()
            rest = monitor.wait()
            since_ns = self._link.now_ns() - WINDOW_NS
            heard = [angles for t_ns, *angles in self._heard if t_ns >= since_ns]
            if rest is None or not heard:
                return None
            shown = np.mean(heard, axis=0)
            apart = shown - attitude_deg(self._link.vehicle.family, trim_deg, rest.mean[stream])
            steady = before is not None and np.abs(apart - before).max() <= STEADY_DEG
            if steady or self._link.now_ns() >= end_ns:
                return Attitude(shown, apart)
            before = apart

    def _request(self) -> None:
        send_command(self._link, *interval_command(ATTITUDE))

    def _listen(self, for_ns: int) -> None:
        """Wait for the next ATTITUDE, at most `for_ns`."""
        for _ in self._link.messages(self._link.now_ns() + for_ns):
            if self._boot_ms is not None:
                return

    def _on_message(self, message: Message) -> None:
        if message.get_type() == ATTITUDE:
            self._boot_ms = message.time_boot_ms
            self._heard.append((self._link.now_ns(), *np.degrees([message.roll, message.pitch]).tolist()))
