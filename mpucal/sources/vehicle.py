"""Open vehicle over MAVLink, or its .tlog: every packet is recorded in a .tlog."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import KW_ONLY, asdict, dataclass, replace
from pathlib import Path
from typing import Any, TypedDict

from .. import __version__
from ..chip.config import RateOnlyConfig
from ..chip.records import LATE, SessionEvent
from ..data import Recording
from ..errors import CaptureError, EndOfCapture, LinkError, UsageError
from ..mavlink.link import OWN_SYSTEM, Link, Recorder
from ..mavlink.log import read_log
from ..mavlink.prompts import encode_prompt
from ..mavlink.recorded_source import RecordedSource
from ..mavlink.session_events import Note, encode_note
from ..mavlink.signing import read_key
from ..mavlink.stream_parameters import read_stream_parameters
from ..mavlink.tlog import Tlog, TlogWriter, read_tlog
from ..mavlink.tlog_replay import TlogReplay
from ..mavlink.transport import Transport
from ..mavlink.transports import open_transport
from ..mavlink.url import parse_url
from ..mavlink.vehicle_source import VehicleSource, lock_to_vehicle
from ..origin import Origin
from ..result.session_files import CAPTURE_OF_VEHICLE
from ..session.events import Prompt
from ..session.plan import Plan
from ..session.ports import Operator, ReplayedOperator
from .kind import Request
from .opened_source import ActiveSource, Say

SESSION, END = "session", "end"
MPUCAL, RECORDED, SOURCE, PLAN, SYSTEM, PREPARE = "mpucal", "recorded", "source", "plan", "system", "prepare"
# Counts up with every change of what the source sends and accepts.
SOURCE_VERSION = 4
NOTE_IDS = 65535


@dataclass
class OpenedVehicle:
    """Vehicle behind a transport; see OpenedSource.

    Attributes
    ----------
    transport : open. plan : of the session; only the rate of its `config` applies. system : number of the vehicle.
    key : signing key, or None. own_system : MAVLink id of mpucal.
    listeners : receive the prompts; the vehicle itself is the first of them.
    read_truth : returns the true parameters of a simulated vehicle's streams.
    replay : the same transport if it is a replay. writes : True if the result will be written to the vehicle.
    prepare : True to prepare a PX4; see Preparation. link : to the vehicle, while it measures.
    """

    transport: Transport
    plan: Plan
    system: int | None = None
    key: bytes | None = None
    _: KW_ONLY
    listeners: Sequence[Callable[[Prompt], None]] = ()
    read_truth: Callable[[], Mapping[str, Any] | None] = lambda: None
    replay: TlogReplay | None = None
    recovered: str | None = None
    real_time: bool = True
    own_system: int = OWN_SYSTEM
    writes: bool = False
    prepare: bool = False
    link: Link | None = None
    capture_name: str = CAPTURE_OF_VEHICLE.name
    origin = Origin.VEHICLE
    resumable: bool = False

    def __post_init__(self) -> None:
        self.listeners = (self._send_prompt, *self.listeners)

    @property
    def truth(self) -> Mapping[str, Any] | None:
        """True parameters of the streams, under the vehicle's present parameters."""
        return self.read_truth()

    def talk(self, person: Operator) -> Operator:
        """See OpenedSource."""
        return person if self.replay is None else ReplayedOperator(person, self._pending)

    @contextmanager
    def measuring(self, capture: Path, say: Say, recorded: str) -> Iterator[ActiveSource]:
        """See OpenedSource."""
        with closing(self.transport), TlogWriter(capture) as writer:
            link = self.link = Link(self.transport, writer.packet, self.key, self.own_system)
            notes = _NoteRecorder(link)
            plan = {SOURCE: SOURCE_VERSION, PLAN: asdict(self.plan), SYSTEM: self.system, PREPARE: self.prepare}
            notes.keep(SESSION, 0, {MPUCAL: __version__, RECORDED: recorded, **plan})
            rate_hz = self.plan.config.rate_hz
            source = VehicleSource(link, rate_hz, self.system, say, capture.name, self.writes, self.prepare)
            try:
                yield ActiveSource(source, notes.keep, late=self._was_late)
            finally:
                with suppress(EndOfCapture):
                    source.stop()
                # Nothing came after this time, so that a replay ends its last poll here.
                notes.keep(END, 0, {})

    @contextmanager
    def connected(self, say: Say, record: Recorder = lambda _t_ns, _packet: None) -> Iterator[Link]:
        """Lock a link to the vehicle, whose packets only `record` gets.

        Raises
        ------
        UsageError : a .tlog, or several vehicles. NoAnswer, LinkError : see Link.
        """
        if self.replay is not None:
            raise UsageError("a .tlog is not a vehicle that can be written to", "give the vehicle's --mavlink URL")
        with closing(self.transport):
            link = self.link = Link(self.transport, record, self.key, self.own_system)
            lock_to_vehicle(link, self.system, say)
            yield link

    def contents(self) -> dict[str, Any]:
        """Read the vehicle's identity and its accelerometer parameters; nothing is written."""
        with self.connected(lambda _sentence: None) as link:
            firmware = link.vehicle.family
            return {
                "where": str(link.vehicle),
                "firmware": firmware,
                "parameters": dict(read_stream_parameters(link, firmware)),
            }

    def _send_prompt(self, prompt: Prompt) -> None:
        """Send the prompt to the vehicle, so that its log contains it."""
        if self.link is not None:
            # The operator gets the prompt even if the vehicle is gone.
            with suppress(LinkError):
                self.link.send(encode_prompt(prompt))

    def _was_late(self, late: bool) -> bool:
        return late if self.replay is None else bool(self._pending(LATE))

    def _pending(self, name: str) -> Sequence[SessionEvent]:
        if self.replay is None:
            return []
        return [SessionEvent(noted.note.name, noted.t_ns, noted.note.data) for noted in self.replay.pending(name)]


@dataclass(frozen=True)
class OpenedLog:
    """Open .tlog of another ground station; see OpenedSource."""

    tlog: Tlog
    measured: Recording
    plan: Plan
    listeners: Sequence[Callable[[Prompt], None]] = ()
    truth: Mapping[str, Any] | None = None
    capture_name: str = CAPTURE_OF_VEHICLE.name
    origin = Origin.VEHICLE
    resumable: bool = False
    real_time: bool = False

    @property
    def recovered(self) -> str | None:
        """See OpenedSource."""
        return self.tlog.recovered

    def talk(self, person: Operator) -> Operator:
        """See OpenedSource."""
        return person

    @contextmanager
    def measuring(self, capture: Path, _say: Say, _recorded: str) -> Iterator[ActiveSource]:
        """Copy the log as the capture; see OpenedSource."""
        with TlogWriter(capture) as writer:
            for record in self.tlog.records:
                writer.packet(record.t_ns, record.data)
            yield ActiveSource(RecordedSource(self.measured), lambda _name, _t_ns, _data: None)


class _NoteRecorder:
    """Recorder of session events among a link's packets."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._notes = 0

    def keep(self, name: str, _t_ns: int, data: Mapping[str, Any]) -> None:
        """Record an event at the link's time."""
        for message in encode_note(Note(name, data), 1 + self._notes % NOTE_IDS):
            self._link.note(message)
        self._notes += 1


def open_source(request: Request) -> OpenedVehicle:
    """Open the vehicle at a URL.

    Raises
    ------
    UsageError : not a URL, or not a key. LinkError : the link cannot be opened.
    """
    key = signing_key(request)
    transport = open_transport(parse_url(request.value))
    return OpenedVehicle(transport, request.plan, request.values.get("system"), key, **link_identity(request))


class LinkIdentity(TypedDict):
    """MAVLink id of mpucal, and its intention to write the result and to prepare the vehicle."""

    own_system: int
    writes: bool
    prepare: bool


def link_identity(request: Request) -> LinkIdentity:
    """Return the LinkIdentity that the options select."""
    own = request.values.get("source_system")
    return {
        "own_system": OWN_SYSTEM if own is None else int(own),
        "writes": bool(request.values.get("writes")),
        "prepare": request.values.get("prepare") == "yes",
    }


def signing_key(request: Request) -> bytes | None:
    """Read the signing key if one is named.

    Raises
    ------
    UsageError : the key cannot be read.
    """
    path = request.values.get("signing_key")
    return None if path is None else read_key(path)


def open_tlog(file: Path, asked: Plan, system: int | None) -> OpenedVehicle | OpenedLog:
    """Open a .tlog for a replay: a session of mpucal as it was, any other log until its end.

    Parameters
    ----------
    asked : plan for the log of another ground station.

    Raises
    ------
    CaptureError : it cannot be read, or another version of mpucal recorded it. RecordingError : it has no IMU.
    """
    tlog = read_tlog(file)
    replay = TlogReplay(tlog)
    head = next((noted.note for noted in replay.pending(SESSION)), None)
    if head is None:
        return OpenedLog(tlog, read_log(tlog.records, tlog.name, system), asked)
    if head.data.get(SOURCE) != SOURCE_VERSION:
        raise CaptureError(
            f"{tlog.name} was recorded by version {head.data.get(SOURCE)} of the source, and this is {SOURCE_VERSION}",
            "use `mpucal calibrate` on it, which reads a .tlog of every version",
        )
    try:
        plan = dict(head.data[PLAN])
        made = Plan(**{**plan, "config": RateOnlyConfig(**plan["config"])})
        made = replace(made, board=asked.board or made.board)
        return OpenedVehicle(
            replay,
            made,
            head.data[SYSTEM],
            replay=replay,
            recovered=tlog.recovered,
            real_time=False,
            prepare=bool(head.data.get(PREPARE)),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise CaptureError(
            f"the head of {tlog.name} does not describe its session ({error})", "use `mpucal calibrate` on it"
        ) from error
