"""The link to one vehicle: listen, lock to a vehicle, then receive from it and send to it alone.

There is no thread: packets are received only while somebody iterates over `messages`, and every message of the vehicle
then goes to all listeners. The time is that of the last message or deadline, by the transport's clock, so that a replay
repeats it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from itertools import islice
from typing import Any, NamedTuple

from ..clocks import S
from ..errors import BusError, LinkError, NoAnswer
from .dialect import LONGEST, MAGIC, SIGNED, Message, Packet, Parser, dialect
from .firmwares import Vehicle, vehicle_of
from .transports import PAUSE_NS, ReceivedBytes, Transport

# Our ids: a system other than 255, the usual ground station's, and the component that autopilots expect of a station.
OWN_SYSTEM, OWN_COMPONENT = 254, 190

LISTEN_NS, PATIENCE_NS = 2 * S, 6 * S
HEARTBEAT_NS = S
SEQUENCE = 256
# Sequence numbers: a packet that others overtook is at most LATE numbers late. After a silence, as by a reboot, they
# may start anew, and nothing counts as lost: the silence is reported by itself.
LATE = 32
SILENCE_NS = S
# No network has more vehicles.
MOST_SENDERS = 64
# More pieces than this without a packet, while we wait for a vehicle, are a flood. A piece is a datagram, or as many
# bytes of a serial line as the longest packet has. A bad link brings fewer; a line of 921,600 Bd read at another
# rate brings more.
FLOOD = 2000
# Signatures count 10 us since 2015-01-01.
SIGNING_EPOCH_NS, SIGNING_UNIT_NS = 1_420_070_400 * S, 10_000

Recorder = Callable[[int, bytes], None]
Listener = Callable[[Message], None]


class _AddressedPacket(NamedTuple):
    t_ns: int
    address: str
    packet: Packet


class Link:
    """A link over an open transport.

    Parameters
    ----------
    transport : carries the packets; `close` closes it.
    record : called with the time [ns since 1970] and the bytes of each packet of the vehicle, and of ours.
    key : 32 bytes with which both sides sign, or None. own_system : our MAVLink id.

    Attributes
    ----------
    received, lost : number of the vehicle's packets since the lock, and of those missing by their sequence numbers.
    heard_ns : time of its last packet.
    stations : ids of the other ground stations whose HEARTBEAT came from the vehicle's address.
    armed : True if the vehicle's last HEARTBEAT says that it is armed, None before the first.
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
        self._queue: deque[_AddressedPacket] = deque()
        # Time, address (None: ours) and bytes of the packets before the link is locked.
        self._before_lock: list[tuple[int, str | None, bytes]] = []
        self._listeners: list[Listener] = []
        self._vehicle: Vehicle | None = None
        self._seeking = False
        self._next_heartbeat_ns = self._now_ns
        self._sequence: int | None = None
        self.received = self.lost = self.heard_ns = 0
        self.stations: set[int] = set()
        self.armed: bool | None = None
        self._signed = self._unsigned = 0
        self._junk = 0

    @property
    def signed_only(self) -> bool:
        """True if the vehicle signs all that it sends, and we have no key."""
        return self._key is None and self._signed > 0 and not self._unsigned

    @property
    def loss_share(self) -> float:
        """Share of the vehicle's packets that were lost since the lock."""
        return self.lost / max(self.received + self.lost, 1)

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle that the link is locked to.

        Raises
        ------
        RuntimeError : it is not locked yet.
        """
        if self._vehicle is None:
            raise RuntimeError("the link is not locked to a vehicle yet")
        return self._vehicle

    def now_ns(self) -> int:
        """Return the time of the last message, or of the deadline that passed since [ns since 1970]."""
        return self._now_ns

    def subscribe(self, listener: Listener) -> None:
        """Call `listener` with every message of the vehicle from now on."""
        self._listeners.append(listener)

    def listen(self) -> tuple[Vehicle, ...]:
        """Return the vehicles whose HEARTBEAT comes within two seconds.

        If none comes, wait for the first one for six seconds, and for others two seconds after it.

        Raises
        ------
        NoAnswer : none comes. LinkError : none with a valid signature, or a flood of other bytes.
        """
        begun_ns = self._now_ns
        vehicles = list(self._heartbeats(begun_ns + LISTEN_NS))
        if not vehicles:
            vehicles = list(islice(self._heartbeats(begun_ns + PATIENCE_NS), 1))
            if not vehicles:
                raise self._no_vehicle()
            # Vehicles that are powered together start one after another.
            vehicles += self._heartbeats(self._now_ns + LISTEN_NS)
        return tuple({(vehicle.address, vehicle.system): vehicle for vehicle in vehicles}.values())

    def lock(self, vehicle: Vehicle) -> None:
        """Receive from `vehicle` alone from now on, and send to it."""
        self._vehicle = vehicle
        self.received, self.lost, self.heard_ns, self._sequence = 0, 0, self._now_ns, None
        self._transport.restrict(vehicle.address)
        for t_ns, address, data in self._before_lock:
            if address in (vehicle.address, None):
                self._record(t_ns, data)
        self._before_lock = []

    def seek(self) -> None:
        """Accept the vehicle at other ports of its host until its HEARTBEAT comes: after a restart it may use another.

        Raises
        ------
        LinkError : our own port was taken meanwhile.
        """
        if self._transport.datagrams and not self._transport.outward and not self._seeking:
            self._seeking = True
            self._transport.restrict(None)

    def encode(self, name: str, *fields: Any) -> Message:
        """Return a message `name` for the vehicle; `fields` are those after target_system and target_component."""
        return getattr(self._mav, f"{name}_encode")(self.vehicle.system, self.vehicle.component, *fields)

    def send(self, message: Message) -> None:
        """Send to the vehicle alone.

        Raises
        ------
        RuntimeError : the link is not locked. LinkError : it broke.
        """
        self._transmit(message, self.vehicle.address)

    def messages(self, until_ns: int) -> Iterator[Message]:
        """Yield the vehicle's messages until `until_ns`; a loop that is left early loses none.

        If the program or its computer was suspended meanwhile, `now_ns` is later than `until_ns` afterwards.

        Raises
        ------
        EndOfCapture : a replay holds no more. LinkError : the link broke.
        """
        for arrived in self._arrivals(until_ns):
            if self._seeking and self._is_same_vehicle(arrived):
                self._seeking = False
                self._vehicle = self.vehicle._replace(address=arrived.address)
                self._transport.restrict(arrived.address)
            vehicle = self.vehicle
            if arrived.address != vehicle.address:
                continue
            self._record(arrived.t_ns, arrived.packet.data)
            message = arrived.packet.message
            beats = message.get_type() == "HEARTBEAT"
            if (message.get_srcSystem(), message.get_srcComponent()) != (vehicle.system, vehicle.component):
                if beats and message.type == dialect().MAV_TYPE_GCS:
                    self.stations |= {message.get_srcSystem()} - {self.own_system}
                continue
            self._count(message)
            if beats:
                self.armed = bool(message.base_mode & dialect().MAV_MODE_FLAG_SAFETY_ARMED)
            for listener in self._listeners:
                listener(message)
            yield message

    def restart(self) -> None:
        """Forget the vehicle and all packets, as the transport goes on with the next part of a resumed session."""
        self._parsers.clear()
        self._queue.clear()
        self._before_lock.clear()
        self._listeners.clear()
        self._vehicle, self._seeking, self.armed = None, False, None
        self._now_ns = self._next_heartbeat_ns = max(self._now_ns, self._transport.now_ns())

    def succeeds(self, attempt: Callable[[], bool], within_ns: int) -> bool:
        """Repeat `attempt`, which takes time by listening, until it returns True; return False after `within_ns`.

        The last one may end later than that.
        """
        end_ns = self._now_ns + within_ns
        while not attempt():
            if self._now_ns >= end_ns:
                return False
        return True

    def close(self) -> None:
        """Close the transport."""
        self._transport.close()

    def _heartbeats(self, until_ns: int) -> Iterator[Vehicle]:
        """Yield the sender of each HEARTBEAT."""
        for arrived in self._arrivals(until_ns):
            self._before_lock.append((arrived.t_ns, arrived.address, arrived.packet.data))
            vehicle = vehicle_of(arrived.address, arrived.packet.message)
            if vehicle is not None:
                yield vehicle

    def _is_same_vehicle(self, arrived: _AddressedPacket) -> bool:
        """Return True for a HEARTBEAT of the vehicle, from any address."""
        sender = vehicle_of(arrived.address, arrived.packet.message)
        return sender is not None and sender._replace(address=self.vehicle.address) == self.vehicle

    def _arrivals(self, until_ns: int) -> Iterator[_AddressedPacket]:
        """Yield the packets that arrive until `until_ns`, and set the time; our heartbeats go out meanwhile.

        It ends early after a pause of the program.
        """
        while True:
            while self._queue and self._queue[0].t_ns < until_ns:
                arrived = self._queue.popleft()
                self._now_ns = max(self._now_ns, arrived.t_ns)
                yield arrived
            if self._queue:
                break
            self._send_heartbeat()
            received = self._transport.receive(min(until_ns, self._next_heartbeat_ns))
            if received is not None:
                self._queue.extend(self._parse(received))
            now_ns = self._transport.now_ns() if received is None else received.t_ns
            if self._vehicle is not None and now_ns - until_ns > PAUSE_NS:
                # The program was suspended, which the caller notices by `now_ns`.
                until_ns = now_ns
                break
            # Bytes that are no packets may come without end, so the wait ends though bytes were received.
            if now_ns >= until_ns and not self._queue:
                break
        self._now_ns = max(self._now_ns, until_ns)

    def _parse(self, received: ReceivedBytes) -> list[_AddressedPacket]:
        """Return the packets that bytes complete; count those without a packet as junk, and drop other senders'."""
        if self._vehicle is not None and not self._is_accepted(received.address, self._vehicle.address):
            return []
        if self._transport.datagrams and received.data[:1] not in MAGIC:
            self._junk += 1
            return []
        parser = self._parsers.get(received.address)
        if parser is None:
            if len(self._parsers) >= MOST_SENDERS:
                self._junk += 1
                return []
            parser = self._parsers[received.address] = Parser(self._new_receiver())
        parse = parser.datagram if self._transport.datagrams else parser.stream
        packets = [_AddressedPacket(received.t_ns, received.address, packet) for packet in parse(received.data)]
        if not packets:
            self._junk += 1 if self._transport.datagrams else -(-len(received.data) // LONGEST)
        return packets

    def _is_accepted(self, address: str, known: str) -> bool:
        """Return True for the vehicle's address `known` and, while it is sought, for other ports of its host."""
        return address == known or (self._seeking and address.rpartition(":")[0] == known.rpartition(":")[0])

    def _send_heartbeat(self) -> None:
        """Send a ground station's HEARTBEAT each second, once there is a partner to send to."""
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
        data = self._pack(message)
        self._keep(data)
        self._transport.send(data, None if self._transport.outward else address)

    def _keep(self, data: bytes) -> None:
        if self._vehicle is None:
            self._before_lock.append((self._now_ns, None, data))
        else:
            self._record(self._now_ns, data)

    def _pack(self, message: Message) -> bytes:
        """Return the bytes of our next message, signed if there is a key."""
        if self._vehicle is not None and self._vehicle.address in self._parsers:
            # A vehicle refuses packets that are a minute older than its own signatures.
            newest = self._parsers[self._vehicle.address].signed_at
            self._mav.signing.timestamp = max(self._mav.signing.timestamp, newest)
        data = bytes(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % SEQUENCE
        return data

    def _count(self, message: Message) -> None:
        """Count a packet, and those missing before it by their numbers; a late one is not missing any more."""
        header = message.get_header()
        self.received += 1
        self._signed += header.incompat_flags & SIGNED
        self._unsigned += not header.incompat_flags & SIGNED
        last = self._sequence
        if last is None or self._now_ns - self.heard_ns > SILENCE_NS:
            last = header.seq - 1
        step = (header.seq - last) % SEQUENCE
        if 0 < step < SEQUENCE - LATE:
            self._sequence = header.seq
            self.lost += step - 1
        elif step:
            self.lost = max(self.lost - 1, 0)
        self.heard_ns = self._now_ns

    def _new_receiver(self) -> Any:
        """Return a MAVLink for one address, so that a forged packet cannot change another address' signature times.

        It accepts signatures of any time: the clock of a vehicle without a battery or satellites is years late.
        """
        mav = dialect().MAVLink(None, OWN_SYSTEM, OWN_COMPONENT)
        mav.signing.secret_key = self._key
        return mav

    def _sign(self, key: bytes) -> None:
        signing = self._mav.signing
        signing.secret_key, signing.sign_outgoing, signing.link_id = key, True, OWN_COMPONENT
        signing.timestamp = (self._now_ns - SIGNING_EPOCH_NS) // SIGNING_UNIT_NS

    def _no_vehicle(self) -> BusError:
        """Return the error that explains why no vehicle was heard."""
        where = self._transport.name
        if self._key is not None and any(parser.refused for parser in self._parsers.values()):
            return LinkError(
                f"packets arrive on {where}, and none is signed with the key of --signing-key",
                "give the vehicle's key, or omit it if the vehicle does not sign",
            )
        if self._junk > FLOOD:
            return LinkError(
                f"{where} is flooded: {self._junk} pieces came within {PATIENCE_NS // S} s that are no vehicle's",
                "stop their sender, or have the vehicle's telemetry sent to another port",
            )
        return NoAnswer(
            f"no autopilot's heartbeat came over {where} within {PATIENCE_NS // S} s",
            "power the vehicle, and have its telemetry sent here",
        )
