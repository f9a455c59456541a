"""A link over simulated time to a simulated vehicle, and logs of known sensors."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

from mpucal.mavlink.dialect import dialect
from mpucal.mavlink.transport import Bytes

CAPTURES = Path(__file__).parents[2].parent / "shared" / "captures"
S = 1_000_000_000


@pytest.fixture
def captures() -> Path:
    if not CAPTURES.is_dir():
        pytest.skip("the folder of real captures is not beside this checkout")
    return CAPTURES


class Script:
    """A transport that plays (time [s], address, data), and keeps what is sent."""

    datagrams = True
    name = "a script"

    def __init__(self, arriving: Sequence[tuple[float, str, bytes]], outward: bool = False, datagrams: bool = True):
        self.arriving = [Bytes(data, address, round(t * S)) for t, address, data in arriving]
        self.outward, self.datagrams = outward, datagrams
        self.sent: list[tuple[float, str | None, bytes]] = []
        self.answer: Callable[[bytes], Sequence[bytes]] = lambda data: ()
        self._now_ns = 0

    def now_ns(self) -> int:
        return self._now_ns

    def receive(self, until_ns: int) -> Bytes | None:
        if self.arriving and self.arriving[0].t_ns < until_ns:
            received = self.arriving.pop(0)
            self._now_ns = max(self._now_ns, received.t_ns)
            return received
        self._now_ns = max(self._now_ns, until_ns)
        return None

    def settle(self, address: str | None) -> None:
        pass

    def send(self, data: bytes, address: str | None) -> None:
        self.sent.append((self._now_ns / S, address, data))
        answers = [Bytes(answer, address or "vehicle:1", self._now_ns) for answer in self.answer(data)]
        self.arriving = [*answers, *self.arriving]

    def close(self) -> None:
        pass


@pytest.fixture
def script() -> type[Script]:
    return Script


@pytest.fixture(scope="session")
def station():
    """station(system) makes packets: heartbeat(), raw(t_us), message(name, **fields)."""

    def make(system: int = 1, component: int = 1, autopilot: int = 3, key: bytes | None = None):
        m = dialect()
        mav = m.MAVLink(None, system, component)
        if key is not None:
            mav.signing.secret_key, mav.signing.sign_outgoing, mav.signing.timestamp = key, True, 1 << 40

        def packed(message):
            data = bytes(message.pack(mav))
            mav.seq = (mav.seq + 1) % 256
            return data

        def message(name, *fields):
            return packed(getattr(mav, f"{name}_encode")(*fields))

        def heartbeat():
            return message("heartbeat", m.MAV_TYPE_QUADROTOR, autopilot, 81, 0, 3)

        def raw(t_us, acc=(1, -2, -998), gyr=(3, 0, -4)):
            return message("raw_imu", t_us, *acc, *gyr, 0, 0, 0, 0, 2500)

        return SimpleNamespace(message=message, heartbeat=heartbeat, raw=raw, mav=mav)

    return make


@pytest.fixture(scope="session")
def decoded():
    """decoded(data): the message in a packet."""
    mav = dialect().MAVLink(None)
    return lambda data: mav.decode(bytearray(data))


@pytest.fixture(scope="session")
def turned():
    """turned(n, hz): t [s], acc, gyr of a sensor with known D and b_a, flat first and then turned about varied axes."""

    def make(D, b_a, seconds=60.0, hz=50.0):
        t = np.arange(round(seconds * hz)) / hz
        moving = np.clip((t - 12.0) / 1.0, 0.0, 1.0)
        w = moving[:, None] * np.stack(
            [1.1 * np.sin(0.9 * t), 0.9 * np.sin(0.53 * t + 1.0), 0.8 * np.cos(0.31 * t)], axis=1
        )
        R, down = np.eye(3), np.zeros((len(t), 3))
        for k in range(len(t)):
            down[k] = R.T @ [0.0, 0.0, -9.80665]
            turn = 0.5 * (w[k] + w[min(k + 1, len(t) - 1)]) / hz
            angle = np.linalg.norm(turn)
            if angle:
                x, y, z = turn / angle
                K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
                R = R @ (np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K)
        noise = np.random.default_rng(4)
        acc = down @ np.asarray(D).T + b_a + noise.normal(0.0, 0.02, (len(t), 3))
        return t, acc, w + noise.normal(0.0, 0.001, (len(t), 3)) + [0.004, -0.003, 0.002]

    return make


class Dataflash:
    """Writes ArduPilot's binary log: FMT messages that describe the others, then those."""

    TYPES: ClassVar = {"n": 4, "N": 16, "Z": 64}

    def __init__(self) -> None:
        self._data = bytearray()
        self._kinds: dict[str, tuple[int, str]] = {}

    def describe(self, name: str, kind: int, format_: str, columns: str) -> None:
        code = "<" + "".join(f"{self.TYPES[c]}s" if c in self.TYPES else c for c in format_)
        self._kinds[name] = (kind, code)
        fmt = struct.pack(
            "<BB4s16s64s", kind, 3 + struct.calcsize(code), name.encode(), format_.encode(), columns.encode()
        )
        self._data += b"\xa3\x95\x80" + fmt

    def add(self, name: str, *values) -> None:
        kind, code = self._kinds[name]
        self._data += b"\xa3\x95" + bytes([kind]) + struct.pack(code, *values)

    def bytes(self) -> bytes:
        return bytes(self._data)


@pytest.fixture
def dataflash() -> Dataflash:
    log = Dataflash()
    log.describe("FMT", 0x80, "BBnNZ", "Type,Length,Name,Format,Columns")
    log.describe("PARM", 0x81, "QNff", "TimeUS,Name,Value,Default")
    log.describe("IMU", 0x82, "QBffffffIIfBBHH", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz")
    return log
