"""The link to one vehicle: listen, lock to it, then hear and answer it alone.

One thread: nothing arrives but in `messages`, and every message of the vehicle goes to all who subscribed, whoever
called `messages`. The time is that of the transport, as of the last message or deadline: a replay repeats it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice
from typing import Any, NamedTuple

from ..errors import BusError, LinkError, NoAnswer
from .dialect import LONGEST, MAGIC, SIGNED, Message, Packet, Parser, dialect
from .transport import PAUSE_NS, ReceivedBytes, Transport
from .vehicle import Vehicle, vehicle_of

# of us: a ground station beside the usual 255, as a component that autopilots expect of one
OWN_SYSTEM, OWN_COMPONENT = 254, 190

S = 1_000_000_000
LISTEN_NS, PATIENCE_NS = 2 * S, 6 * S
HEARTBEAT_NS = S
SEQUENCE = 256
# more senders than a network of vehicles has; more datagrams or packets' lengths without a packet than a bad link
# brings in six seconds, such as a serial line of 921,600 Bd that is read at another rate
MOST_SENDERS, FLOOD = 64, 2000
# signatures count 10 us since 2015-01-01
SIGNING_EPOCH_NS, SIGNING_UNIT_NS = 1_420_070_400 * S, 10_000

Recorder = Callable[[int, bytes], None]
Listener = Callable[[Message], None]


class _Arrived(NamedTuple):
    t_ns: int
    address: str
    packet: Packet


class Link:
    """A link over an open transport.

    Parameters
    ----------
    transport : where the packets come from; `close` closes it.
    record : keeps each packet of the vehicle and of us, with its time [ns since 1970].
    key : 32 bytes with which both sides sign, or None. own_system : our MAVLink id.
    """

    def __init__(
        self, transport: Transport, record: Recorder, key: bytes | None = None, own_system: int = OWN_SYSTEM
    ) -> None:
        self._transport = transport
        self._record = record
        self._mav = dialect().MAVLink(None, own_system, OWN_COMPONENT)
        self.own_system = own_system
        self._now_ns = transport.now_ns()
        self._key = key
        if key is not None:
            self._sign(key)
        self._parsers: dict[str, Parser] = {}
        self._queue: deque[_Arrived] = deque()
        # until it is locked: time, from where (None: from us), bytes
        self._heard: list[tuple[int, str | None, bytes]] = []
        self._listeners: list[Listener] = []
        self._vehicle: Vehicle | None = None
        self._seeking = False
        self._next_heartbeat_ns = self._now_ns
        self._sequence: int | None = None
        self.lost = 0
        self._signed = self._unsigned = 0
        self._junk = 0

    @property
    def signed_only(self) -> bool:
        """Whether the vehicle signs all that it sends, and we nothing."""
        return self._mav.signing.secret_key is None and self._signed > 0 and not self._unsigned

    @property
    def vehicle(self) -> Vehicle:
        """Whom it is locked to.

        Raises
        ------
        RuntimeError : it is not locked yet.
        """
        if self._vehicle is None:
            raise RuntimeError("the link is not locked to a vehicle yet")
        return self._vehicle

    @property
    def mav(self) -> Any:
        """pymavlink's MAVLink, whose *_encode methods make messages."""
        return self._mav

    def now_ns(self) -> int:
        """ns since 1970: of the last message delivered, or of the deadline that passed since."""
        return self._now_ns

    def subscribe(self, listener: Listener) -> None:
        """Have `listener` called with every message of the vehicle from now on."""
        self._listeners.append(listener)

    def listen(self) -> tuple[Vehicle, ...]:
        """Who sends an autopilot's HEARTBEAT within two seconds, of the first one where it comes later (within six).

        Raises
        ------
        NoAnswer : nobody does, or none whose signature holds.
        """
        begun_ns = self._now_ns
        vehicles = list(self._beating(begun_ns + LISTEN_NS))
        if not vehicles:
            vehicles = list(islice(self._beating(begun_ns + PATIENCE_NS), 1))
            if not vehicles:
                raise self._nobody()
            # several that are powered together come one after another
            vehicles += self._beating(self._now_ns + LISTEN_NS)
        return tuple({(vehicle.address, vehicle.system): vehicle for vehicle in vehicles}.values())

    def _beating(self, until_ns: int) -> Iterator[Vehicle]:
        """Who sends a HEARTBEAT, each time that it comes."""
        for arrived in self._arrivals(until_ns):
            self._heard.append((arrived.t_ns, arrived.address, arrived.packet.data))
            vehicle = vehicle_of(arrived.address, arrived.packet.message)
            if vehicle is not None:
                yield vehicle

    def lock(self, vehicle: Vehicle) -> None:
        """Hear `vehicle` alone from now on, and send to it."""
        self._vehicle = vehicle
        self._transport.restrict(vehicle.address)
        for t_ns, address, data in self._heard:
            if address in (vehicle.address, None):
                self._record(t_ns, data)
        self._heard = []

    def seek(self) -> None:
        """Hear the other ports of the vehicle's host too until its heartbeat comes: who starts anew may take another.

        Raises
        ------
        LinkError : our own port was taken meanwhile.
        """
        if self._transport.datagrams and not self._transport.outward and not self._seeking:
            self._seeking = True
            self._transport.restrict(None)

    def send(self, message: Message) -> None:
        """Send to the vehicle, and nobody else.

        Raises
        ------
        RuntimeError : the link is not locked. LinkError : it broke.
        """
        self._transmit(message, self.vehicle.address)

    def messages(self, until_ns: int) -> Iterator[Message]:
        """The vehicle's messages until `until_ns`; who leaves early loses none.

        Where the program or its computer stood still meanwhile, it is later than `until_ns` afterwards.

        Raises
        ------
        EndOfCapture : a replay holds no more. LinkError : the link broke.
        """
        for arrived in self._arrivals(until_ns):
            if self._seeking and self._is_back(arrived):
                self._seeking = False
                self._vehicle = replace(self.vehicle, address=arrived.address)
                self._transport.restrict(arrived.address)
            vehicle = self.vehicle
            if arrived.address != vehicle.address:
                continue
            self._record(arrived.t_ns, arrived.packet.data)
            message = arrived.packet.message
            if (message.get_srcSystem(), message.get_srcComponent()) != (vehicle.system, vehicle.component):
                continue
            self._count(message)
            for listener in self._listeners:
                listener(message)
            yield message

    def note(self, message: Message) -> None:
        """Keep a message in the record, under the id by which a replay knows it, and send it to nobody."""
        own, self._mav.srcSystem = self._mav.srcSystem, OWN_SYSTEM
        self._keep(self._packed(message))
        self._mav.srcSystem = own

    def close(self) -> None:
        """Close the transport."""
        self._transport.close()

    def _is_back(self, arrived: _Arrived) -> bool:
        """Whether it is the vehicle's heartbeat, from its host."""
        heard = vehicle_of(arrived.address, arrived.packet.message)
        return heard is not None and replace(heard, address=self.vehicle.address) == self.vehicle

    def _arrivals(self, until_ns: int) -> Iterator[_Arrived]:
        while True:
            while self._queue and self._queue[0].t_ns < until_ns:
                arrived = self._queue.popleft()
                self._now_ns = max(self._now_ns, arrived.t_ns)
                yield arrived
            if self._queue:
                break
            self._beat()
            received = self._transport.receive(min(until_ns, self._next_heartbeat_ns))
            if received is not None:
                self._queue.extend(self._parsed(received))
            now_ns = self._transport.now_ns() if received is None else received.t_ns
            if self._vehicle is not None and now_ns - until_ns > PAUSE_NS:
                # nobody was waiting meanwhile: there is nothing to be told of that time
                until_ns = now_ns
                break
            # strangers' bytes are no reason to stay longer
            if now_ns >= until_ns and not self._queue:
                break
        self._now_ns = max(self._now_ns, until_ns)

    def _parsed(self, received: ReceivedBytes) -> list[_Arrived]:
        if self._vehicle is not None and not self._may_be(received.address, self._vehicle.address):
            return []
        if self._transport.datagrams and received.data[:1] not in MAGIC:
            self._junk += 1
            return []
        parser = self._parsers.get(received.address)
        if parser is None:
            if len(self._parsers) >= MOST_SENDERS:
                self._junk += 1
                return []
            parser = self._parsers[received.address] = Parser(self._receiver())
        parse = parser.datagram if self._transport.datagrams else parser.stream
        packets = [_Arrived(received.t_ns, received.address, packet) for packet in parse(received.data)]
        if not packets:
            self._junk += 1 if self._transport.datagrams else -(-len(received.data) // LONGEST)
        return packets

    def _may_be(self, address: str, known: str) -> bool:
        """Whether the vehicle may be there: where it was, or, while it is sought, at another port of its host."""
        return address == known or (self._seeking and address.rpartition(":")[0] == known.rpartition(":")[0])

    def _beat(self) -> None:
        """A ground station's HEARTBEAT each second, to whom we may speak."""
        now_ns = self._transport.now_ns()
        if now_ns < self._next_heartbeat_ns:
            return
        self._next_heartbeat_ns = now_ns + HEARTBEAT_NS
        if self._vehicle is None and not self._transport.outward:
            return
        m = dialect()
        heartbeat = self._mav.heartbeat_encode(m.MAV_TYPE_GCS, m.MAV_AUTOPILOT_INVALID, 0, 0, m.MAV_STATE_ACTIVE)
        self._transmit(heartbeat, None if self._vehicle is None else self._vehicle.address)

    def _transmit(self, message: Message, address: str | None) -> None:
        data = self._packed(message)
        self._keep(data)
        self._transport.send(data, None if self._transport.outward else address)

    def _keep(self, data: bytes) -> None:
        if self._vehicle is None:
            self._heard.append((self._now_ns, None, data))
        else:
            self._record(self._now_ns, data)

    def _packed(self, message: Message) -> bytes:
        if self._vehicle is not None and self._vehicle.address in self._parsers:
            # what is a minute older than its own signatures a vehicle refuses
            newest = self._parsers[self._vehicle.address].signed_at
            self._mav.signing.timestamp = max(self._mav.signing.timestamp, newest)
        data = bytes(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % SEQUENCE
        return data

    def _count(self, message: Message) -> None:
        """Packets that are missing by their numbers; one that comes late was counted as missing before."""
        header = message.get_header()
        self._signed += header.incompat_flags & SIGNED
        self._unsigned += not header.incompat_flags & SIGNED
        step = (header.seq - (header.seq - 1 if self._sequence is None else self._sequence)) % SEQUENCE
        if 0 < step < SEQUENCE // 2:
            self._sequence = header.seq
            self.lost += step - 1
        elif step:
            self.lost = max(self.lost - 1, 0)

    def _receiver(self) -> Any:
        """A MAVLink for one address, as pymavlink remembers a signature's time before it has checked the signature.

        From 1970 on: without a battery or a satellite, a vehicle's clock goes on where it once stopped.
        """
        mav = dialect().MAVLink(None, OWN_SYSTEM, OWN_COMPONENT)
        mav.signing.secret_key = self._key
        return mav

    def _sign(self, key: bytes) -> None:
        signing = self._mav.signing
        signing.secret_key, signing.sign_outgoing, signing.link_id = key, True, OWN_COMPONENT
        signing.timestamp = (self._now_ns - SIGNING_EPOCH_NS) // SIGNING_UNIT_NS

    def _nobody(self) -> BusError:
        where = self._transport.name
        if self._mav.signing.secret_key is not None and any(parser.refused for parser in self._parsers.values()):
            return LinkError(
                f"packets arrive on {where}, and none is signed with the key of --signing-key",
                "give the vehicle's key, or leave it out where the vehicle does not sign",
            )
        if self._junk > FLOOD:
            return LinkError(
                f"{where} is flooded: {self._junk} pieces came within {PATIENCE_NS // S} s that are no vehicle's",
                "stop what sends them, or have the vehicle's telemetry sent to another port",
            )
        return NoAnswer(
            f"no autopilot's heartbeat came over {where} within {PATIENCE_NS // S} s",
            "power the vehicle, and have its telemetry sent here",
        )
