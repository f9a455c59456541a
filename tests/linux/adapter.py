"""Simulated chips behind an I2C adapter that the kernel drives: an i2c-tiny-usb, over USB/IP and a socket pair.

Source: Linux Documentation/usb/usbip_protocol.rst; drivers/i2c/busses/i2c-tiny-usb.c for its requests.
"""

import json
import socket
import struct
import sys
from collections.abc import Mapping
from pathlib import Path
from threading import Lock, Thread
from types import SimpleNamespace

from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.simulated.chip import SimulatedBus, open_simulated
from mpucal.simulated.chip.bus import RealClock

DEVICE = struct.pack("<BBHBBBBHHHBBBB", 18, 1, 0x0110, 0xFF, 0, 0, 64, 0x0403, 0xC631, 0x0205, 0, 0, 0, 1)
CONFIGURATION = struct.pack("<BBHBBBBB", 9, 2, 18, 1, 1, 0, 0x80, 50) + struct.pack("<9B", 9, 4, 0, 0, 0, 0xFF, 0, 0, 0)
# Plain I2C, and SMBus emulated with it
ABILITIES = struct.pack("<I", 0x0EFF0001)
SUBMIT, UNLINK, IN = 1, 2, 1
GET_FUNC, GET_STATUS, BEGINS, IO = 1, 3, 1, 4
FULL_SPEED, ADDRESSES = 2, (0x68, 0x69)


class Adapter:
    """Responder to the control requests of the kernel's driver.

    Parameters
    ----------
    buses : to the chips, by their address.
    """

    def __init__(self, buses: Mapping[int, SimulatedBus]) -> None:
        self._buses, self._register, self._status = buses, 0, 0
        # The kernel's driver takes register 0 for an MPU-6050's INT_STATUS: see docs/iio.md.
        self.register_0 = dict.fromkeys(buses, 1)

    def answer(self, setup: bytes, out: bytes) -> bytes:
        kind, request, value, index, length = struct.unpack("<BBHHH", setup)
        if kind & 0x60 == 0:
            # Standard requests: descriptors, and a status of zeros.
            return {1: DEVICE, 2: CONFIGURATION}.get(value >> 8, b"")[:length] if request == 6 else bytes(length)
        if request == GET_FUNC:
            return ABILITIES[:length]
        if request == GET_STATUS:
            return bytes([self._status])
        if not request & IO:
            return b""
        if index not in self._buses:
            self._status = 2
            return bytes(length) if kind & 0x80 else b""
        self._status = 1
        if value & 1:
            data = self._buses[index].read(self._register, length).data
            return data if self._register else bytes([self.register_0[index]]) + data[1:]
        if out:
            self._register = out[0]
        if len(out) > 1:
            self._buses[index].write(out[0], out[1:])
        return b""


def serve(line: socket.socket, adapter: Adapter, at_once: Lock) -> None:
    """Execute the commands of USB/IP, one after the other."""
    while head := _exactly(line, 48):
        command, number, _, direction, _ = struct.unpack(">5I", head[:20])
        if command == UNLINK:
            line.sendall(struct.pack(">5Ii24x", 4, number, 0, 0, 0, 0))
            continue
        length = struct.unpack(">I", head[24:28])[0]
        out = _exactly(line, length) if direction != IN and length else b""
        with at_once:
            data = adapter.answer(head[40:48], out)
        moved = len(data) if direction == IN else len(out)
        head = struct.pack(">5IiIiII8x", 3, number, 0, 0, 0, 0, moved, 0, 0, 0)
        line.sendall(head + (data if direction == IN else b""))


def _exactly(line: socket.socket, count: int) -> bytes:
    data = b""
    while len(data) < count:
        part = line.recv(count - len(data))
        if not part:
            return b""
        data += part
    return data


def obey(adapter: Adapter, buses: Mapping[int, SimulatedBus], at_once: Lock) -> None:
    """Obey lines of JSON on stdin until they end: prompts to the hands, or the content of a chip's register 0."""
    for line in sys.stdin:
        command = json.loads(line)
        with at_once:
            if "prompt" in command:
                for bus in buses.values():
                    bus.hear(SimpleNamespace(**command["prompt"]))
            else:
                adapter.register_0[command["address"]] = command["register_0"]


def main(text: str) -> None:
    """Serve the same chip at both addresses, moved by the same hand; on stdout, a line of JSON with its truth."""
    clock, at_once = RealClock(), Lock()
    buses = {address: open_simulated(text, clock=clock) for address in ADDRESSES}
    for bus in buses.values():
        # The kernel waits two seconds for a transfer: everything that the first ones import is imported here.
        driver = Driver(bus, Config(rate_hz=50))
        driver.start()
        driver.poll()
        driver.stop()
    adapter = Adapter(buses)
    ours, kernels = socket.socketpair()
    Path("/sys/devices/platform/vhci_hcd.0/attach").write_text(f"0 {kernels.fileno()} 65538 {FULL_SPEED}")
    Thread(target=serve, args=(ours, adapter, at_once), daemon=True).start()
    print(json.dumps(buses[ADDRESSES[0]].truth_document()), flush=True)
    obey(adapter, buses, at_once)


if __name__ == "__main__":
    main(*sys.argv[1:])
