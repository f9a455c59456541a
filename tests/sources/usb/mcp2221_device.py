"""An MCP2221 as the module `hid`: reports of 64 bytes (Microchip DS20005565), and a chip on its I2C bus."""

from EasyMCP2221 import Constants as c  # noqa: N813 - so many of them

SPEED_TAKEN, NACK = 0x20, c.I2C_ST_WRADDRL_NACK_STOP


class Hid:
    """The module; `chip` is at 0x68 of each adapter, whose flash holds a serial that it does or does not enumerate."""

    def __init__(self, chip, serials=("0001",), enumerated=True):
        self.adapters = {str(i).encode(): serial for i, serial in enumerate(serials, 1)}
        self.enumerated, self.opened = enumerated, b""
        self.chip, self.state, self.pending, self.register = chip, c.I2C_ST_IDLE, b"", 0

    def enumerate(self, vendor=0, product=0):
        here = (vendor, product) in ((0, 0), (c.DEV_DEFAULT_VID, c.DEV_DEFAULT_PID))
        each = {"product_string": "MCP2221", "interface_number": 2}
        each |= {"vendor_id": c.DEV_DEFAULT_VID, "product_id": c.DEV_DEFAULT_PID}
        found = [(path, serial if self.enumerated else "") for path, serial in self.adapters.items()]
        return [each | {"path": path, "serial_number": serial} for path, serial in found] if here else []

    def device(self):
        return self

    def open_path(self, path):
        if path not in self.adapters:
            raise OSError("open failed")
        self.opened = path

    def close(self):
        pass

    def write(self, report):
        assert len(report) == 1 + c.PACKET_SIZE
        self.answer = bytearray(c.PACKET_SIZE)
        self.answer[0] = report[1]
        self.answer[c.I2C_POLL_RESP_UNDOCUMENTED_21] = 1
        self._command(report[1], bytes(report[1:]))
        return len(report)

    def read(self, size, _timeout=-1):
        return list(self.answer[:size])

    def _command(self, code, report):
        length, address = int.from_bytes(report[1:3], "little"), report[3]
        if code == c.CMD_POLL_STATUS_SET_PARAMETERS:
            if report[3] == c.I2C_CMD_SET_BUS_SPEED:
                self.answer[c.I2C_POLL_RESP_NEWSPEED_STATUS] = SPEED_TAKEN
            if report[2] == c.I2C_CMD_CANCEL_CURRENT_TRANSFER:
                self.state = c.I2C_ST_IDLE
            self.answer[c.I2C_POLL_RESP_STATUS] = self.state
            self.answer[c.I2C_POLL_RESP_SCL] = self.answer[c.I2C_POLL_RESP_SDA] = 1
        elif code in (c.CMD_I2C_WRITE_DATA, c.CMD_I2C_WRITE_DATA_NO_STOP):
            self._write(code, address, report[4 : 4 + length])
        elif code == c.CMD_I2C_READ_DATA_REPEATED_START:
            self.pending = self.chip.read(self.register, length).data
        elif code == c.CMD_I2C_READ_DATA_GET_I2C_DATA:
            part, self.pending = self.pending[:60], self.pending[60:]
            self.state = c.I2C_ST_READDATA_WAIT if self.pending else c.I2C_ST_READDATA_WAITGET
            self.answer[2:4] = bytes([self.state, len(part)])
            self.answer[4 : 4 + len(part)] = part
            if not self.pending:
                self.state = c.I2C_ST_IDLE
        elif code == c.CMD_READ_FLASH_DATA:
            text = self.adapters[self.opened].encode("utf-16-le") if report[1] == c.FLASH_DATA_USB_SERIALNUM else b""
            self.answer[2 : 4 + len(text)] = bytes([2 + len(text), 3]) + text

    def _write(self, code, address, data):
        if address >> 1 != 0x68:
            self.state = NACK
            return
        self.register = data[0]
        if len(data) > 1:
            self.chip.write(data[0], data[1:])
        ends = code == c.CMD_I2C_WRITE_DATA
        self.state = c.I2C_ST_IDLE if ends else c.I2C_ST_WRITEDATA_END_NOSTOP
