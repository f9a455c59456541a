"""A recording as a session's source: its samples come as if they were measured now."""

from __future__ import annotations

from ..data import Recording, Samples, Sensor
from ..errors import EndOfCapture

POLL_S = 0.05


class RecordedSource:
    """The samples of a .tlog that another ground station recorded, a twentieth of a second at a time."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._at = 0
        self._now_s = float(recording.t[0])

    def start(self) -> Sensor:
        """What is known of the sensor."""
        return self._recording.sensor

    def poll(self) -> Samples:
        """The next samples.

        Raises
        ------
        EndOfCapture : there are no more.
        """
        if self._at == len(self._recording):
            raise EndOfCapture
        self._now_s += POLL_S
        last = int(self._recording.t.searchsorted(self._now_s))
        part = self._recording.part(self._at, last)
        self._at = last
        return Samples(*(getattr(part, name) for name in Samples.__dataclass_fields__))

    def recording(self) -> Recording:
        """All of it."""
        return self._recording

    def forget(self) -> None:
        """Let go of what was polled."""
        self._recording, self._at = self._recording.part(self._at, len(self._recording)), 0

    def now_ns(self) -> int:
        """The samples' clock."""
        return round(self._now_s * 1e9)

    def stop(self) -> None:
        """Nothing."""
