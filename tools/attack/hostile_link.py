"""The simulated vehicle's link with an attacker on it, and its hostile packets; see tools/attack/hostile_vehicle.py."""

import math
import random
import struct
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, ClassVar
from unittest.mock import patch

from mpucal.mavlink.dialect import Parser, dialect
from mpucal.mavlink.parameters.client import stream_parameter_names
from mpucal.mavlink.parameters.encoding import from_wire
from mpucal.mavlink.transports import ReceivedBytes
from mpucal.simulated.vehicle import SimulatedVehicle
from mpucal.simulated.vehicle.transport import ADDRESS, SimulatedTransport
from tools.processes import quick, without_pictures

OTHER_KEY = bytes(32)
ODD = (float("nan"), float("inf"), -float("inf"), 3.4e38, -3.4e38, 1e-45, 0.0, 1.0, -9.8)


class Attacker:
    """Attacker that makes packets of each kind.

    Attributes
    ----------
    heard : packets of the vehicle to be replayed, also of an earlier session. now_us : its clock.
    """

    def __init__(self, seed: int, firmware: str, heard: Sequence[bytes] = ()) -> None:
        self._rng = random.Random(seed)
        self._names = [name.encode() for name in stream_parameter_names("PX4" if firmware == "px4" else "ArduPilot")]
        self.heard = list(heard)
        self.now_us = 0

    def packet(self, kind: str) -> bytes:
        """Return a packet of `kind`."""
        return KINDS[kind](self)

    def _packed(self, message: Any, system: int = 1, component: int = 1) -> bytes:
        mav = dialect().MAVLink(None, system, component)
        mav.seq = self._rng.randrange(256)
        if self._rng.random() < 0.3:
            mav.signing.secret_key, mav.signing.sign_outgoing = OTHER_KEY, True
            mav.signing.timestamp = self._rng.randrange(1 << 48)
        return bytes(message.pack(mav))

    def _imu(self, time_us: int, values: list[float]) -> Any:
        m, rng = dialect(), self._rng
        counts = [rng.randrange(-(1 << 15), 1 << 15) for _ in range(9)]
        choice = rng.randrange(3)
        if choice == 0:
            return m.MAVLink_highres_imu_message(time_us, *values, *[0.0] * 7, 0xFFFF, rng.choice((0, 1, 2, 255)))
        if choice == 1:
            return m.MAVLink_raw_imu_message(time_us, *counts, rng.randrange(3))
        name = rng.choice(("scaled_imu", "scaled_imu2", "scaled_imu3"))
        return getattr(m, f"MAVLink_{name}_message")(time_us // 1000 % (1 << 32), *counts)

    def ids(self) -> bytes:
        """Return messages of a vehicle with ids of other systems and components."""
        rng, m = self._rng, dialect()
        message = rng.choice(
            (
                m.MAVLink_heartbeat_message(2, rng.choice((3, 12)), rng.choice((81, 209)), 0, 3, 3),
                self._imu(rng.randrange(1 << 32), [1.0, 2.0, 3.0, 0.1, 0.2, 0.3]),
                m.MAVLink_param_value_message(rng.choice(self._names), 0.7, 9, 100, 1),
                m.MAVLink_command_ack_message(511, 0),
            )
        )
        return self._packed(message, rng.choice((2, 255, 0, rng.randrange(2, 256))), rng.randrange(256))

    def values(self) -> bytes:
        """Return the vehicle's IMU messages with NaN, infinite, huge and subnormal values, at its times and others."""
        t = self._rng.choice((self.now_us + self._rng.randrange(20_000), self._rng.randrange(1 << 28)))
        return self._packed(self._imu(t, self._rng.choices(ODD, k=6)))

    def time(self) -> bytes:
        """Return IMU messages of the vehicle with any time: 0, 2^64 - 1, or running backwards."""
        rng = self._rng
        back = max(self.now_us - rng.randrange(1 << rng.randrange(1, 28)), 0)
        t = rng.choice((0, 1, (1 << 64) - 1, (1 << 63) + 5, rng.randrange(1 << rng.randrange(1, 64)), back, back))
        return self._packed(self._imu(t, [0.1, 0.2, -9.8, 0.01, 0.02, 0.03]))

    def parameters(self) -> bytes:
        """Return PARAM_VALUE and PARAM_ERROR of the names that mpucal reads, of any type and value."""
        rng, m = self._rng, dialect()
        name = rng.choice((rng.choice(self._names), rng.choice(self._names), rng.randbytes(rng.randrange(17))))
        if rng.random() < 0.1:
            return self._packed(m.MAVLink_param_error_message(1, 1, name, -1, rng.randrange(256)))
        value = rng.choice((*ODD, rng.uniform(-1, 1)))
        return self._packed(m.MAVLink_param_value_message(name, value, rng.randrange(256), 100, rng.randrange(65536)))

    def ftp(self) -> bytes:
        """Return FILE_TRANSFER_PROTOCOL: random payloads, and replies that look right."""
        rng = self._rng
        payload = bytearray(rng.randbytes(251))
        if rng.random() < 0.8:
            head = [rng.randrange(64), rng.randrange(3), rng.choice((128, 129))]
            head += [rng.randrange(256), rng.randrange(1, 10), 0, rng.randrange(1 << 12)]
            payload[:12] = struct.pack("<HBBBBBxI", *head)
        return self._packed(dialect().MAVLink_file_transfer_protocol_message(0, 254, 190, payload))

    def replayed(self) -> bytes:
        """Return packets of the vehicle again, with the signatures that they had, if any; some with bits flipped."""
        data = bytearray(self._rng.choice(self.heard))
        if self._rng.random() < 0.3:
            data[self._rng.randrange(len(data))] ^= 1 << self._rng.randrange(8)
        return bytes(data)

    def states(self) -> bytes:
        """Return HEARTBEAT (armed, of another autopilot), COMMAND_ACK and STATUSTEXT of the vehicle."""
        rng, m = self._rng, dialect()
        text = rng.choice((b"PreArm: \xff\x00\x1b[2J", rng.randbytes(50), b"mpucal: rotate"))
        message = rng.choice(
            (
                m.MAVLink_heartbeat_message(rng.randrange(256), rng.choice((3, 12, 8)), rng.choice((81, 209)), 0, 3, 3),
                m.MAVLink_command_ack_message(rng.choice((511, 401, 241, 512)), rng.randrange(10)),
                m.MAVLink_statustext_message(rng.randrange(8), text),
            )
        )
        return self._packed(message)

    def junk(self) -> bytes:
        """Return noise, and packets cut short."""
        whole = self.values() if self._rng.random() < 0.5 else b"\xfd" + self._rng.randbytes(self._rng.randrange(300))
        return whole[: self._rng.randrange(1, len(whole) + 1)]

    def mixed(self) -> bytes:
        """Return a packet of any other kind."""
        return self.packet(self._rng.choice([kind for kind in KINDS if kind != "mixed"]))


KINDS: dict[str, Callable[[Attacker], bytes]] = {
    name: getattr(Attacker, name)
    for name in ("ids", "values", "time", "parameters", "ftp", "replayed", "states", "junk", "mixed")
}


STRANGER, FORGED, SIGNED = "a stranger", "the address forged", "against signing"
ATTACKERS = (STRANGER, FORGED, SIGNED)
# limits of a burst: latest begin after the lock [s], duration [s], least rate [packets/s]
LATEST_S, LASTS_S, LEAST_HZ = {"session": 75.0, "write": 25.0}, (0.2, 60.0), 2.0
# one of this many begins with the link, before a vehicle is known
EARLY = 4
# timestamp of signatures; a vehicle's clock continues from one session to the next
SIGNED_AT = 1 << 40
# packets to replay
MOST_HEARD = 3000


@dataclass
class Attack:
    """Attack on one process; `heard` holds packets of the vehicle of an earlier session.

    Attributes
    ----------
    sent : number of packets that mpucal received. sets : (name, value, first value in the vehicle) of each PARAM_SET.
    """

    kind: str
    attacker: str
    firmware: str
    seed: int
    rate: float
    heard: Sequence[bytes] = ()
    sent: int = 0
    sets: list[tuple[str, float, float]] = field(default_factory=list)
    begin_s: float = 0.0
    lasts_s: float = math.inf
    hz: float = 0.0

    @property
    def early(self) -> bool:
        """True if it begins with the link."""
        return bool(self.rate) and self.seed % EARLY == 1

    def draw(self, command: str) -> None:
        """Draw begin, duration and rate for the next command."""
        self.sets, self.hz = [], self.rate
        if self.seed and self.rate:
            rng = random.Random(f"{self.seed} {command}")
            self.begin_s = 0.0 if self.early else rng.uniform(0.0, LATEST_S[command])
            self.lasts_s = math.exp(rng.uniform(*map(math.log, LASTS_S)))
            self.hz = math.exp(rng.uniform(math.log(LEAST_HZ), math.log(2 * self.rate)))

    def due(self, passed_s: float) -> int:
        """Return the number of packets until `passed_s`."""
        return int(min(max(passed_s - self.begin_s, 0.0), self.lasts_s) * self.hz)


class HostileTransport(SimulatedTransport):
    """Link of the simulated vehicle, on which the packets of `attack` arrive, too."""

    attack: Attack
    # truth of each vehicle when it was opened
    truths: ClassVar[list[dict[str, Any]]] = []

    def __init__(self, vehicle: SimulatedVehicle) -> None:
        super().__init__(vehicle)
        vehicle._mav.signing.timestamp = SIGNED_AT * (2 if self.attack.rate else 1)
        self.truths.append(vehicle.truth_document())
        self._attacker = Attacker(self.attack.seed, self.attack.firmware, self.attack.heard)
        self._from = "192.0.2.9:14550" if self.attack.attacker == STRANGER else ADDRESS
        self._begun_us = vehicle.now_us if self.attack.early else None
        self._due = 0
        self._asked = Parser(dialect().MAVLink(None))

    def restrict(self, address: str | None) -> None:
        """See Transport."""
        if self._begun_us is None:
            self._begun_us = self._vehicle.now_us

    def receive(self, until_ns: int) -> ReceivedBytes | None:
        """See Transport."""
        attacker = self._attacker
        if self._begun_us is not None and attacker.heard:
            attacker.now_us = self._vehicle.now_us
            due = self.attack.due((attacker.now_us - self._begun_us) * 1e-6)
            for _ in range(due - self._due):
                self._queue.appendleft(ReceivedBytes(attacker.packet(self.attack.kind), self._from, self.now_ns()))
            self.attack.sent += due - self._due
            self._due = due
        received = super().receive(until_ns)
        if received is not None and len(attacker.heard) < MOST_HEARD:
            attacker.heard.append(received.data)
        return received

    def close(self) -> None:
        """See Transport; packets that were not read do not count as sent."""
        self.attack.sent = max(self.attack.sent - len(self._queue), 0)
        super().close()

    def send(self, data: bytes, address: str | None) -> None:
        """See Transport; note each PARAM_SET with the first value in the vehicle."""
        store = self._vehicle.firmware.store
        for packet in self._asked.datagram(data):
            if packet.message.get_type() == "PARAM_SET":
                asked = from_wire(packet.message, self._vehicle.firmware.bytewise)
                first = next((old for name, _, old in self.attack.sets if name == asked.name), None)
                old = float(store[asked.name]) if first is None and asked.name in store else first
                self.attack.sets.append((asked.name, float(asked.value), float("nan") if old is None else old))
        super().send(data, address)


@contextmanager
def hostile(attack: Attack) -> Iterator[None]:
    """Attack `--mavlink sim` while the block runs, and leave out slow parts that are not tested here."""
    HostileTransport.attack = attack
    with (
        patch("mpucal.simulated.vehicle.SimulatedTransport", HostileTransport),
        without_pictures(),
        quick(),
    ):
        yield
