"""Serial bridge for MicroPython; see firmware_protocol.md. mpucal pastes this program, which runs from RAM.

The last line that is pasted calls `main`, and the values of what is imported from mpucal stand in place of the imports
(`micropython.py: minify`). On the host only tests run it.
"""

import binascii
import math
import os
import struct
import sys
import time

from ..chip.registers import ADDRESSES, FIFO_COUNT_H, FIFO_R_W, INT_FIFO_OFLOW, INT_STATUS
from ..result.blob import MAX_LENGTH
from .frame import MAX_ENCODED
from .messages import MAGIC, MAX_BATCH, MAX_BURST, MAX_LOOK, MAX_READ, MAX_WRITE, REPLY_BIT, Feature, Status

NAME = b"mpucal-mpy 1\0\0\0\0"
BEAT_US = 100_000
# A board's clock has fewer bits than the protocol's.
TICKS = 2**30 - 1
# ETIMEDOUT of Linux and of lwIP.
TIMED_OUT = (110, 116)
SLOTS = ("mpucal_blob0.bin", "mpucal_blob1.bin")


def crc_table():
    """Yield the CRC-16/CCITT-FALSE of each byte."""
    for byte in range(256):
        crc = byte << 8
        for _ in range(8):
            crc = crc << 1 ^ 0x1021 * (crc >> 15)
            crc &= 0xFFFF
        yield crc


TABLE = tuple(crc_table())


def crc16(data):
    """Return the CRC-16 of `data`."""
    crc = 0xFFFF
    for byte in data:
        crc = crc << 8 & 0xFF00 ^ TABLE[crc >> 8 ^ byte]
    return crc


def framed(kind, seq, payload):
    """Encode a message to the bytes on the line."""
    content = bytes((kind, seq)) + payload
    content += struct.pack("<H", crc16(content))
    return b"".join(bytes((len(piece) + 1,)) + piece for piece in content.split(b"\0")) + b"\0"


def unframed(encoded):
    """Decode a frame to its content without the CRC; None if it is not a frame."""
    pieces, at = [], 0
    while at < len(encoded):
        end = at + encoded[at]
        if end > len(encoded):
            return None
        pieces.append(encoded[at + 1 : end])
        at = end
    content = b"\0".join(pieces)
    if len(content) < 4 or crc16(content[:-2]) != content[-2] | content[-1] << 8:
        return None
    return content[:-2]


def is_valid(blob):
    """Return True if `blob` is valid for a reader."""
    if not 188 <= len(blob) <= MAX_LENGTH or blob[:5] != b"MPUC\1" or struct.unpack("<H", blob[6:8])[0] != len(blob):
        return False
    if binascii.crc32(blob[:-4]) != struct.unpack("<I", blob[-4:])[0]:
        return False
    numbers = struct.unpack("<12f", blob[60:108]) + struct.unpack("<3f", blob[124:136])
    if not all(math.isfinite(number) for number in numbers):
        return False
    a, b, c, d, e, f, g, h, i = numbers[:9]
    most = max(abs(number) for number in numbers[:9])
    determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    if not 1e-3 <= most <= 1e3 or not abs(determinant) > 1e-6 * most * most * most:
        return False
    counts = struct.unpack("<f", blob[204:208])[0] if len(blob) >= 212 else 1.0
    return all(math.isfinite(n) and n >= 0 for n in struct.unpack("<2f", blob[52:60])) and 0 < counts < math.inf


class Failed(Exception):
    """Error of a request that cannot be done; its argument is the status."""


def check_size(count, most):
    """Refuse a request of no bytes, or of more than `most`."""
    if not 1 <= count <= most:
        raise Failed(Status.BAD_PAYLOAD)


class Chip:
    """Chip on one of `buses`, which are machine.I2C of MicroPython."""

    def __init__(self, buses):
        self.buses = buses
        self.i2c, self.address = None, 0

    def find(self, addresses):
        """Find the chip: the first of `addresses` that answers on a bus."""
        self.i2c, self.address = None, 0
        for i2c in self.buses:
            for address in addresses:
                try:
                    i2c.readfrom(address, 1)
                except OSError:
                    continue
                self.i2c, self.address = i2c, address
                return

    def read(self, register, count):
        """Read `count` bytes from `register` on."""
        return self.transfer(lambda: self.i2c.readfrom_mem(self.address, register, count))

    def write(self, register, data):
        """Write `data` from `register` on."""
        self.transfer(lambda: self.i2c.writeto_mem(self.address, register, data))

    def transfer(self, access):
        """Make an access, and convert its error to a status."""
        if not self.address:
            raise Failed(Status.NO_ANSWER)
        try:
            return access()
        except OSError as error:
            raise Failed(self.status_of(error))

    def status_of(self, error):
        """Return the status of a failed transfer: a missing acknowledge has another number on each board."""
        if error.args[0] in TIMED_OUT:
            return Status.BUS_FAILED
        try:
            self.i2c.readfrom(self.address, 1)
        except OSError as again:
            return Status.BUS_FAILED if again.args[0] in TIMED_OUT else Status.NO_ANSWER
        return Status.BUS_FAILED


class BlobFiles:
    """Two files for the blob: each is a slot with a header and a blob."""

    def __init__(self, folder):
        self.paths = [folder + name for name in SLOTS]
        self.begun = None

    def load(self, number):
        """Read a slot's bytes; none if there is no file."""
        try:
            with open(self.paths[number], "rb") as file:
                return file.read()
        except OSError:
            return b""

    def keep(self, number, data):
        """Write a slot's bytes."""
        with open(self.paths[number], "wb") as file:
            file.write(data)

    def slot(self, number):
        """Return a slot's generation and blob; None if it is not valid."""
        data = self.load(number)
        if len(data) < 8:
            return None
        generation, check = struct.unpack("<II", data[:8])
        blob = data[8:]
        return (generation, blob) if generation ^ check == 0xFFFFFFFF and is_valid(blob) else None

    def stored(self):
        """Return number, generation and blob of the valid slot; 1, 0 and None without one."""
        first, second = self.slot(0), self.slot(1)
        # Generations wrap.
        if second and (not first or (second[0] - first[0]) & 0xFFFFFFFF < 0x80000000):
            return (1,) + second
        return (0,) + first if first else (1, 0, None)

    def remove(self, number):
        """Remove a slot if it is there."""
        try:
            os.remove(self.paths[number])
        except OSError:
            pass

    def commit(self):
        """Store the received blob, and return its generation."""
        used, generation, _ = self.stored()
        generation = generation + 1 & 0xFFFFFFFF or 1
        blob, free, self.begun = bytes(self.begun), 1 - used, None
        try:
            self.keep(free, struct.pack("<II", generation, generation ^ 0xFFFFFFFF) + blob)
        except OSError:
            raise Failed(Status.STORAGE_FAILED)
        if self.slot(free) != (generation, blob):
            raise Failed(Status.STORAGE_FAILED)
        return generation


class Bridge:
    """Bridge; `ticks_us` is its clock of 30 bits or more, which must be read once in nine minutes.

    `left` : True after the host has sent LEAVE. `features`, `window`, `name` : what HELLO_REPLY says of it.
    """

    features, window, name = Feature.STREAM | Feature.BLOB | Feature.LEAVE, 2, NAME

    def __init__(self, buses, ticks_us, folder=""):
        self.chip, self.files = Chip(buses), BlobFiles(folder)
        self.ticks_us, self.ticks, self.now_us = ticks_us, ticks_us(), 0
        self.piece, self.inbox = bytearray(), []
        self.greeted = self.left = False
        self.frame_bytes = self.batch = self.seq = self.index = self.drops = self.status = 0
        self.pushed_us = self.began_us = 0
        self.requests = {
            1: ("<4sBB", self.hello),
            2: ("<BB", self.read),
            3: ("<BH", self.burst),
            4: ("<B", self.write),
            5: ("<BB", self.stream),
            6: ("<", self.leave),
            16: ("<", self.blob_state),
            17: ("<HB", self.blob_read),
            18: ("<H", self.blob_begin),
            19: ("<H", self.blob_data),
            20: ("<HI", self.blob_commit),
            21: ("<", self.blob_erase),
        }

    def receive(self, data):
        """Take received bytes."""
        for byte in data:
            if byte:
                if len(self.piece) <= MAX_ENCODED:
                    self.piece.append(byte)
                continue
            content = unframed(bytes(self.piece)) if len(self.piece) <= MAX_ENCODED else None
            if content and content[0] < REPLY_BIT:
                self.inbox.append(content)
            self.piece = bytearray()

    def work(self):
        """Answer the requests and read the FIFO; return the bytes to send."""
        out = b""
        while self.inbox:
            content = self.inbox.pop(0)
            for payload in self.answer(content[0], content[1], content[2:]):
                out += framed(content[0] | REPLY_BIT, content[1], payload)
        return out + self.push() if self.frame_bytes else out

    def clock(self):
        """Return the time, us."""
        ticks = self.ticks_us()
        self.now_us = self.now_us + (ticks - self.ticks & TICKS) & 0xFFFFFFFF
        self.ticks = ticks
        return self.now_us

    def reply(self, status, tail=b""):
        """Make the payload of a reply, as a list of one; its time is the beginning of the transfer or the request."""
        return [struct.pack("<BI", status, self.began_us) + tail]

    def answer(self, kind, seq, payload):
        """Carry out a request, and return the payloads of its replies."""
        self.began_us = self.clock()
        if not self.greeted and kind != 1:
            return self.reply(Status.NO_HELLO)
        if kind not in self.requests:
            return self.reply(Status.UNKNOWN_TYPE)
        form, act = self.requests[kind]
        size = struct.calcsize(form)
        if len(payload) < size:
            return self.reply(Status.BAD_PAYLOAD)
        values = struct.unpack(form, payload[:size])
        if kind in (1, 4, 19):
            values += (payload[size:],)
        if kind == 5:
            values += (seq,)
        try:
            return act(*values)
        except Failed as error:
            return self.reply(error.args[0])

    def hello(self, magic, major, _minor, rest):
        """Answer HELLO with the bridge's description."""
        if magic != MAGIC or (major == 1 and not b"" < rest[:1] < b"\x80"):
            return self.reply(Status.BAD_PAYLOAD)
        if major == 1:
            address = rest[0]
            self.greeted, self.frame_bytes, self.drops, self.files.begun = True, 0, 0, None
            self.chip.find((address,) if address else ADDRESSES)
        here = struct.pack("<BBBBBH", 1, 0, self.chip.address, self.features, self.window, MAX_LENGTH)
        return self.reply(Status.OK if major == 1 else Status.BAD_VERSION, MAGIC + here + self.name)

    def leave(self):
        """Note that the program is to end."""
        self.left, self.frame_bytes = True, 0
        return self.reply(Status.OK)

    def read(self, register, count):
        """Read registers."""
        check_size(count, MAX_READ)
        return self.reply(Status.OK, self.chip.read(register, count))

    def burst(self, register, count):
        """Read a register that does not auto-increment, in several replies."""
        check_size(count, MAX_BURST)
        made = []
        for at in range(0, count, MAX_READ):
            self.began_us = self.clock()
            try:
                data = self.chip.read(register, min(MAX_READ, count - at))
                made += self.reply(Status.OK, struct.pack("<H", at) + data)
            except Failed as error:
                return made + self.reply(error.args[0])
        return made

    def write(self, register, data):
        """Write registers."""
        check_size(len(data), MAX_WRITE)
        self.chip.write(register, data)
        return self.reply(Status.OK)

    def stream(self, frame_bytes, batch, seq):
        """Start or stop pushing the FIFO's content."""
        if frame_bytes > MAX_READ or (frame_bytes and not 1 <= batch <= MAX_BATCH):
            raise Failed(Status.BAD_PAYLOAD)
        self.frame_bytes, self.batch, self.seq = frame_bytes, batch, seq
        self.index = self.status = 0
        self.pushed_us = self.began_us
        return self.reply(Status.OK)

    def push(self):
        """Return the frames to push, if any are due."""
        now = self.clock()
        late = (now - self.pushed_us & 0xFFFFFFFF) >= BEAT_US
        made = []
        if not self.status:
            try:
                self.drain(made, now, late)
            except Failed as error:
                made.append(self.halt(error.args[0], now))
        elif late:
            made.append(self.frames(now))
        if made:
            self.pushed_us = now
        return b"".join(made)

    def drain(self, made, now, late):
        """Read a running FIFO if it has enough frames, or the last message is old; append the messages to `made`."""
        size = self.frame_bytes
        left = struct.unpack(">H", self.chip.read(FIFO_COUNT_H, 2))[0] // size
        if left > MAX_LOOK:
            raise Failed(Status.OVERFLOW)
        if left < self.batch and not late:
            return
        while True:
            part = min(left, MAX_READ // size)
            data = self.chip.read(FIFO_R_W, part * size) if part else b""
            left -= part
            if not left:
                break
            made.append(self.frames(now, data, left))
        if self.chip.read(INT_STATUS, 1)[0] & INT_FIFO_OFLOW:
            raise Failed(Status.OVERFLOW)
        made.append(self.frames(now, data))

    def halt(self, status, now):
        """Count a loss, and report why the stream halted."""
        self.drops = self.drops + 1 & 0xFFFF
        self.status = status
        return self.frames(now)

    def frames(self, now, data=b"", left=0):
        """Make a FRAMES message of a look."""
        payload = struct.pack("<BIHHB", self.status, now, self.index, self.drops, left) + data
        self.index = self.index + len(data) // self.frame_bytes & 0xFFFF
        return framed(0xC0, self.seq, payload)

    def blob_state(self):
        """Describe the stored blob."""
        _, generation, blob = self.files.stored()
        if blob is None:
            return self.reply(Status.NO_BLOB, bytes(10))
        return self.reply(Status.OK, struct.pack("<IH", generation, len(blob)) + blob[-4:])

    def blob_read(self, offset, count):
        """Read a part of the stored blob."""
        check_size(count, MAX_READ)
        blob = self.files.stored()[2]
        if blob is None:
            raise Failed(Status.NO_BLOB)
        if offset + count > len(blob):
            raise Failed(Status.BAD_OFFSET)
        return self.reply(Status.OK, blob[offset : offset + count])

    def blob_begin(self, length):
        """Prepare for a blob of `length` bytes."""
        if length > MAX_LENGTH:
            raise Failed(Status.NO_ROOM)
        self.frame_bytes, self.length = 0, length
        self.files.remove(1 - self.files.stored()[0])
        self.files.begun = bytearray()
        return self.reply(Status.OK)

    def blob_data(self, offset, data):
        """Receive a part of the blob."""
        check_size(len(data), MAX_WRITE)
        begun = self.files.begun
        if begun is None:
            raise Failed(Status.NOT_BEGUN)
        if offset > len(begun) or offset + len(data) > self.length:
            raise Failed(Status.BAD_OFFSET)
        self.files.begun = begun[:offset] + data + begun[offset + len(data) :]
        return self.reply(Status.OK)

    def blob_commit(self, length, crc):
        """Check and store the received blob."""
        _, generation, blob = self.files.stored()
        begun = self.files.begun
        if begun is None:
            if blob is None or (len(blob), blob[-4:]) != (length, struct.pack("<I", crc)):
                raise Failed(Status.NOT_BEGUN)
        elif len(begun) != self.length or length != self.length:
            raise Failed(Status.BAD_OFFSET)
        elif not is_valid(bytes(begun)) or begun[-4:] != struct.pack("<I", crc):
            raise Failed(Status.BAD_BLOB)
        else:
            generation = self.files.commit()
        return self.reply(Status.OK, struct.pack("<I", generation))

    def blob_erase(self):
        """Erase the stored blob."""
        used = self.files.stored()[0]
        self.files.begun = None
        self.files.remove(1 - used)
        self.files.remove(used)
        return self.reply(Status.OK if self.files.stored()[2] is None else Status.STORAGE_FAILED)


def buses(machine, pins):
    """Open the I2C buses at `pins` (SDA, SCL), or the board's own; a software bus if the hardware has none there."""
    how = {"freq": 400_000, "timeout": 25_000}
    if pins:
        how["sda"], how["scl"] = (machine.Pin(pin) for pin in pins)
    found = []
    for number in range(3):
        try:
            found.append(machine.I2C(number, **how))
        except (ValueError, TypeError, OSError):
            continue
    if pins and not found:
        found.append(machine.SoftI2C(**how))
    return found


def main(pins):
    """Serve the host on the port of the REPL until it says LEAVE."""
    import select

    import machine
    import micropython

    waiting = select.poll()
    waiting.register(sys.stdin, select.POLLIN)
    bridge = Bridge(buses(machine, pins), time.ticks_us)
    # A frame may hold the byte of Ctrl-C.
    micropython.kbd_intr(-1)
    try:
        # An empty frame shows that the bridge runs.
        sys.stdout.buffer.write(b"\0")
        while not bridge.left:
            while waiting.poll(0):
                bridge.receive(sys.stdin.buffer.read(1))
            out = bridge.work()
            if out:
                sys.stdout.buffer.write(out)
    finally:
        micropython.kbd_intr(3)
