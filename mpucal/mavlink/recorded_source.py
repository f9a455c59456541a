"""A recording as a session's source: its samples come as if they were measured now."""

from __future__ import annotations

from ..data import Recording, Samples, Sensor
from ..errors import EndOfCapture

POLL_S = 0.05


class RecordedSource:
    """Source of the samples of another ground station's .tlog, a twentieth of a second at a time."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._at = 0
        self._now_s = float(recording.t[0])

    def start(self) -> Sensor:
        """Return the sensor of the recording."""
        return self._recording.sensor

    def poll(self) -> Samples:
        """Return the next samples.

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
        """Return the whole recording."""
        return self._recording

    def forget(self) -> None:
        """Drop the samples that were polled."""
        self._recording, self._at = self._recording.part(self._at, len(self._recording)), 0

    def now_ns(self) -> int:
        """Return the time of the samples' clock."""
        return round(self._now_s * 1e9)

    def stop(self) -> None:
        """Do nothing: there is no device to stop."""
