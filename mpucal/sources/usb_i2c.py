"""A chip on a USB adapter that no driver of the kernel holds: an FT232H by pyftdi, an MCP2221 by EasyMCP2221.

Both write the register and read behind a repeated start, which is what the chip wants; the time of a transfer is the
host's, just before. CH341 and CP2112 have a driver of the Linux kernel, and are /dev/i2c-N there.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any, Protocol

from ..chip.access import Reply
from ..chip.families import PARTS
from ..chip.registers import FIFO_R_W, WHO_AM_I
from ..errors import BusError, NoAnswer
from .chip import OpenedChip
from .i2c import ADDRESSES
from .i2c_errors import no_answer_error
from .kind import Request

I2C_HZ = 400_000
# of an MPSSE engine's command buffer; an adapter's latency makes shorter ones no faster
LONGEST = 1024
MCP2221_VENDOR, MCP2221_PRODUCT = 0x04D8, 0x00DD


class Adapter(Protocol):
    """What moves bytes; `missing` is what its library raises where nothing acknowledges."""

    missing: type[Exception]

    def exchange(self, address: int, out: bytes, count: int) -> bytes:
        """Write `out`, then read `count` bytes behind a repeated start."""
        ...

    def write(self, address: int, out: bytes) -> None:
        """Write `out`."""
        ...

    def close(self) -> None:
        """Let go of it."""
        ...


class Ftdi:
    """An FT232H, FT2232H or FT4232H; `url` as pyftdi has it, such as ftdi://ftdi:232h/1."""

    def __init__(self, url: str) -> None:
        from pyftdi.i2c import I2cController, I2cNackError  # noqa: PLC0415 - an extra

        # it logs each address that is not acknowledged
        logging.getLogger("pyftdi.i2c").setLevel(logging.ERROR)
        self.missing = I2cNackError
        self._controller = I2cController()
        self._controller.configure(url, frequency=I2C_HZ)

    def exchange(self, address: int, out: bytes, count: int) -> bytes:
        """Write `out`, then read `count` bytes."""
        return bytes(self._controller.exchange(address, out, count))

    def write(self, address: int, out: bytes) -> None:
        """Write `out`."""
        self._controller.write(address, out)

    def close(self) -> None:
        """Let go of it."""
        self._controller.close()


class Mcp2221:
    """An MCP2221(A): mcp2221, or mcp2221:SERIAL of several."""

    def __init__(self, name: str) -> None:
        import EasyMCP2221  # noqa: PLC0415 - an extra
        from EasyMCP2221.exceptions import NotAckError  # noqa: PLC0415 - the same

        self.missing = NotAckError
        self._device = EasyMCP2221.Device(usbserial=name.partition(":")[2] or None, scan_serial=True)
        self._device.I2C_speed(I2C_HZ)

    def exchange(self, address: int, out: bytes, count: int) -> bytes:
        """Write `out`, then read `count` bytes."""
        self._device.I2C_write(address, out, kind="nonstop")
        return bytes(self._device.I2C_read(address, count, kind="restart"))

    def write(self, address: int, out: bytes) -> None:
        """Write `out`."""
        self._device.I2C_write(address, out)

    def close(self) -> None:
        """Let go of it: EasyMCP2221 keeps each device open for the next one that asks."""
        self._device.__del__()


def open_ftdi(request: Request) -> OpenedChip:
    """The chip on the adapter that --bus ftdi://... names."""
    return _opened(request, "pyftdi", Ftdi)


def open_mcp2221(request: Request) -> OpenedChip:
    """The chip on the adapter that --bus mcp2221[:SERIAL] names."""
    return _opened(request, "EasyMCP2221", Mcp2221)


def _opened(request: Request, library: str, adapter: Callable[[str], Adapter]) -> OpenedChip:
    if find_spec(library) is None:
        raise BusError(f"the Python library {library} is not installed", "pip install mpucal[usb]")
    return OpenedChip(UsbBus(request.value, adapter, request.values.get("address")), request.plan, words=request.words)


class UsbBus:
    """The chip at one address of a USB adapter; the clock is the monotonic one of the host.

    Parameters
    ----------
    name : of the adapter, which `adapter` opens. address : where the chip is; None tries 0x68, then 0x69.

    Raises
    ------
    BusError : no such adapter, no permission, or another program has it. NoAnswer : nothing acknowledges the address.
    """

    def __init__(self, name: str, adapter: Callable[[str], Adapter], address: int | None = None) -> None:
        self._name = name
        try:
            self._adapter = adapter(name)
        except Exception as error:  # libusb, hidapi and both libraries have their own
            raise BusError(
                f"the USB adapter {name} cannot be opened ({error})",
                "plug it in, end other programs that use it, and see docs/boards.md for permissions and drivers",
            ) from error
        try:
            self.address = self._find(ADDRESSES if address is None else (address,))
        except BaseException:
            self._adapter.close()
            raise

    def read(self, register: int, count: int) -> Reply:
        """`count` bytes from `register` on; the time is the one just before the first transfer."""
        t_ns, data = time.monotonic_ns(), b""
        while len(data) < count:
            place = register if register == FIFO_R_W else register + len(data)
            with self._told(self.address):
                data += self._adapter.exchange(self.address, bytes([place]), min(count - len(data), LONGEST))
        return Reply(data, t_ns)

    def write(self, register: int, data: bytes) -> int:
        """Write `data` from `register` on, and return the time just before the transfer."""
        t_ns = time.monotonic_ns()
        with self._told(self.address):
            self._adapter.write(self.address, bytes([register]) + data)
        return t_ns

    def sleep_until(self, t_ns: int) -> None:
        """Sleep until the monotonic clock shows `t_ns`."""
        time.sleep(max(0, t_ns - time.monotonic_ns()) * 1e-9)

    def close(self) -> None:
        """Let go of the adapter."""
        self._adapter.close()

    def _find(self, addresses: tuple[int, ...]) -> int:
        """The first address at which a known part answers, else the first that answers at all."""
        there = {}
        for address in addresses:
            try:
                with self._told(address):
                    there[address] = self._adapter.exchange(address, bytes([WHO_AM_I]), 1)[0]
            except NoAnswer:
                continue
        if not there:
            raise no_answer_error(self._name, addresses)
        return next((address for address, answer in there.items() if answer in PARTS), next(iter(there)))

    @contextmanager
    def _told(self, address: int) -> Iterator[None]:
        try:
            yield
        except self._adapter.missing as error:
            raise no_answer_error(self._name, (address,)) from error
        except Exception as error:  # libusb, hidapi and both libraries have their own
            raise BusError(
                f"a transfer over the USB adapter {self._name} failed ({error})",
                "check its cable and the chip's wires, and that SDA and SCL have pull-ups",
            ) from error


def adapters() -> list[tuple[str, str]]:
    """The USB adapters that are plugged in: what --bus takes, and what it is; of installed libraries alone."""
    found: list[tuple[str, str]] = []
    if find_spec("pyftdi"):
        found += _ftdi_there()
    if find_spec("EasyMCP2221"):
        found += _mcp2221_there()
    return found


def _mcp2221_there() -> list[tuple[str, str]]:
    try:
        import hid  # noqa: PLC0415 - EasyMCP2221's

        devices: list[dict[str, Any]] = hid.enumerate(MCP2221_VENDOR, MCP2221_PRODUCT)
    except Exception:  # there is no hidapi, or no permission to look
        return []
    several = len(devices) > 1
    return [
        (f"mcp2221:{each['serial_number'] or _serial(i)}" if several else "mcp2221", str(each["product_string"]))
        for i, each in enumerate(devices)
    ]


def _serial(place: int) -> str:
    """The serial in the flash of an MCP2221 that does not enumerate with it, as they leave the factory."""
    import EasyMCP2221  # noqa: PLC0415 - an extra

    try:
        device = EasyMCP2221.Device(devnum=place)
    except Exception:  # another program has it
        return "SERIAL"
    device.__del__()
    return str(device.usbserial)


def _ftdi_there() -> list[tuple[str, str]]:
    from pyftdi.ftdi import Ftdi as Device  # noqa: PLC0415 - an extra

    try:
        devices = Device.list_devices("ftdi:///?")
    except Exception:  # there is no libusb, or no permission to look
        return []
    names = {number: name for name, number in Device.PRODUCT_IDS[Device.FTDI_VENDOR].items()}
    return [
        (
            f"ftdi://ftdi:{names.get(each.pid, hex(each.pid))}:{each.sn or f'{each.bus:x}:{each.address:x}'}/1",
            each.description,
        )
        for each, _interfaces in devices
    ]
