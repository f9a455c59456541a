"""Chip on a USB adapter without a driver of the kernel: an FT232H by pyftdi, an MCP2221 by EasyMCP2221.

Both write the register and read after a repeated start, as the chip requires; the time of a transfer is the host's,
just before it. CH341 and CP2112 have a driver of the Linux kernel, and are /dev/i2c-N there.
"""

from __future__ import annotations

import logging
from abc import abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from ..chip.registers import WHO_AM_I
from ..errors import BusError
from .chip import OpenedChip
from .host_bus import RegisterBus, find_chip, no_answer_error
from .kind import Request

I2C_HZ = 400_000
# Command buffer of an MPSSE engine; shorter transfers are not faster, by the adapter's latency.
MAX_READ_BYTES = 1024


class UsbBus(RegisterBus):
    """Chip at one address of a USB adapter.

    Parameters
    ----------
    name : of the adapter. address : of the chip; None tries 0x68, then 0x69.

    Raises
    ------
    BusError : no library, no such adapter, no permission, or in use by another program. NoAnswer : nothing
    acknowledges.
    """

    # Exception that the library raises if nothing acknowledges.
    missing: type[Exception]

    def __init__(self, name: str, address: int | None = None) -> None:
        super().__init__()
        self._name = name
        try:
            self.connect(name)
        except ModuleNotFoundError as error:
            raise BusError(f"the Python library {error.name} is not installed", "pip install mpucal[usb]") from error
        except Exception as error:  # libusb, hidapi and both libraries have their own
            raise BusError(
                f"the USB adapter {name} cannot be opened ({error})",
                "plug it in, end other programs that use it, and see docs/boards.md for permissions and drivers",
            ) from error
        try:
            self.address = find_chip(name, address, lambda each: self._exchange(each, WHO_AM_I, 1)[0])
        except BaseException:
            self.close()
            raise

    @abstractmethod
    def connect(self, name: str) -> None:
        """Open the adapter."""

    @abstractmethod
    def exchange(self, address: int, register: int, count: int) -> bytes:
        """Write the register's address, then read `count` bytes after a repeated start."""

    @abstractmethod
    def put(self, address: int, out: bytes) -> None:
        """Write `out`."""

    @abstractmethod
    def close(self) -> None:
        """Close the adapter."""

    def write(self, register: int, data: bytes) -> int:
        """Write `data` from `register` on, and return the time just before the transfer."""
        t_ns = self.now_ns()
        with self._converting_errors(self.address):
            self.put(self.address, bytes([register]) + data)
        return t_ns

    def _read_part(self, register: int, count: int) -> bytes:
        return self._exchange(self.address, register, min(count, MAX_READ_BYTES))

    def _exchange(self, address: int, register: int, count: int) -> bytes:
        with self._converting_errors(address):
            return self.exchange(address, register, count)

    @contextmanager
    def _converting_errors(self, address: int) -> Iterator[None]:
        try:
            yield
        except self.missing as error:
            raise no_answer_error(self._name, (address,)) from error
        except Exception as error:  # libusb, hidapi and both libraries have their own
            raise BusError(
                f"a transfer over the USB adapter {self._name} failed ({error})",
                "check its cable and the chip's wires, and that SDA and SCL have pull-ups",
            ) from error


class Ftdi(UsbBus):
    """FT232H, FT2232H or FT4232H, by a URL of pyftdi, such as ftdi://ftdi:232h/1."""

    def connect(self, name: str) -> None:
        """See UsbBus."""
        from pyftdi.i2c import I2cController, I2cNackError  # noqa: PLC0415 - an extra

        # By default it logs each address that is not acknowledged.
        logging.getLogger("pyftdi.i2c").setLevel(logging.ERROR)
        self.missing = I2cNackError
        self._controller = I2cController()
        self._controller.configure(name, frequency=I2C_HZ)

    def exchange(self, address: int, register: int, count: int) -> bytes:
        """See UsbBus."""
        return bytes(self._controller.exchange(address, bytes([register]), count))

    def put(self, address: int, out: bytes) -> None:
        """See UsbBus."""
        self._controller.write(address, out)

    def close(self) -> None:
        """See UsbBus."""
        self._controller.close()


class Mcp2221(UsbBus):
    """MCP2221(A) by its name: mcp2221, or mcp2221:SERIAL if there are several."""

    def connect(self, name: str) -> None:
        """See UsbBus."""
        import EasyMCP2221  # noqa: PLC0415 - an extra
        from EasyMCP2221.exceptions import NotAckError  # noqa: PLC0415 - the same

        self.missing = NotAckError
        self._device = EasyMCP2221.Device(usbserial=name.partition(":")[2] or None, scan_serial=True)
        self._device.I2C_speed(I2C_HZ)

    def exchange(self, address: int, register: int, count: int) -> bytes:
        """See UsbBus."""
        self._device.I2C_write(address, bytes([register]), kind="nonstop")
        return bytes(self._device.I2C_read(address, count, kind="restart"))

    def put(self, address: int, out: bytes) -> None:
        """See UsbBus."""
        self._device.I2C_write(address, out)

    def close(self) -> None:
        """Close the device, which EasyMCP2221 would keep open for its next user."""
        self._device.__del__()


def open_source(request: Request) -> OpenedChip:
    """Open the chip on the adapter that --bus ftdi://... or mcp2221[:SERIAL] names."""
    adapter = Ftdi if request.kind.word == "ftdi" else Mcp2221
    return OpenedChip(adapter(request.value, request.values.get("address")), request.plan, words=request.words)


def adapters() -> list[tuple[str, str]]:
    """List the connected USB adapters of the installed libraries: (value of --bus, description)."""
    found: list[tuple[str, str]] = []
    for adapters_of in (_ftdi_adapters, _mcp2221_adapters):
        # A library or a permission may be missing.
        with suppress(Exception):
            found += adapters_of()
    return found


def _mcp2221_adapters() -> list[tuple[str, str]]:
    from EasyMCP2221.MCP2221 import DEV_DEFAULT_PID, DEV_DEFAULT_VID, hid  # noqa: PLC0415 - an extra

    devices: list[dict[str, Any]] = hid.enumerate(DEV_DEFAULT_VID, DEV_DEFAULT_PID)
    several = len(devices) > 1
    # With the factory's settings they do not report their serial numbers over USB.
    return [
        (f"mcp2221:{each['serial_number'] or 'SERIAL'}" if several else "mcp2221", str(each["product_string"]))
        for each in devices
    ]


def _ftdi_adapters() -> list[tuple[str, str]]:
    from pyftdi.ftdi import Ftdi as Device  # noqa: PLC0415 - an extra
    from pyftdi.usbtools import UsbTools  # noqa: PLC0415 - the same

    # The chip is on the first interface of each.
    devices = [(device, 1) for device, _interfaces in Device.list_devices()]
    named = UsbTools.build_dev_strings("ftdi", Device.VENDOR_IDS, Device.PRODUCT_IDS, devices)
    return [(url, what.strip("()")) for url, what in named]
