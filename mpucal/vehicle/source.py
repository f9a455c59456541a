"""Open vehicle over MAVLink, and the replay of another ground station's log: every packet is recorded."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import Any

from ..chip.access import BEGUN, END, OPENED, PAUSED, SAMPLED_NS
from ..clocks import S
from ..data import Recording, Samples, Sensor
from ..errors import EndOfCapture, LinkError
from ..files.mcap import Capture
from ..files.messages import PACKETS
from ..mavlink import MAVLINK_VERSION
from ..mavlink.link import OWN_SYSTEM, Link
from ..mavlink.log import read_log
from ..mavlink.parameters.client import read_stream_parameters
from ..mavlink.texts import encode_prompt
from ..mavlink.tlog import RawPacket
from ..mavlink.transports import open_transport
from ..mavlink.url import parse_url, read_key
from ..mavlink.vehicle_source import POLL_NS, VehicleSource, lock_to_vehicle
from ..origin import Origin
from ..session.events import Prompt
from ..session.plan import Plan
from ..sources.kind import Request
from ..sources.opened_source import ActiveSource, CaptureRecorder, OpenedSource, Say
from ..sources.recorded_parts import RecordedParts
from ..sources.replay import PacketReplay


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
        self._now_s += POLL_NS / S
        last = int(self._recording.t.searchsorted(self._now_s))
        samples = self._recording.at(slice(self._at, last))
        self._at = last
        return samples

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


SYSTEM, PREPARE = "system", "prepare"


@dataclass
class OpenedVehicle(OpenedSource):
    """Vehicle behind a transport, which is its `line`; only the rate of its plan's config applies. See OpenedSource.

    Attributes
    ----------
    system : number of the vehicle. key : signing key, or None. own_system : MAVLink id of mpucal.
    writes : True if the result will be written to the vehicle. prepare : True to prepare a PX4; see Preparation.
    link : to the vehicle, while it measures. end : notes the end of a part.
    """

    _: KW_ONLY
    system: int | None = None
    key: bytes | None = None
    own_system: int = OWN_SYSTEM
    writes: bool = False
    prepare: bool = False
    link: Link | None = None
    end: Callable[[], None] = lambda: None
    origin = Origin.VEHICLE
    topic = PACKETS
    version = MAVLINK_VERSION

    @property
    def listeners(self) -> Sequence[Callable[[Prompt], None]]:
        """The vehicle itself, whose log then contains the prompts, and those of OpenedSource."""
        return (self._send_prompt, *super().listeners)

    def source_meta(self) -> dict[str, Any]:
        """Return the entries for the head of a capture."""
        return {**super().source_meta(), SYSTEM: self.system, PREPARE: self.prepare}

    @classmethod
    def replayed(
        cls, capture: Capture, line: RecordedParts[Any], plan: Plan, values: Mapping[str, Any], /, **how: Any
    ) -> OpenedVehicle:
        """Open the replay of a session as it was, and any other log until its end; see OpenedSource.

        An option names one of several vehicles in a log.

        Raises
        ------
        RecordingError : the log has no IMU.
        """
        how[SYSTEM], how[PREPARE] = capture.meta.get(SYSTEM, values.get(SYSTEM)), bool(capture.meta.get(PREPARE))
        packets = [record for record in capture.records if isinstance(record, RawPacket)]
        if len(packets) < len(capture.records):
            return cls(line, plan, **how)
        measured = read_log(packets, capture.name, how[SYSTEM])
        return OpenedLog(PacketReplay((), capture.name), plan, **how, packets=packets, measured=measured)

    @contextmanager
    def recorded(self, recorder: CaptureRecorder, name: str, say: Say) -> Iterator[ActiveSource]:
        """See OpenedSource."""
        link = self.link = Link(self.line, recorder.packet, self.key, self.own_system)

        def note(event: str, _t_ns: int = 0, data: Mapping[str, Any] | None = None) -> None:
            recorder.event(event, link.now_ns(), data)

        replayed = self.parts is not None and not self.parts.resumes

        def say_new(sentence: str) -> None:
            # The operator of a resumed session was told before what its recorded part says.
            if replayed or not self.replaying:
                say(sentence)

        def paused(t_ns: int) -> None:
            note(PAUSED, data={SAMPLED_NS: t_ns})

        rate_hz, begun, self.end = self.plan.config.rate_hz, lambda: note(BEGUN), lambda: note(END)
        source = VehicleSource(
            link, rate_hz, self.system, say_new, name, self.writes, self.prepare, begun, paused, replayed
        )
        note(OPENED)
        try:
            yield ActiveSource(source, note)
        finally:
            with suppress(EndOfCapture):
                source.stop()
            # Nothing came after this time, so that a replay ends its last poll here.
            self.end()

    def open_next_part(self) -> bool:
        """See OpenedSource."""
        if self.parts is None or self.parts.is_last or self.link is None:
            return False
        self.end()
        self.parts.open_next_part()
        self.link.restart()
        return True

    @contextmanager
    def connected(self, say: Say) -> Iterator[Link]:
        """Lock a link to the vehicle, and record nothing.

        Raises
        ------
        UsageError : several vehicles. NoAnswer, LinkError : see Link.
        """
        with closing(self.line):
            link = self.link = Link(self.line, lambda _t_ns, _packet: None, self.key, self.own_system)
            lock_to_vehicle(link, self.system, say)
            yield link

    def contents(self) -> dict[str, Any]:
        """Read the vehicle's identity and its accelerometer parameters; nothing is written."""
        with self.connected(lambda _sentence: None) as link:
            held = read_stream_parameters(link)
            return {"where": str(link.vehicle), "firmware": link.vehicle.family, "parameters": held}

    def _send_prompt(self, prompt: Prompt) -> None:
        """Send the prompt to the vehicle, so that its log contains it."""
        if self.link is not None:
            # The operator gets the prompt even if the vehicle is gone.
            with suppress(LinkError):
                self.link.send(encode_prompt(prompt))


@dataclass
class OpenedLog(OpenedVehicle):
    """Log of another ground station; see OpenedSource.

    Attributes
    ----------
    packets : of the log. measured : its recording.
    """

    _: KW_ONLY
    packets: Sequence[RawPacket]
    measured: Recording

    @contextmanager
    def recorded(self, recorder: CaptureRecorder, _name: str, _say: Say) -> Iterator[ActiveSource]:
        """Copy the log as the capture; see OpenedSource."""
        for packet in self.packets:
            recorder.packet(*packet)
        yield ActiveSource(RecordedSource(self.measured), lambda _name, _t_ns, _data: None)


def open_source(request: Request) -> OpenedVehicle:
    """Open the vehicle at a URL.

    Raises
    ------
    UsageError : not a URL, or not a key. LinkError : the link cannot be opened.
    """
    options = link_options(request)
    return OpenedVehicle(open_transport(parse_url(request.value)), request.plan, **options)


def link_options(request: Request) -> dict[str, Any]:
    """Return the arguments of an OpenedVehicle that the options of --mavlink give.

    Raises
    ------
    UsageError : the signing key cannot be read.
    """
    values = request.values
    path, own = values.get("signing_key"), values.get("source_system")
    return {
        "words": request.words,
        "key": None if path is None else read_key(Path(path)),
        "system": values.get("system"),
        "own_system": OWN_SYSTEM if own is None else int(own),
        "writes": bool(values.get("writes")),
        "prepare": values.get("prepare") == "yes",
    }
