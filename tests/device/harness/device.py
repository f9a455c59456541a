"""A program that is /dev/i2c-1 and /dev/spidev0.0: a simulated chip behind mocked adapters, until its input ends.

    python device.py sim:chip=mpu6500 CLOCK_FILE

On stdout, a line of JSON with the environment in which programs find it. On stdin, lines of JSON: {"prompt": ...}
lets the hand hear it, {"pass_s": S} lets time pass, {"adapter": {...}} changes the adapter, {"registers": {...}} writes
to the chip, {"seen": FILE} writes the messages on SPI to a file; each is answered by an empty line. CLOCK_FILE holds
the time, see clock.c.
"""

import json
import mmap
import sys
from pathlib import Path
from types import SimpleNamespace

from adapter import Adapter
from spi import SpiDevice
from umockdev import Testbed

from mpucal.chip.access import Reply
from mpucal.simulated.chip import SimulatedBus, open_simulated
from mpucal.simulated.chip.bus import CLOCKS, SimulatedClock

NODE, SPI_NODE, CLOCK_CHIP = "/dev/i2c-1", "/dev/spidev0.0", "DS3231"
DEVICES = """\
P: /devices/platform/i2c-1
E: SUBSYSTEM=i2c
A: name=mocked adapter

P: /devices/platform/i2c-1/i2c-dev/i2c-1
N: i2c-1
E: SUBSYSTEM=i2c-dev
E: DEVNAME=/dev/i2c-1
A: name=mocked adapter

P: /devices/platform/spi0.0/spidev/spidev0.0
N: spidev0.0
E: SUBSYSTEM=spidev
E: DEVNAME=/dev/spidev0.0
"""


class SharedClock:
    """The time in a file, which a program under test reads too."""

    def __init__(self, path: Path) -> None:
        with path.open("r+b") as file:
            self._page = mmap.mmap(file.fileno(), 8)
        self._opened = self._shown()

    def now(self) -> int:
        """Return the time since the device was opened."""
        return self._shown() - self._opened

    def spend(self, ns: int) -> None:
        """Advance the time by a transfer of `ns`, for the program under test too."""
        self._page[:] = (self._shown() + ns).to_bytes(8, "little")

    def sleep_until(self, t_ns: int) -> None:
        """Raise RuntimeError: only the program under test sleeps."""
        raise RuntimeError("the device does not wait")

    def _shown(self) -> int:
        return int.from_bytes(self._page, "little")


class ClockChip:
    """DS3231 at the MPU's address, at 23:59:45 on December 31st; its registers keep what is written."""

    def __init__(self) -> None:
        self._registers = bytearray.fromhex("45592307311299") + bytes(12)

    def read(self, register: int, count: int) -> Reply:
        """Read the nineteen registers, which repeat."""
        return Reply(bytes(self._registers[(register + i) % len(self._registers)] for i in range(count)), 0)

    def write(self, register: int, data: bytes) -> int:
        """Write registers."""
        for at, value in enumerate(data, register):
            self._registers[at % len(self._registers)] = value
        return 0


def open_bus(text: str, clock: Path) -> SimulatedBus | ClockChip:
    """The bus that `text` names, in the time of `clock`."""
    if text == CLOCK_CHIP:
        return ClockChip()

    def shared() -> SimulatedClock:
        return SharedClock(clock)

    CLOCKS["shared"] = shared  # type: ignore[assignment]
    return open_simulated(text + ("," if ":" in text else ":") + "pace=shared")


def main(text: str, clock: str) -> None:
    """Serve until stdin ends."""
    bus = open_bus(text, Path(clock))
    adapter, spi, testbed = Adapter(bus), SpiDevice(bus), Testbed()
    testbed.add(DEVICES)
    testbed.attach(NODE, adapter.answer)
    testbed.attach(SPI_NODE, spi.answer)
    environment = {"UMOCKDEV_DIR": testbed.folder, "LD_PRELOAD": "libumockdev-preload.so.0"}
    print(json.dumps(environment), flush=True)
    for line in sys.stdin:
        for what, value in json.loads(line).items():
            if what == "prompt":
                bus.hear(SimpleNamespace(**value))
            elif what == "pass_s":
                SharedClock(Path(clock)).spend(round(1e9 * value))
            elif what == "adapter":
                for name, setting in value.items():
                    setattr(adapter, name, frozenset(setting) if name == "bound" else setting)
            elif what == "seen":
                Path(value).write_text(json.dumps(spi.seen))
            elif what == "registers":
                for register, data in value.items():
                    bus.write(int(register), bytes.fromhex(data))
        print(flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
