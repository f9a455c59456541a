"""The serial bridge as a program for MicroPython; see firmware_protocol.md. mpucal pastes it, and it runs from RAM.

The last line of what is pasted calls `main`. Nothing here is used on the host but by tests, which run it there too.
"""

import binascii
import math
import os
import struct
import sys
import time

NAME = b"mpucal-mpy 1\0\0\0\0"
STREAM, BLOB, LEAVE = 1, 2, 4
OK, NO_HELLO, UNKNOWN_TYPE, BAD_PAYLOAD, BAD_VERSION, NO_ANSWER, BUS_FAILED, OVERFLOW = range(8)
NO_BLOB, BAD_BLOB, BAD_OFFSET, NO_ROOM, NOT_BEGUN, STORAGE_FAILED = range(8, 14)
ADDRESSES = (0x68, 0x69)
INT_STATUS, FIFO_COUNT, FIFO_R_W = 0x3A, 0x72, 0x74
MAX_READ, MAX_WRITE, MAX_BURST, MAX_BATCH, MAX_LOOK, MAX_ENCODED, MAX_BLOB = 56, 32, 4096, 32, 73, 71, 256
BEAT_US = 100_000
# the clock of a board is narrower than the protocol's
TICKS = 2**30 - 1
# as Linux and as lwIP number ETIMEDOUT
TIMED_OUT = (110, 116)
SLOTS = ("mpucal_blob0.bin", "mpucal_blob1.bin")


def crc_table():
    """CRC-16/CCITT-FALSE of each byte."""
    for byte in range(256):
        crc = byte << 8
        for _ in range(8):
            crc = crc << 1 ^ 0x1021 * (crc >> 15)
            crc &= 0xFFFF
        yield crc


TABLE = tuple(crc_table())


def crc16(data):
    """Of `data`."""
    crc = 0xFFFF
    for byte in data:
        crc = crc << 8 & 0xFF00 ^ TABLE[crc >> 8 ^ byte]
    return crc


def framed(kind, seq, payload):
    """A message as bytes on the line."""
    content = bytes((kind, seq)) + payload
    content += struct.pack("<H", crc16(content))
    return b"".join(bytes((len(piece) + 1,)) + piece for piece in content.split(b"\0")) + b"\0"


def unframed(encoded):
    """The content without its CRC; None: it is no frame."""
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


def acceptable(blob):
    """Whether a reader may accept `blob`."""
    if len(blob) < 188 or blob[:5] != b"MPUC\1" or struct.unpack("<H", blob[6:8])[0] != len(blob):
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
    """A request that cannot be done; its argument is the status."""


class Chip:
    """The chip on one of `buses`, which MicroPython's machine.I2C are."""

    def __init__(self, buses):
        self.buses = buses
        self.i2c, self.address = None, 0

    def find(self, addresses):
        """Use what answers at one of `addresses`."""
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
        """`count` bytes from `register` on."""
        return self.moved(lambda: self.i2c.readfrom_mem(self.address, register, count))

    def write(self, register, data):
        """`data` from `register` on."""
        self.moved(lambda: self.i2c.writeto_mem(self.address, register, data))

    def moved(self, transfer):
        """What `transfer` gives."""
        if not self.address:
            raise Failed(NO_ANSWER)
        try:
            return transfer()
        except OSError as error:
            raise Failed(self.why(error))

    def why(self, error):
        """The status of a transfer that failed: boards give one that was not acknowledged different numbers."""
        if error.args[0] in TIMED_OUT:
            return BUS_FAILED
        try:
            self.i2c.readfrom(self.address, 1)
        except OSError as again:
            return BUS_FAILED if again.args[0] in TIMED_OUT else NO_ANSWER
        return BUS_FAILED


class Keeper:
    """The blob, in two files: header and blob of a slot in each."""

    def __init__(self, folder):
        self.paths = [folder + name for name in SLOTS]
        self.begun = None

    def slot(self, number):
        """Its generation and blob; None: it is not valid."""
        try:
            with open(self.paths[number], "rb") as file:
                data = file.read()
        except OSError:
            return None
        if len(data) < 8:
            return None
        generation, check = struct.unpack("<II", data[:8])
        blob = data[8:]
        return (generation, blob) if generation ^ check == 0xFFFFFFFF and acceptable(blob) else None

    def stored(self):
        """Number, generation and blob of the slot that counts; the number that is free, 0 and None where none does."""
        first, second = self.slot(0), self.slot(1)
        if first and second:
            number = 1 if (second[0] - first[0]) & 0xFFFFFFFF < 0x80000000 else 0
        else:
            number = 1 if second else 0
        found = (first, second)[number]
        return (number, found[0], found[1]) if found else (1, 0, None)

    def remove(self, number):
        """A slot, if it is there."""
        try:
            os.remove(self.paths[number])
        except OSError:
            pass

    def commit(self):
        """Store what was begun; returns its generation."""
        used, generation, _ = self.stored()
        generation = generation + 1 & 0xFFFFFFFF or 1
        blob, free, self.begun = bytes(self.begun), 1 - used, None
        try:
            with open(self.paths[free], "wb") as file:
                file.write(struct.pack("<II", generation, generation ^ 0xFFFFFFFF) + blob)
        except OSError:
            raise Failed(STORAGE_FAILED)
        if self.slot(free) != (generation, blob):
            raise Failed(STORAGE_FAILED)
        return generation


class Bridge:
    """The bridge; `ticks_us` is its clock, of 30 bits or more, asked once in nine minutes at least.

    `left` : the host has said LEAVE.
    """

    def __init__(self, buses, ticks_us, folder=""):
        self.chip, self.keeper = Chip(buses), Keeper(folder)
        self.ticks_us, self.ticks, self.now_us = ticks_us, ticks_us(), 0
        self.piece, self.inbox = bytearray(), []
        self.greeted = self.left = False
        self.frame_bytes = self.batch = self.seq = self.index = self.drops = self.status = self.pushed_us = 0
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
        """Bytes came in."""
        for byte in data:
            if byte:
                if len(self.piece) <= MAX_ENCODED:
                    self.piece.append(byte)
                continue
            content = unframed(bytes(self.piece)) if len(self.piece) <= MAX_ENCODED else None
            if content and content[0] < 0x80:
                self.inbox.append(content)
            self.piece = bytearray()

    def work(self):
        """Do what there is to do; returns what goes out."""
        out = b""
        while self.inbox:
            content = self.inbox.pop(0)
            for payload in self.answer(content[0], content[1], content[2:]):
                out += framed(content[0] | 0x80, content[1], payload)
        return out + self.look() if self.frame_bytes else out

    def clock(self):
        """What it shows, us."""
        ticks = self.ticks_us()
        self.now_us = self.now_us + (ticks - self.ticks & TICKS) & 0xFFFFFFFF
        self.ticks = ticks
        return self.now_us

    def said(self, status, tail=b""):
        """A reply's payload."""
        return [struct.pack("<BI", status, self.clock()) + tail]

    def answer(self, kind, seq, payload):
        """The payloads of the replies to a request."""
        if not self.greeted and kind != 1:
            return self.said(NO_HELLO)
        if kind not in self.requests:
            return self.said(UNKNOWN_TYPE)
        form, act = self.requests[kind]
        size = struct.calcsize(form)
        if len(payload) < size:
            return self.said(BAD_PAYLOAD)
        values = struct.unpack(form, payload[:size])
        if kind in (1, 4, 19):
            values += (payload[size:],)
        if kind == 5:
            values += (seq,)
        try:
            return act(*values)
        except Failed as error:
            return self.said(error.args[0])

    def hello(self, magic, major, _minor, rest):
        """Who is there."""
        if magic != b"MPUB" or (major == 1 and not b"" < rest[:1] < b"\x80"):
            return self.said(BAD_PAYLOAD)
        if major == 1:
            address = rest[0]
            self.greeted, self.frame_bytes, self.drops, self.keeper.begun = True, 0, 0, None
            self.chip.find((address,) if address else ADDRESSES)
        here = struct.pack("<BBBBBH", 1, 0, self.chip.address, STREAM | BLOB | LEAVE, 2, MAX_BLOB)
        return self.said(OK if major == 1 else BAD_VERSION, b"MPUB" + here + NAME)

    def leave(self):
        """End the program."""
        self.left, self.frame_bytes = True, 0
        return self.said(OK)

    def read(self, register, count):
        """Registers."""
        if not 1 <= count <= MAX_READ:
            raise Failed(BAD_PAYLOAD)
        began = struct.pack("<BI", OK, self.clock())
        return [began + self.chip.read(register, count)]

    def burst(self, register, count):
        """One register, often."""
        if not 1 <= count <= MAX_BURST:
            raise Failed(BAD_PAYLOAD)
        made = []
        for at in range(0, count, MAX_READ):
            began = struct.pack("<BIH", OK, self.clock(), at)
            try:
                made.append(began + self.chip.read(register, min(MAX_READ, count - at)))
            except Failed as error:
                return made + self.said(error.args[0])
        return made

    def write(self, register, data):
        """Registers."""
        if not 1 <= len(data) <= MAX_WRITE:
            raise Failed(BAD_PAYLOAD)
        began = struct.pack("<BI", OK, self.clock())
        self.chip.write(register, data)
        return [began]

    def stream(self, frame_bytes, batch, seq):
        """Push what the FIFO collects."""
        if frame_bytes > MAX_READ or (frame_bytes and not 1 <= batch <= MAX_BATCH):
            raise Failed(BAD_PAYLOAD)
        self.frame_bytes, self.batch, self.seq = frame_bytes, batch, seq
        self.index = self.status = 0
        self.pushed_us = self.clock()
        return self.said(OK)

    def look(self):
        """What there is to push."""
        now = self.clock()
        late = (now - self.pushed_us & 0xFFFFFFFF) >= BEAT_US
        if self.status:
            made = [self.frames(now)] if late else []
        else:
            try:
                made = self.looked(now, late)
            except Failed as error:
                made = [self.stand(error.args[0], now)]
        if made:
            self.pushed_us = now
        return b"".join(made)

    def looked(self, now, late):
        """One look at a FIFO that runs."""
        size = self.frame_bytes
        left = struct.unpack(">H", self.chip.read(FIFO_COUNT, 2))[0] // size
        if left > MAX_LOOK:
            return [self.stand(OVERFLOW, now)]
        if left < self.batch and not late:
            return []
        made = []
        while True:
            part = min(left, MAX_READ // size)
            data = self.chip.read(FIFO_R_W, part * size) if part else b""
            left -= part
            if not left:
                break
            made.append(self.frames(now, data, left))
        if self.chip.read(INT_STATUS, 1)[0] & 0x10:
            return made + [self.stand(OVERFLOW, now)]
        return made + [self.frames(now, data)]

    def stand(self, status, now):
        """Something was lost."""
        self.drops = self.drops + 1 & 0xFFFF
        self.status = status
        return self.frames(now)

    def frames(self, now, data=b"", left=0):
        """One message of a look."""
        payload = struct.pack("<BIHHB", self.status, now, self.index, self.drops, left) + data
        self.index = self.index + len(data) // self.frame_bytes & 0xFFFF
        return framed(0xC0, self.seq, payload)

    def blob_state(self):
        """Which is stored."""
        _, generation, blob = self.keeper.stored()
        if blob is None:
            return self.said(NO_BLOB, bytes(10))
        return self.said(OK, struct.pack("<IH", generation, len(blob)) + blob[-4:])

    def blob_read(self, offset, count):
        """Some of it."""
        if not 1 <= count <= MAX_READ:
            raise Failed(BAD_PAYLOAD)
        blob = self.keeper.stored()[2]
        if blob is None:
            raise Failed(NO_BLOB)
        if offset + count > len(blob):
            raise Failed(BAD_OFFSET)
        return self.said(OK, blob[offset : offset + count])

    def blob_begin(self, length):
        """Another comes."""
        if length > MAX_BLOB:
            raise Failed(NO_ROOM)
        self.frame_bytes, self.length = 0, length
        self.keeper.remove(1 - self.keeper.stored()[0])
        self.keeper.begun = bytearray()
        return self.said(OK)

    def blob_data(self, offset, data):
        """Some of it."""
        if not 1 <= len(data) <= MAX_WRITE:
            raise Failed(BAD_PAYLOAD)
        begun = self.keeper.begun
        if begun is None:
            raise Failed(NOT_BEGUN)
        if offset > len(begun) or offset + len(data) > self.length:
            raise Failed(BAD_OFFSET)
        self.keeper.begun = begun[:offset] + data + begun[offset + len(data) :]
        return self.said(OK)

    def blob_commit(self, length, crc):
        """Store it."""
        _, generation, blob = self.keeper.stored()
        begun = self.keeper.begun
        if begun is None:
            if blob is None or (len(blob), blob[-4:]) != (length, struct.pack("<I", crc)):
                raise Failed(NOT_BEGUN)
        elif len(begun) != self.length or length != self.length:
            raise Failed(BAD_OFFSET)
        elif not acceptable(bytes(begun)) or begun[-4:] != struct.pack("<I", crc):
            raise Failed(BAD_BLOB)
        else:
            generation = self.keeper.commit()
        return self.said(OK, struct.pack("<I", generation))

    def blob_erase(self):
        """Store none."""
        used = self.keeper.stored()[0]
        self.keeper.begun = None
        self.keeper.remove(1 - used)
        self.keeper.remove(used)
        return self.said(OK if self.keeper.stored()[2] is None else STORAGE_FAILED)


def buses(machine, pins):
    """The I2C buses at `pins`, (SDA, SCL), or at the board's own; where its hardware has none there, made of pins."""
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
    # a frame holds any byte, Ctrl-C too
    micropython.kbd_intr(-1)
    try:
        # an empty frame: the bridge runs
        sys.stdout.buffer.write(b"\0")
        while not bridge.left:
            while waiting.poll(0):
                bridge.receive(sys.stdin.buffer.read(1))
            out = bridge.work()
            if out:
                sys.stdout.buffer.write(out)
    finally:
        micropython.kbd_intr(3)
