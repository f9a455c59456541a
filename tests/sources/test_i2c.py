"""Linux I2C bus with the real smbus2, whose ioctls a simulated chip answers."""

import errno
import os
import subprocess
import sys

import pytest
from smbus2 import smbus2

import mpucal.sources.host_bus
from mpucal.chip import registers as reg
from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.errors import BusError, BusHeld, NoAnswer
from mpucal.sources.host_bus import lock_device, no_answer_error
from mpucal.sources.i2c import I2cBus, found_chips


def measured(bus, config=None, seconds=3):
    driver = Driver(bus, config)
    driver.start()
    while driver.now_ns() < seconds * 1e9:
        driver.poll()
    driver.stop()
    bus.close()
    return driver.recording()


def test_registers_are_read_in_one_burst(adapter):
    kernel = adapter()
    bus = I2cBus(str(kernel.path))
    assert bus.read(reg.WHO_AM_I, 1).data == b"\x68"
    bus.write(reg.SMPLRT_DIV, b"\x04\x03")
    assert bus.read(reg.SMPLRT_DIV, 3).data == b"\x04\x03\x00"
    # The first transfer looked for the chip.
    assert kernel.transfers[1:] == [[(0, 1), (1, 1)], [(0, 3)], [(0, 1), (1, 3)]]


@pytest.mark.parametrize("address", [0x68, 0x69])
def test_the_chips_that_answer_are_found_without_a_write(adapter, address):
    kernel = adapter(address=address)
    (kernel.path.parent / "i2c-2").symlink_to("nowhere")
    assert list(found_chips(kernel.path.parent)) == [
        (str(kernel.path), f"MPU-6050 at {address:#x}"),
        (str(kernel.path.with_name("i2c-2")), "an I2C bus, not permitted to you so far"),
    ]
    assert smbus2.I2C_RDWR not in kernel.requests


@pytest.mark.parametrize(("number", "asked"), [(errno.EREMOTEIO, 2), (errno.ETIMEDOUT, 1)], ids=["silent", "held"])
def test_no_chip_is_found_on_a_silent_bus_and_a_held_one_is_left_at_once(adapter, number, asked):
    kernel = adapter()
    kernel.failures[smbus2.I2C_SMBUS] = number
    assert list(found_chips(kernel.path.parent)) == []
    assert kernel.requests.count(smbus2.I2C_SMBUS) == asked


@pytest.mark.parametrize(
    ("address", "asked", "message"),
    [(0x69, 0x68, "nothing answers at 0x68 on"), (0x50, None, r"at 0x68 or 0x69 on .*i2c-1: .*i2cdetect -y 1")],
    ids=["another address", "any address"],
)
def test_no_chip_at_the_tried_addresses(adapter, address, asked, message):
    kernel = adapter(address=address)
    with pytest.raises(NoAnswer, match=message):
        I2cBus(str(kernel.path), asked)


@pytest.mark.parametrize("repeats_start", [True, False])
def test_a_kernel_driver_is_noticed_by_a_plain_read_first(adapter, repeats_start):
    kernel = adapter()
    kernel.repeats_start = repeats_start
    kernel.failures[smbus2.I2C_SLAVE] = errno.EBUSY
    with pytest.raises(
        BusError, match=r"a driver of the kernel holds the chip .*: remove .*echo 1-0068 .*/1-0068/driver/unbind"
    ):
        I2cBus(str(kernel.path), 0x68)
    assert smbus2.I2C_RDWR not in kernel.requests


@pytest.mark.parametrize(
    ("number", "kind", "words"),
    [
        (errno.EREMOTEIO, NoAnswer, "nothing answers at 0x68"),
        (errno.ENXIO, NoAnswer, "nothing answers at 0x68"),
        (errno.ETIMEDOUT, BusHeld, "does not become free .*holds SDA or SCL low"),
        (errno.EIO, BusError, "broke off .*shorten the wires"),
        (errno.EAGAIN, BusError, "another master"),
        (errno.EBUSY, BusError, "driver of the kernel"),
        (errno.ENODEV, BusError, "adapter is gone"),
        (errno.EFAULT, BusError, "a transfer failed .Bad address"),
    ],
    ids=lambda value: errno.errorcode.get(value) if isinstance(value, int) else None,
)
def test_a_failed_transfer_is_a_sentence_and_not_repeated(adapter, number, kind, words):
    kernel = adapter()
    bus = I2cBus(str(kernel.path))
    kernel.failures[smbus2.I2C_RDWR] = number
    for access in (lambda: bus.read(reg.FIFO_R_W, 4), lambda: bus.write(reg.USER_CTRL, b"\0")):
        kernel.requests.clear()
        with pytest.raises(BusError, match=words) as caught:
            access()
        assert type(caught.value) is kind
        assert kernel.requests == [smbus2.I2C_RDWR]


def test_no_such_bus_names_those_there_are(tmp_path, monkeypatch):
    monkeypatch.setattr(mpucal.sources.host_bus, "DEVICES", tmp_path)
    with pytest.raises(BusError, match=r"there is no I2C bus .*i2c-7: enable I2C"):
        I2cBus(str(tmp_path / "i2c-7"))
    (tmp_path / "i2c-1").touch()
    with pytest.raises(BusError, match=r"there is no I2C bus .*i2c-7: use one of .*i2c-1"):
        I2cBus(str(tmp_path / "i2c-7"))


def test_another_file_is_no_bus_and_is_closed_again(tmp_path):
    """The kernel reports ENOTTY."""
    other = tmp_path / "notes.txt"
    other.write_text("no bus")
    handles = len(os.listdir("/proc/self/fd"))  # noqa: PTH208
    for path in (other, tmp_path):
        with pytest.raises(BusError, match="is not an I2C bus"):
            I2cBus(str(path))
    assert len(os.listdir("/proc/self/fd")) == handles  # noqa: PTH208


def test_an_smbus_adapter_moves_blocks_of_32_bytes(adapter):
    kernel = adapter()
    kernel.functions = int(smbus2.I2cFunc.SMBUS_BYTE_DATA | smbus2.I2cFunc.SMBUS_I2C_BLOCK)
    recording = measured(I2cBus(str(kernel.path)), Config(rate_hz=100))
    assert len(recording) > 200
    assert not recording.gap.any()
    assert smbus2.I2C_RDWR not in kernel.requests
    assert max(length for transfer in kernel.transfers for _, length in transfer) == 32


def test_a_block_that_is_not_acknowledged_after_another_is_no_transfer_that_took_nothing(adapter, monkeypatch):
    kernel = adapter()
    kernel.functions = int(smbus2.I2cFunc.SMBUS_BYTE_DATA | smbus2.I2cFunc.SMBUS_I2C_BLOCK)
    bus = I2cBus(str(kernel.path))
    whole = bus._read_part

    def fails_after_one(register, count):
        if count < 40:
            raise no_answer_error("/dev/i2c-1", (0x68,))
        return whole(register, count)

    monkeypatch.setattr(bus, "_read_part", fails_after_one)
    with pytest.raises(BusError) as caught:
        bus.read(reg.FIFO_R_W, 64)
    assert not isinstance(caught.value, NoAnswer)


@pytest.mark.parametrize("limits", [{"longest": 70}, {"repeats_start": False}], ids=str)
def test_an_adapter_with_limits_loses_nothing(adapter, limits):
    """The kernel refuses longer messages, or a write and a read in one (i2c-core quirks)."""
    kernel = adapter()
    vars(kernel).update(limits)
    recording = measured(I2cBus(str(kernel.path)))
    assert recording.sensor.who_am_i == 0x68
    assert not recording.gap.any()
    assert len(recording) > 400
    # still in bursts of frames
    assert max(length for transfer in kernel.transfers for _, length in transfer) >= 3 * reg.FRAME_BYTES


def test_a_known_part_is_preferred_to_a_clock_at_the_other_address(adapter, monkeypatch):
    kernel = adapter(address=0x69)
    monkeypatch.setattr(kernel, "is_there", lambda address: address in (0x68, 0x69))
    read = kernel.bus.read

    def both(register, count):
        reply = read(register, count)
        return reply._replace(data=b"\x13") if kernel._chosen == 0x68 else reply

    monkeypatch.setattr(kernel.bus, "read", both)
    assert I2cBus(str(kernel.path)).address == 0x69
    assert I2cBus(str(kernel.path), 0x68).address == 0x68


def test_a_chip_that_another_process_uses_is_not_shared(tmp_path):
    device = tmp_path / "i2c-1"
    device.touch()
    holder = (
        "import sys; from mpucal.sources.host_bus import lock_device; file = open(sys.argv[1], 'r+b');"
        " lock_device(file.fileno(), '', address=0x68); print(flush=True); input()"
    )
    command = [sys.executable, "-c", holder, device]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other, device.open("r+b") as file:
        other.stdout.readline()
        lock_device(file.fileno(), "the other chip", address=0x69)
        with pytest.raises(BusError, match="another mpucal uses the chip: end it"):
            lock_device(file.fileno(), "the chip", address=0x68)
        other.communicate(b"\n")
        lock_device(file.fileno(), "the chip", address=0x68)
