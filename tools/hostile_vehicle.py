"""Hostile MAVLink packets beside a vehicle, during a session that writes back and during `mpucal write --store`.

    python tools/hostile_vehicle.py                          # every kind, until 100,000 packets of it were heard
    python tools/hostile_vehicle.py --packets 2000 ids ftp

The simulated vehicle and the attacker share one link, and the packets go through the code that those of a socket do.
The attacker sends as a stranger (an address of its own), as the vehicle (its address forged, nothing signed) and
against signing (the address forged, both sides sign, and it has no key). Each run is a process of its own: both
commands, with `--rate` packets a second of the vehicle's time from the lock on. Of a stranger, and against signing, the
calibration must be the undisturbed one to the bit, and be written. Always wrong is exit code 1, a trace, and a
parameter set that is neither the vehicle's own value nor that of calibration.json. Exit code 1 where a run was wrong.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import random
import struct
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from mpucal import durable
from mpucal.__main__ import _keep_streams, run
from mpucal.mavlink.dialect import Parser, dialect
from mpucal.mavlink.ftp import PAYLOAD
from mpucal.mavlink.parameters.encoding import of_wire
from mpucal.mavlink.parameters.write import DETOUR
from mpucal.mavlink.stream_parameters import stream_parameter_names
from mpucal.mavlink.transport import Bytes
from mpucal.result.calibration import Calibration
from mpucal.simulated.vehicle import SimulatedVehicle
from mpucal.simulated.vehicle.transport import ADDRESS, SimulatedTransport

KEY, OTHER_KEY = bytes(range(32)), bytes(32)
FIRMWARES = ("ardupilot", "px4")
STRANGER, FORGED, SIGNED = "a stranger", "the address forged", "against signing"
ATTACKERS = (STRANGER, FORGED, SIGNED)
ODD = (float("nan"), float("inf"), -float("inf"), 3.4e38, -3.4e38, 1e-45, 0.0, 1.0, -9.8)
MOST_RUNS = 60


class Attacker:
    """Makes packets of each kind, as whole datagrams."""

    def __init__(self, seed: int, firmware: str) -> None:
        self._rng = random.Random(seed)
        self._names = [name.encode() for name in stream_parameter_names("PX4" if firmware == "px4" else "ArduPilot")]
        self.heard: list[bytes] = []

    def packet(self, kind: str) -> bytes:
        """One of `kind`."""
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
        return getattr(m, f"MAVLink_{name}_message")(time_us % (1 << 32), *counts)

    def ids(self) -> bytes:
        """What a vehicle sends, from other systems and components."""
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
        """The vehicle's IMU messages with NaN, infinite, huge and subnormal values."""
        return self._packed(self._imu(self._rng.randrange(1 << 28), self._rng.choices(ODD, k=6)))

    def time(self) -> bytes:
        """The vehicle's IMU messages at times of anywhere, 0 and 2^64 - 1 among them."""
        t = self._rng.choice((0, 1, (1 << 64) - 1, (1 << 63) + 5, self._rng.randrange(1 << self._rng.randrange(1, 64))))
        return self._packed(self._imu(t, [0.1, 0.2, -9.8, 0.01, 0.02, 0.03]))

    def parameters(self) -> bytes:
        """PARAM_VALUE and PARAM_ERROR of the names that mpucal reads, of any type and value."""
        rng, m = self._rng, dialect()
        name = rng.choice((rng.choice(self._names), rng.choice(self._names), rng.randbytes(rng.randrange(17))))
        if rng.random() < 0.1:
            return self._packed(m.MAVLink_param_error_message(1, 1, name, -1, rng.randrange(256)))
        value = rng.choice((*ODD, rng.uniform(-1, 1)))
        return self._packed(m.MAVLink_param_value_message(name, value, rng.randrange(256), 100, rng.randrange(65536)))

    def ftp(self) -> bytes:
        """FILE_TRANSFER_PROTOCOL: payloads of noise, and answers that might be meant."""
        rng = self._rng
        payload = bytearray(rng.randbytes(PAYLOAD))
        if rng.random() < 0.8:
            head = (
                rng.randrange(64),
                rng.randrange(3),
                rng.choice((128, 129)),
                rng.randrange(256),
                rng.randrange(1, 10),
            )
            payload[:12] = struct.pack("<HBBBBBxI", *head, 0, rng.randrange(1 << 12))
        return self._packed(dialect().MAVLink_file_transfer_protocol_message(0, 254, 190, payload))

    def replayed(self) -> bytes:
        """Packets of the vehicle again, with the signatures that they had, if any; some with bits flipped."""
        data = bytearray(self._rng.choice(self.heard))
        if self._rng.random() < 0.3:
            data[self._rng.randrange(len(data))] ^= 1 << self._rng.randrange(8)
        return bytes(data)

    def states(self) -> bytes:
        """HEARTBEAT (armed, of another autopilot), COMMAND_ACK and STATUSTEXT of the vehicle."""
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
        """Noise, and packets cut short."""
        whole = self.values() if self._rng.random() < 0.5 else b"\xfd" + self._rng.randbytes(self._rng.randrange(300))
        return whole[: self._rng.randrange(1, len(whole) + 1)]

    def mixed(self) -> bytes:
        """One of any other kind."""
        return self.packet(self._rng.choice([kind for kind in KINDS if kind != "mixed"]))


KINDS: dict[str, Callable[[Attacker], bytes]] = {
    name: getattr(Attacker, name)
    for name in ("ids", "values", "time", "parameters", "ftp", "replayed", "states", "junk", "mixed")
}


@dataclass
class Attack:
    """What one process suffers, and what became of it."""

    kind: str
    attacker: str
    firmware: str
    seed: int
    rate: float
    sent: int = 0
    sets: list[tuple[str, float, float]] = field(default_factory=list)


class HostileTransport(SimulatedTransport):
    """The simulated vehicle's link, onto which `attack` sends from the lock on."""

    attack: Attack

    def __init__(self, vehicle: SimulatedVehicle) -> None:
        super().__init__(vehicle)
        self._attacker = Attacker(self.attack.seed, self.attack.firmware)
        self._locked_us: int | None = None
        self._due = 0
        self._asked = Parser(dialect().MAVLink(None))

    def settle(self, address: str | None) -> None:
        """See Transport."""
        self._locked_us = self._vehicle.now_us

    def receive(self, until_ns: int) -> Bytes | None:
        """See Transport."""
        if self._locked_us is not None and self._attacker.heard:
            wanted = int((self._vehicle.now_us - self._locked_us) * 1e-6 * self.attack.rate)
            address = "192.0.2.9:14550" if self.attack.attacker == STRANGER else ADDRESS
            for _ in range(wanted - self._due):
                self._queue.appendleft(Bytes(self._attacker.packet(self.attack.kind), address, self.now_ns()))
            self.attack.sent += wanted - self._due
            self._due = wanted
        received = super().receive(until_ns)
        if received is not None and len(self._attacker.heard) < 3000:
            self._attacker.heard.append(received.data)
        return received

    def send(self, data: bytes, address: str | None) -> None:
        """See Transport; what is set is noted, with what the vehicle held at the start."""
        store = self._vehicle.firmware.store
        for packet in self._asked.datagram(data):
            if packet.message.get_type() == "PARAM_SET":
                asked = of_wire(packet.message, self._vehicle.firmware.bytewise)
                first = next((old for name, _, old in self.attack.sets if name == asked.name), None)
                old = float(store[asked.name]) if first is None and asked.name in store else first
                self.attack.sets.append((asked.name, float(asked.value), float("nan") if old is None else old))
        super().send(data, address)


def commands(attack: Attack, clean: Path | None) -> Iterator[tuple[str, list[str]]]:
    """Each command, and the file whose parameters it may set."""
    vehicle = [f"sim:firmware={attack.firmware}"]
    signing = ["--signing-key", "key"] if attack.attacker == SIGNED else []
    yield "out/calibration.json", ["session", "--mavlink", *vehicle, *signing, "-o", "out", "--yes"]
    if clean is not None:
        words = ["write", str(clean), "autopilot", "--mavlink", *vehicle, *signing, "--store", "--yes", "-o", "written"]
        yield str(clean), words


def suffer(attack: Attack, clean: Path | None, place: Path) -> dict[str, Any]:
    """Run the commands here, in this process, and judge them."""
    place.mkdir(parents=True)
    os.chdir(place)
    Path("key").write_bytes(KEY)
    os.environ["XDG_STATE_HOME"] = str(place / "state")
    said = os.open("said", os.O_RDWR | os.O_CREAT)
    os.dup2(said, 1)
    os.dup2(said, 2)
    _keep_streams()
    HostileTransport.attack = attack
    codes, wrong, unasked = [], [], 0
    with (
        patch("mpucal.simulated.vehicle.source.SimulatedTransport", HostileTransport),
        patch.object(durable.Durable, "__init__", lambda self, _file: setattr(self, "close", lambda: None)),
    ):
        for file, words in commands(attack, clean):
            attack.sets = []
            codes.append(run(words))
            extra = not_asked(attack.sets, Path(file))
            unasked += len(extra)
            wrong += [f"{words[0]} set {extra[0]}"] if extra else []
    text = Path("said").read_text("utf-8", "replace")
    if 1 in codes or "Traceback" in text:
        wrong.append(f"a trace ({text.strip().splitlines()[-1][:120]})")
    undisturbed = clean is None or same(Path("out/calibration.json"), clean)
    if attack.attacker != FORGED and (any(codes) or not undisturbed):
        wrong.append(f"not as without: exit codes {codes}")
    return {"sent": attack.sent, "codes": codes, "wrong": wrong, "unasked": unasked}


def not_asked(sets: list[tuple[str, float, float]], file: Path) -> list[tuple[str, float]]:
    """What was set that is neither of the calibration in `file` nor the vehicle's own."""
    new: dict[str, float] = {}
    if file.is_file():
        document = json.loads(file.read_text())
        for imu in (document, *document["others"]):
            new |= imu["autopilot"].get("params_new", {})
    return [
        (name, value)
        for name, value, old in sets
        if name not in new or not min(abs(value - old), abs(value - new[name])) <= DETOUR * 1.01
    ]


def same(file: Path, clean: Path) -> bool:
    """Whether both hold the same D and b_a."""
    if not file.is_file():
        return False
    one, other = map(Calibration.load, (file, clean))
    return bool(np.array_equal(one.D, other.D) and np.array_equal(one.b_a, other.b_a))


def job(task: tuple[Attack, Path | None, Path]) -> tuple[Attack, dict[str, Any]]:
    """One attack, in a process of its own."""
    return task[0], suffer(*task)


def main() -> int:
    """Run them and print the table; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=f"some of: {', '.join(KINDS)}; default: all")
    parser.add_argument("--packets", type=int, default=100_000, help="of each kind and attacker")
    parser.add_argument("--rate", type=float, default=500.0, help="packets a second of the vehicle's time")
    parser.add_argument("--attacker", choices=ATTACKERS, action="append")
    parser.add_argument("--firmware", choices=FIRMWARES, action="append")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--keep", type=Path, help="where the files of the runs stay")
    asked = parser.parse_args()
    firmwares = asked.firmware or FIRMWARES
    failed = 0
    context = multiprocessing.get_context("fork")
    with tempfile.TemporaryDirectory() as temporary, context.Pool(asked.jobs, maxtasksperchild=1) as pool:
        place = (asked.keep or Path(temporary)).resolve()
        quiet = [Attack("ids", STRANGER, firmware, 0, 0.0) for firmware in firmwares]
        for attack, outcome in pool.imap(job, [(a, None, place / a.firmware) for a in quiet], 1):
            if outcome["wrong"]:
                raise SystemExit(f"{attack.firmware} undisturbed: {outcome}")
        for kind in asked.kinds or KINDS:
            for attacker in asked.attacker or ATTACKERS:
                failed += campaign(pool, asked, place, kind, attacker)
    return int(failed > 0)


def campaign(pool: Any, asked: argparse.Namespace, place: Path, kind: str, attacker: str) -> int:
    """Runs until enough packets of one kind were sent; how many were wrong."""
    sent = unasked = runs = 0
    codes: Counter[str] = Counter()
    wrongs: list[str] = []
    firmwares = asked.firmware or FIRMWARES
    while sent < asked.packets and runs < MOST_RUNS:
        tasks = []
        for firmware in firmwares:
            clean = place / firmware / "out" / "calibration.json"
            here = place / f"{kind}-{attacker.replace(' ', '-')}-{firmware}-{runs}"
            tasks.append((Attack(kind, attacker, firmware, runs, asked.rate), clean, here))
        for _, outcome in pool.imap(job, tasks, 1):
            sent, unasked = sent + outcome["sent"], unasked + outcome["unasked"]
            codes[",".join(map(str, outcome["codes"]))] += 1
            wrongs += outcome["wrong"]
        runs += 1
    exits = " ".join(f"{code} x{count}" for code, count in codes.most_common())
    print(f"{kind:11}{attacker:20}{sent:8} packets, {unasked} sets not asked for, {len(wrongs)} wrong; exits {exits}")
    for wrong in sorted(set(wrongs))[:5]:
        print(f"    WRONG {wrong}")
    sys.stdout.flush()
    return len(wrongs)


if __name__ == "__main__":
    sys.exit(main())
