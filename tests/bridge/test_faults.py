"""Faults of the line: the session continues after a marked gap, or ends with its reason."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.bridge.bus import BridgeBus
from mpucal.bridge.link import Link
from mpucal.bridge.port import Chunk
from mpucal.bridge.sink import BridgeSink
from mpucal.bridge.store import BlobStore
from mpucal.chip import registers as reg
from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.errors import BusError, NoAnswer, WriteBackError
from mpucal.result.blob import Blob
from mpucal.result.calibration import Calibration
from mpucal.simulated.chip.bus import FastClock
from mpucal.simulated.faults import Where, fault_kinds
from tools.lab.bridge import EmulatedLine, Memory
from tools.lab.bridge.line import LineFaults
from tools.lab.feeds import numbers

MS = 1_000_000

faults = st.lists(
    st.tuples(st.integers(0, 4000), st.sampled_from(list(fault_kinds(Where.SERIAL))), st.integers(1, 255)),
    max_size=8,
)


def is_consistent(recording):
    """Return True if missing samples are at marked gaps, and none is there twice."""
    steps = np.diff(numbers(recording))
    return bool(((steps == 1) | (recording.gap[1:] & (steps > 1))).all())


def spoil(line, to_host, to_device, shorter):
    """Apply faults to the bytes in both directions, at positions divided by `shorter`."""
    directions = zip((to_host, to_device), shorter, strict=True)
    line.to_host, line.to_device = (LineFaults([(n // by, *rest) for n, *rest in of]) for of, by in directions)


@settings(max_examples=8)
@given(to_host=faults, to_device=faults, rate_hz=st.sampled_from([200, 1000]))
def test_samples_after_spoiled_bytes_are_true_and_gaps_are_marked(rig, stream, to_host, to_device, rate_hz):
    made = rig()
    driver = Driver(made.bus(), Config(rate_hz=rate_hz))
    spoil(made.line, to_host, to_device, shorter=(1, 16))
    driver.start()
    while made.line.to_host.number < 4000:
        driver.poll()
    made.line.to_host = made.line.to_device = bytes
    stream(driver, 1.0)
    recording = driver.recording()
    assert is_consistent(recording)
    assert recording.t[-1] > driver.now_ns() * 1e-9 - 0.2
    assert len(recording) > 0.5 * rate_hz


@settings(max_examples=4)
@given(after_ms=st.integers(0, 900), boot_ms=st.sampled_from([0, 300, 2000]), rate_hz=st.sampled_from([200, 1000]))
def test_a_reset_of_the_bridge_is_one_gap(started, stream, after_ms, boot_ms, rate_hz):
    """The bridge's clock restarts; the chip continues."""
    made, driver = started(rate_hz=rate_hz)
    stream(driver, 0.2 + after_ms * 1e-3)
    ahead_ns = driver.now_ns() - made.clock.now()
    made.line.device = made.new_bridge(boot_ms * MS)
    stream(driver, boot_ms * 1e-3 + 1.5)
    recording = driver.recording()
    assert recording.gap.sum() == 1
    assert (np.diff(recording.t) > 0).all()
    assert np.diff(recording.t)[recording.gap[1:]][0] < 1.5 + boot_ms * 1e-3
    # the chip's time includes the restart of the bridge
    assert driver.now_ns() - made.clock.now() == pytest.approx(ahead_ns, abs=50 * MS)
    assert recording.t[-1] == pytest.approx(driver.now_ns() * 1e-9, abs=0.1)


def test_a_busy_program_reads_late_what_came_in_time(started, stream):
    made, driver = started()
    stream(driver, 0.5)
    bus, wait = made.opened, made.opened.link.wait

    def busy(_until_ns):
        """Take a reply that is no part of the stream, and be busy for two seconds."""
        heard_ns, bus.link.wait = made.line.now_ns(), wait
        for _ in range(2000):
            made.line._step()
        return heard_ns

    bus.link.wait = busy
    while bus.link.wait is busy:
        count = int.from_bytes(bus.read(reg.FIFO_COUNT_H, 2).data, "big")
        bus.read(reg.FIFO_R_W, count)
    assert count > 0
    assert not driver.recording().gap.any()


@pytest.mark.parametrize("chip_loses_its_supply", [False, True])
def test_a_bridge_that_is_plugged_in_again_is_one_gap(started, stream, chip_loses_its_supply):
    made, driver = started()
    stream(driver, 0.5)
    made.line.unplugged = True
    made.line.device = made.new_bridge()
    if chip_loses_its_supply:
        made.new_chip()
        made.line.device = made.new_bridge()
    back_at = made.clock.now() + 3000 * MS
    plugged = made.line._step

    def step():
        plugged()
        made.line.unplugged = made.clock.now() < back_at

    made.line._step = step
    stream(driver, 6)
    recording = driver.recording()
    assert recording.gap.sum() == 1
    assert float(np.diff(recording.t)[recording.gap[1:]][0]) > 2.9
    assert len(recording) > 350


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (
            lambda made: setattr(made.line, "device", made.new_bridge()),
            "lost on the link to the board.*the sensor.s wires are not",
        ),
        (lambda made: failing(made.chip, made.clock), "not acknowledged.*shorten the wires"),
    ],
    ids=["link", "sensor"],
)
def test_the_remark_names_the_link_or_the_sensor(started, stream, spoil, words):
    remarks = []
    made, driver = started(say=remarks.append)
    stream(driver, 0.5)
    spoil(made)
    stream(driver, 2)
    driver.stop()
    assert re.search(words, remarks[-1])


def failing(chip, clock):
    """Make the chip fail for a moment."""
    read, ends_ns = chip.read, clock.now() + 300 * MS

    def refused(*words):
        if clock.now() < ends_ns:
            raise NoAnswer("nothing acknowledges", "look")
        return read(*words)

    chip.read = refused


@pytest.mark.parametrize(
    ("attribute", "value", "sentence"),
    [
        ("unplugged", True, "the emulated line is gone: check its cable, plug it in again"),
        ("to_host", lambda data: b"", "the bridge on the emulated line no longer answers: check its cable"),
    ],
    ids=["unplugged", "silent"],
)
def test_a_bridge_that_is_gone_for_good(started, stream, attribute, value, sentence):
    made, driver = started()
    stream(driver, 0.5)
    setattr(made.line, attribute, value)
    with pytest.raises(BusError, match=f"^{sentence}"):
        stream(driver, 5)
    assert len(driver.recording()) > 80


class Chatty:
    """Device that prints and does not listen."""

    def __init__(self, clock, text):
        self.clock, self.text, self.next_ns = clock, text, 0

    def receive(self, data):
        pass

    def work(self):
        if self.clock.now() < self.next_ns:
            return b""
        self.next_ns = self.clock.now() + 100 * MS
        return self.text


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (b"", "nothing answers on the emulated line: check that the board there runs the bridge's firmware"),
        (b"$GPGGA,123519,4807.038,N\r\n", "is not a bridge: it sends '.GPGGA,123519,4807.038,N': put the bridge's"),
        (b"ypr\t0.1\t2.0\r\n", r"is not a bridge: it sends 'ypr\\t0.1\\t2.0'"),
        (
            bytes(range(0x80, 0xF0)),
            "the emulated line sends bytes, but not those of a bridge at 500000 baud: give",
        ),
        (b"\0\0\0\0", "sends bytes, but"),
    ],
    ids=["silent", "GPS", "sketch", "wrong baud", "break"],
)
def test_a_device_that_is_no_bridge_is_named(text, sentence):
    clock = FastClock()
    line = EmulatedLine(Chatty(clock, text), clock)
    began = clock.now()
    with pytest.raises(BusError, match=sentence) as caught:
        BridgeBus(line)
    assert str(caught.value).count("\n") == 0
    assert 5e9 <= clock.now() - began < 6e9


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (b"raw REPL; CTRL-B to exit\r\n>", "MicroPython answers on the emulated line, not a bridge: add --micropython"),
        (b"Adafruit CircuitPython 10.0.3 on 2025-10-17\r\n>>> ", "CircuitPython answers on the emulated line"),
    ],
    ids=["MicroPython", "CircuitPython"],
)
def test_a_repl_is_recognised(text, sentence):
    clock = FastClock()
    with pytest.raises(BusError, match=sentence):
        BridgeBus(EmulatedLine(Chatty(clock, text), clock))


class Flooding:
    """Line that sends endless zeros after `sound_reads` reads."""

    def __init__(self, line, sound_reads):
        self.line, self.left, self.ahead_ns = line, sound_reads, 0

    def __getattr__(self, name):
        return getattr(self.line, name)

    def now_ns(self):
        return self.line.now_ns() + self.ahead_ns

    def read(self, until_ns):
        self.left -= 1
        if self.left >= 0:
            return self.line.read(until_ns)
        self.ahead_ns += 100_000
        return Chunk(bytes(4096), self.now_ns())


@pytest.mark.parametrize("sound_reads", [0, 40])
def test_a_flood_is_named(rig, stream, sound_reads):
    with pytest.raises(BusError, match=r"^the emulated line is flooded: far more bytes come than a bridge sends"):
        driver = Driver(BridgeBus(Flooding(rig().line, sound_reads)), Config(rate_hz=200))
        driver.start()
        stream(driver, 60)


@settings(max_examples=50)
@given(noise=st.binary(max_size=2000))
def test_noise_before_the_hello_does_no_harm(rig, noise):
    made = rig()
    rest = [noise]
    made.line.to_host = lambda data: (rest.pop() if rest else b"") + data
    made.line.device.receive(noise)
    assert made.bus().address == 0x68


class Shaky(Memory):
    """Memory whose supply fails after some bytes of a slot."""

    def __init__(self, slots, left):
        self.slots, self.left, self.begun = slots, left, None

    def keep(self, number, data):
        super().keep(number, data[: self.left])
        if self.left < len(data):
            raise PowerFailure


class PowerFailure(Exception):  # noqa: N818
    pass


class Mortal:
    """Bridge that is silent after its supply has failed."""

    def __init__(self, bridge):
        self.bridge = bridge

    def receive(self, data):
        if self.bridge is not None:
            self.bridge.receive(data)

    def work(self):
        try:
            return self.bridge.work() if self.bridge is not None else b""
        except PowerFailure:
            self.bridge = None
            return b""


def blob(x):
    D = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    return Blob(0x68, 4.0, 500.0, D, (x, 0.0, 0.0), 9.81, 25.0, "", (0.0,) * 3, D, (0.0,) * 3).encode()


def store_on(line):
    link = Link(line)
    link.greet()
    return BlobStore(link)


class Reset(Mortal):
    """Bridge that restarts with its memory after its supply has failed."""

    def __init__(self, bridge, anew):
        super().__init__(bridge)
        self.anew = anew

    def work(self):
        out = super().work()
        self.bridge = self.bridge or self.anew()
        return out


@settings(max_examples=25)
@given(held_before=st.booleans(), bytes_left=st.integers(0, 230), to_host=faults, to_device=faults)
def test_the_sink_reports_the_stored_calibration_truly(rig, held_before, bytes_left, to_host, to_device):
    """The supply fails at any byte, and bytes on the line are spoiled."""
    made, memory = rig(), Memory()
    calibration = Calibration(np.diag([1.01, 0.98, 1.03]), np.array([0.2, 0.1, -0.3]), quality={"verdict": "good"})
    old, new = blob(1.0) if held_before else None, calibration.blob().encode()
    made.line.device = made.new_bridge(memory=memory)
    if old is not None:
        store_on(made.line).write(old)
    shaky = made.new_bridge(memory=Shaky(memory.slots, bytes_left))
    made.line.device = Reset(shaky, lambda: made.new_bridge(memory=memory))
    sink = BridgeSink(store_on(made.line))
    spoil(made.line, to_host, to_device, shorter=(16, 10))
    try:
        sink.write(calibration)
    except WriteBackError as error:
        assert error.exit_code == 6
        unsure = "either the old calibration or the new one" in error.what
        possible = (old, new) if unsure else (old,)
    else:
        possible = (new,)
    made.line.to_host = made.line.to_device = bytes
    made.line.device = made.new_bridge(memory=memory)
    stored = store_on(made.line).read()
    assert (stored and stored.data) in possible
