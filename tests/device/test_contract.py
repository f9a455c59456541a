"""Contract of a bus, tested on the real smbus2 and a character device."""

import importlib.util
import json
import socket
import sys
from pathlib import Path

import pytest

from mpucal.chip.access import Reply

CONTRACT = Path(__file__).parents[1] / "sources" / "test_contract.py"
PWR_MGMT_1, DEVICE_RESET = "107", "80"
# one I2cBus in a process for which /dev/i2c-1 is there
SERVER = """
import json, sys
from mpucal.sources.i2c import I2cBus
bus = I2cBus("/dev/i2c-1")
for line in sys.stdin:
    name, *arguments = json.loads(line)
    if name == "end":
        print("null", flush=True)
        break
    if name == "write":
        arguments[1] = bytes.fromhex(arguments[1])
    reply = getattr(bus, name)(*arguments)
    print(json.dumps([reply[0].hex(), reply[1]] if name == "read" else reply), flush=True)
"""


class DistantBus:
    """I2cBus of that process."""

    def __init__(self, device):
        here, there = socket.socketpair()
        self._lines, files = here.makefile("rw"), [there.fileno(), there.fileno(), sys.__stderr__.fileno()]
        with here, there:
            self._program = device.programs.start(
                SERVER, "server.py", folder=device.folder, environment=device.environment, files=files
            )

    def read(self, register, count):
        data, t_ns = self._ask("read", register, count)
        return Reply(bytes.fromhex(data), t_ns)

    def write(self, register, data):
        return self._ask("write", register, data.hex())

    def sleep_until(self, t_ns):
        self._ask("sleep_until", t_ns)

    def close(self):
        self._ask("close")

    def end(self):
        self._ask("end")
        self._lines.close()
        assert self._program.wait() == 0

    def _ask(self, *words):
        self._lines.write(json.dumps(words) + "\n")
        self._lines.flush()
        return json.loads(self._lines.readline())


def _contract():
    spec = importlib.util.spec_from_file_location("contract", CONTRACT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def still(device_of_module):
    return device_of_module("still")


@pytest.fixture
def bus(still):
    """Opens the bus to a chip that was just switched on."""
    still.tell(registers={PWR_MGMT_1: DEVICE_RESET})
    distant = DistantBus(still)
    yield distant
    distant.end()


def test_the_contract(bus):
    _contract().test_registers_are_kept_the_fifo_does_not_increment_and_time_never_goes_back(bus)
