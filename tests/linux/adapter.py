"""The simulated chip behind an I2C adapter that the kernel drives: an i2c-tiny-usb, over USB/IP and a socket pair.

Source: Linux Documentation/usb/usbip_protocol.rst; drivers/i2c/busses/i2c-tiny-usb.c for its requests.
"""

from __future__ import annotations

import socket
import struct
import sys
from pathlib import Path

from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.simulated.chip import open_simulated

DEVICE = struct.pack("<BBHBBBBHHHBBBB", 18, 1, 0x0110, 0xFF, 0, 0, 64, 0x0403, 0xC631, 0x0205, 0, 0, 0, 1)
CONFIGURATION = struct.pack("<BBHBBBBB", 9, 2, 18, 1, 1, 0, 0x80, 50) + struct.pack("<9B", 9, 4, 0, 0, 0, 0xFF, 0, 0, 0)
# plain I2C, and SMBus made of it
ABILITIES = struct.pack("<I", 0x0EFF0001)
SUBMIT, UNLINK, IN = 1, 2, 1
GET_FUNC, GET_STATUS, BEGINS, IO = 1, 3, 1, 4
FULL_SPEED, ADDRESS = 2, 0x68


class Adapter:
    """Answers the control requests of the kernel's driver."""

    def __init__(self, bus) -> None:
        self._bus, self._register, self._status = bus, 0, 0

    def answer(self, setup: bytes, out: bytes) -> bytes:
        kind, request, value, index, length = struct.unpack("<BBHHH", setup)
        if kind & 0x60 == 0:
            # standard requests: its descriptors, and a status of zeros
            return {1: DEVICE, 2: CONFIGURATION}.get(value >> 8, b"")[:length] if request == 6 else bytes(length)
        if request == GET_FUNC:
            return ABILITIES[:length]
        if request == GET_STATUS:
            return bytes([self._status])
        if not request & IO:
            return b""
        if index != ADDRESS:
            self._status = 2
            return bytes(length) if kind & 0x80 else b""
        self._status = 1
        if value & 1:
            return self._bus.read(self._register, length).data
        if out:
            self._register = out[0]
        if len(out) > 1:
            self._bus.write(out[0], out[1:])
        return b""


def serve(line: socket.socket, adapter: Adapter) -> None:
    """USB/IP's commands, one after the other."""
    while head := _exactly(line, 48):
        command, number, _, direction, _ = struct.unpack(">5I", head[:20])
        if command == UNLINK:
            line.sendall(struct.pack(">5Ii24x", 4, number, 0, 0, 0, 0))
            continue
        length = struct.unpack(">I", head[24:28])[0]
        out = _exactly(line, length) if direction != IN and length else b""
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


if __name__ == "__main__":
    ours, kernels = socket.socketpair()
    bus = open_simulated(sys.argv[1])
    # the kernel waits two seconds for a transfer: what loads at the first ones is loaded before
    driver = Driver(bus, Config(rate_hz=50))
    driver.start()
    driver.poll()
    driver.stop()
    adapter = Adapter(bus)
    attach = Path("/sys/devices/platform/vhci_hcd.0/attach")
    attach.write_text(f"0 {kernels.fileno()} 65538 {FULL_SPEED}")
    serve(ours, adapter)
