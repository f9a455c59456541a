"""A vehicle's horizon: its attitude, compared with gravity in its streams, and a reboot, after which it begins anew."""

from __future__ import annotations

from collections import deque

import numpy as np

from ..data import Vector
from ..errors import LinkError
from .dialect import Message, dialect
from .imu import Stream
from .link import Link, S
from .parameters.level import attitude_deg
from .request import send_command
from .rest_monitor import WINDOW_NS, RestMonitor

ATTITUDE, INTERVAL_US = 30, 100_000
HEARD_NS, BACK_NS, SETTLED_NS = 5 * S, 60 * S, 60 * S
# Two comparisons in succession that differ by no more show that the estimator has settled.
STEADY_DEG = 0.05


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
        end_ns = self._link.now_ns() + BACK_NS
        while self._link.now_ns() < end_ns:
            self._boot_ms = None
            self._request()
            self._listen(S)
            if self._boot_ms is not None and self._boot_ms < before_ms:
                self._heard.clear()
                return True
        raise LinkError(f"{self._link.vehicle} did not come back after its reboot", "check its power and the link")

    def error_deg(self, stream: Stream, trim_deg: Vector) -> Vector | None:
        """Return roll and pitch (2,) by which the settled attitude differs from gravity; None if it does not rest.

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
            apart = np.mean(heard, axis=0) - attitude_deg(self._link.vehicle.family, trim_deg, rest.mean[stream])
            steady = before is not None and np.abs(apart - before).max() <= STEADY_DEG
            if steady or self._link.now_ns() >= end_ns:
                return np.asarray(apart)
            before = apart

    def _request(self) -> None:
        send_command(self._link, dialect().MAV_CMD_SET_MESSAGE_INTERVAL, ATTITUDE, INTERVAL_US)

    def _listen(self, for_ns: int) -> None:
        """Wait for the next ATTITUDE, at most `for_ns`."""
        for _ in self._link.messages(self._link.now_ns() + for_ns):
            if self._boot_ms is not None:
                return

    def _on_message(self, message: Message) -> None:
        if message.get_type() == "ATTITUDE":
            self._boot_ms = message.time_boot_ms
            self._heard.append((self._link.now_ns(), *np.degrees([message.roll, message.pitch]).tolist()))
