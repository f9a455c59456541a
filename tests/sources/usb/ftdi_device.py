"""An FT232H as pyusb's backend, with a chip on its pins: its MPSSE commands of I2C (FTDI AN_108), and nothing else.

pyftdi takes `get_backend` of the module that UsbTools.BACKENDS names.
"""

from types import SimpleNamespace

from usb.backend import IBackend

SCL, SDA = 1, 2
# how long each command is that has no data
COMMANDS = {0x80: 3, 0x82: 3, 0x86: 3, 0x9E: 3, 0x22: 2, 0x26: 2, 0x20: 3, 0x24: 3, 0x13: 3, 0x12: 3}
WRITE_BYTES, READ_BYTES, READ_BITS, BAD = (0x10, 0x11), (0x20, 0x24), (0x22, 0x26), 0xFA
SINGLE = (0x84, 0x85, 0x87, 0x8A, 0x8B, 0x8C, 0x8D, 0x96, 0x97)


class I2cSlave:
    """Chip at 0x68 that takes bytes between start and stop, its register first."""

    def __init__(self, chip):
        self.chip, self.selected, self.heard, self.reading = chip, False, bytearray(), False
        self.answers = iter(b"")

    def start(self):
        self._done()
        self.address_next = True

    def stop(self):
        self._done()
        self.selected = False

    def byte(self, value):
        """Take a byte of the master; return True to acknowledge it."""
        if self.address_next:
            self.address_next = False
            self.selected, self.reading = value >> 1 == 0x68, bool(value & 1)
            return self.selected
        self.heard.append(value)
        return self.selected

    def _done(self):
        if self.selected and not self.reading and len(self.heard) > 1:
            self.chip.write(self.heard[0], bytes(self.heard[1:]))
        if self.selected and not self.reading and self.heard:
            self.register = self.heard[0]
        self.heard.clear()

    def give(self, count):
        data = self.chip.read(self.register, count).data
        self.register += count * (self.register != 0x74)
        return data


class Backend(IBackend):
    """FT232H, a new one for each user."""

    def __init__(self, chip):
        self.slave, self.out, self.pins, self.acknowledged = I2cSlave(chip), bytearray(), SCL | SDA, True

    def enumerate_devices(self):
        yield SimpleNamespace()

    def get_device_descriptor(self, _dev):
        return SimpleNamespace(
            bLength=18, bDescriptorType=1, bcdUSB=0x200, bDeviceClass=0, bDeviceSubClass=0, bDeviceProtocol=0,
            bMaxPacketSize0=64, idVendor=0x0403, idProduct=0x6014, bcdDevice=0x900, iManufacturer=1, iProduct=2,
            iSerialNumber=3, bNumConfigurations=1, address=2, bus=1, port_number=1, port_numbers=(1,), speed=3,
        )  # fmt: skip

    def get_configuration_descriptor(self, _dev, config):
        if config:
            raise IndexError(config)
        return SimpleNamespace(
            bLength=9, bDescriptorType=2, wTotalLength=32, bNumInterfaces=1, bConfigurationValue=1, iConfiguration=0,
            bmAttributes=0x80, bMaxPower=45, extra_descriptors=[],
        )  # fmt: skip

    def get_interface_descriptor(self, _dev, intf, alt, _config):
        if intf or alt:
            raise IndexError(intf)
        return SimpleNamespace(
            bLength=9, bDescriptorType=4, bInterfaceNumber=0, bAlternateSetting=0, bNumEndpoints=2,
            bInterfaceClass=255, bInterfaceSubClass=255, bInterfaceProtocol=255, iInterface=0, extra_descriptors=[],
        )  # fmt: skip

    def get_endpoint_descriptor(self, _dev, ep, _intf, _alt, _config):
        return SimpleNamespace(
            bLength=7, bDescriptorType=5, bEndpointAddress=(0x02, 0x81)[ep], bmAttributes=2, wMaxPacketSize=512,
            bInterval=0, bRefresh=0, bSynchAddress=0, extra_descriptors=[],
        )  # fmt: skip

    def open_device(self, dev):
        return SimpleNamespace(handle=dev)

    def get_configuration(self, _handle):
        return 1

    def ignored(self, *_):
        return 0

    close_device = set_configuration = claim_interface = release_interface = detach_kernel_driver = ignored
    attach_kernel_driver = set_interface_altsetting = reset_device = is_kernel_driver_active = ignored

    def ctrl_transfer(self, _handle, kind, request, value, _index, data, _timeout):
        if (kind, request) == (0x80, 6):
            text = "FT232H".encode("utf-16-le")
            answer = b"\x04\x03\x09\x04" if value & 0xFF == 0 else bytes([2 + len(text), 3]) + text
            data[: len(answer)] = type(data)("B", answer)
            return len(answer)
        return len(data)

    def bulk_write(self, _handle, _ep, _intf, data, _timeout):
        rest = bytes(data)
        while rest:
            rest = rest[self._command(rest) :]
        return len(data)

    def bulk_read(self, _handle, _ep, _intf, buffer, _timeout):
        part = bytes(self.out[: len(buffer) - 2])
        del self.out[: len(part)]
        answer = b"\x32\x60" + part
        buffer[: len(answer)] = type(buffer)("B", answer)
        return len(answer)

    def _command(self, data):
        code = data[0]
        if code in WRITE_BYTES:
            count = int.from_bytes(data[1:3], "little") + 1
            for value in data[3 : 3 + count]:
                self.acknowledged = self.slave.byte(value)
            return 3 + count
        if code in SINGLE:
            return 1
        if code not in COMMANDS:
            self.out += bytes([BAD, code])
            return 1
        if code == 0x80:
            self._set_pins(data[1])
        elif code in READ_BITS:
            self.out.append(0 if self.acknowledged else 1)
        elif code in READ_BYTES:
            self.out += self.slave.give(int.from_bytes(data[1:3], "little") + 1)
        return COMMANDS[code]

    def _set_pins(self, pins):
        if pins & self.pins & SCL and (pins ^ self.pins) & SDA:
            (self.slave.stop if pins & SDA else self.slave.start)()
        self.pins = pins
