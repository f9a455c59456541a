"""Makes hostile MAVLink packets of each kind, as whole datagrams; see tools/attack/hostile_vehicle.py."""

from __future__ import annotations

import random
import struct
from collections.abc import Callable, Sequence
from typing import Any

from mpucal.mavlink.dialect import dialect
from mpucal.mavlink.ftp import PAYLOAD
from mpucal.mavlink.stream_parameters import stream_parameter_names

OTHER_KEY = bytes(32)
ODD = (float("nan"), float("inf"), -float("inf"), 3.4e38, -3.4e38, 1e-45, 0.0, 1.0, -9.8)
# how many packets of a kind are kept to be sent again, and how often a new one is made instead
KEPT, FRESH = 2000, 0.1


class Attacker:
    """Makes packets of each kind.

    Attributes
    ----------
    heard : what the vehicle sent, to be replayed, and what it sent in an earlier session. now_us : its clock.
    """

    def __init__(self, seed: int, firmware: str, heard: Sequence[bytes] = ()) -> None:
        self._rng = random.Random(seed)
        self._made: dict[str, list[bytes]] = {}
        self._names = [name.encode() for name in stream_parameter_names("PX4" if firmware == "px4" else "ArduPilot")]
        self.heard = list(heard)
        self.now_us = 0

    def packet(self, kind: str) -> bytes:
        """Return a packet of `kind`: a new one, or one that was made before, as making them takes longest."""
        made, rng = self._made.setdefault(kind, []), self._rng
        if len(made) < KEPT:
            made.append(KINDS[kind](self))
            return made[-1]
        at = int(rng.random() * KEPT)
        if rng.random() < FRESH:
            made[at] = KINDS[kind](self)
        return made[at]

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
        """Return what a vehicle sends, from other systems and components."""
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
        """Return the vehicle's IMU messages at times of anywhere: 0, 2^64 - 1, and its own, running backwards."""
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
        """Return FILE_TRANSFER_PROTOCOL: payloads of noise, and answers that might be meant."""
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
