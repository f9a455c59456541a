"""The simulated vehicle's link with an attacker on it; see tools/attack/hostile_vehicle.py."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, ClassVar
from unittest.mock import patch

from mpucal.mavlink.dialect import Parser, dialect
from mpucal.mavlink.parameters.encoding import from_wire
from mpucal.mavlink.transport import ReceivedBytes
from mpucal.session import results
from mpucal.simulated.vehicle import SimulatedVehicle
from mpucal.simulated.vehicle.transport import ADDRESS, SimulatedTransport
from tools.processes import quick

from .hostile_packets import Attacker

STRANGER, FORGED, SIGNED = "a stranger", "the address forged", "against signing"
ATTACKERS = (STRANGER, FORGED, SIGNED)
# of a burst: begins so long after the lock [s], lasts [s], comes at [packets/s]
LATEST_S, LASTS_S, LEAST_HZ = {"session": 75.0, "write": 25.0}, (0.2, 60.0), 2.0
# one of so many begins with the link, before anybody is known
EARLY = 4
# signed at; a vehicle's clock goes on from one session to the next
SIGNED_AT = 1 << 40
# packets to replay
MOST_HEARD = 3000


@dataclass
class Attack:
    """An attack that one process suffers; `heard` is what the vehicle sent in an earlier session.

    Attributes
    ----------
    sent : packets that mpucal was given. sets : (name, value, what the vehicle held first) of each PARAM_SET.
    """

    kind: str
    attacker: str
    firmware: str
    seed: int
    rate: float
    heard: Sequence[bytes] = ()
    sent: int = 0
    sets: list[tuple[str, float, float]] = field(default_factory=list)
    early: bool = False
    begin_s: float = 0.0
    lasts_s: float = math.inf
    hz: float = 0.0

    def draw(self, command: str) -> None:
        """Draw when and how fast it happens during the next command."""
        self.sets, self.hz = [], self.rate
        if self.seed and self.rate:
            rng = random.Random(f"{self.seed} {command}")
            self.early = self.seed % EARLY == 1
            self.begin_s = 0.0 if self.early else rng.uniform(0.0, LATEST_S[command])
            self.lasts_s = math.exp(rng.uniform(*map(math.log, LASTS_S)))
            self.hz = math.exp(rng.uniform(math.log(LEAST_HZ), math.log(2 * self.rate)))

    def due(self, passed_s: float) -> int:
        """Return how many packets come within so long."""
        return int(min(max(passed_s - self.begin_s, 0.0), self.lasts_s) * self.hz)


class HostileTransport(SimulatedTransport):
    """The simulated vehicle's link, onto which `attack` sends."""

    attack: Attack
    # of each that was opened, as it was then
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
        """See Transport; what was not read any more was not heard."""
        self.attack.sent = max(self.attack.sent - len(self._queue), 0)
        super().close()

    def send(self, data: bytes, address: str | None) -> None:
        """See Transport; what is set is noted, with what the vehicle held at the start."""
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
    """Meanwhile `--mavlink sim` is attacked, and little is computed that is not tried here."""
    HostileTransport.attack = attack
    with (
        patch("mpucal.simulated.vehicle.source.SimulatedTransport", HostileTransport),
        patch.object(results, "report", lambda _: None),
        quick(),
    ):
        yield
