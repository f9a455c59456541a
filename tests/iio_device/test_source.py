"""Files of IIO devices: a tree like sysfs with a buffer, and its faults."""

import errno
import os
import struct
import time
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.chip.access import Transaction
from mpucal.chip.config import Config
from mpucal.chip.decode import decode
from mpucal.errors import BusError, ChipError, MpucalError, NoAnswer, UsageError
from mpucal.iio.decode import IioDecoder
from mpucal.iio.driver import Devices, IioDriver
from mpucal.iio_device import source
from mpucal.iio_device.source import IioFiles, file_error
from mpucal.session.events import Prompt, PromptKind
from mpucal.simulated.chip import open_simulated
from mpucal.simulated.iio import SimulatedFiles
from mpucal.sources import host_bus
from mpucal.sources.opening import open_source

BOTH = Devices("iio:device0", "iio:device0")
SETTINGS = Config(rate_hz=50)
CHANNELS = [f"in_{kind}_{axis}" for kind in ("accel", "anglvel") for axis in "xyz"]


@pytest.fixture
def tree(tmp_path, monkeypatch):
    """Makes the attributes of a device as inv_mpu6050 has them, with a FIFO as its buffer."""
    device, dev = tmp_path / "sys" / "iio:device0", tmp_path / "dev"
    dev.mkdir()
    texts = {"name": "mpu6050", "sampling_frequency": "50", "sampling_frequency_available": "10 20 50 100 200 500"}
    texts |= {"in_accel_scale": "0.000598", "in_accel_scale_available": "0.000598 0.001196 0.002392 0.004785"}
    texts |= {"in_anglvel_scale": "0.001064724", "in_anglvel_scale_available": "0.000133090 0.000266181 0.000532362"}
    texts |= {f"{channel}_raw": str(100 + i) for i, channel in enumerate(CHANNELS)}
    for i, channel in enumerate([*CHANNELS, "in_timestamp"]):
        texts[f"scan_elements/{channel}_type"] = "le:s64/64>>0" if i == 6 else "be:s16/16>>0"
        texts |= {f"scan_elements/{channel}_index": str(i), f"scan_elements/{channel}_en": "0"}
    texts |= {
        "buffer/enable": "0",
        "buffer/length": "2",
        "trigger/current_trigger": "",
        "current_timestamp_clock": "realtime",
    }
    for name, text in texts.items():
        (device / name).parent.mkdir(parents=True, exist_ok=True)
        (device / name).write_text(f"{text}\n")
    trigger = tmp_path / "sys" / "trigger0"
    trigger.mkdir()
    (trigger / "name").write_text("mpu6050-dev0\n")
    os.mkfifo(dev / "iio:device0")
    monkeypatch.setattr(source, "SYSFS", tmp_path / "sys")
    monkeypatch.setattr(source, "DEVICES", dev)
    return device


def frames(*counts, every_ns=20_000_000):
    first = time.monotonic_ns()
    return b"".join(
        struct.pack(">6h4x", *row) + struct.pack("<q", first + i * every_ns) for i, row in enumerate(counts)
    )


def test_the_device_is_set_up_read_and_restored(tree):
    before = {path: path.read_text() for path in tree.rglob("*") if path.is_file()}
    files = IioFiles()
    files.check("iio:device0")
    driver = IioDriver(files, BOTH, SETTINGS)
    writer = os.open(source.DEVICES / "iio:device0", os.O_RDWR | os.O_NONBLOCK)
    sensor = driver.start()
    held = {name: (tree / name).read_text() for name in ("buffer/enable", "trigger/current_trigger", "buffer/length")}
    assert held == {"buffer/enable": "1", "trigger/current_trigger": "mpu6050-dev0", "buffer/length": "100"}
    assert (tree / "current_timestamp_clock").read_text() == "monotonic"
    assert (sensor.chip, sensor.accel_range_g, sensor.gyro_range_dps) == ("MPU-6050", 4.0, 500.0)
    os.write(writer, frames((1, 2, 8192, -4, 5, 6), (1, 2, 32767, -4, 5, 6), (1, 2, 32767, -4, 5, 7)))
    samples = driver.poll()
    driver.stop()
    files.close()
    os.close(writer)
    # by the data sheet; the driver prints 0.001196 and 0.000266181
    np.testing.assert_allclose(samples.acc[0], np.array([1, 2, 8192]) * 9.80665 / 8192)
    np.testing.assert_allclose(samples.gyr[0], np.radians(np.array([-4, 5, 6]) / 65.5))
    np.testing.assert_allclose(np.diff(samples.t), 0.02)
    assert samples.acc_clipped.tolist() == [False, True, True]
    assert driver.recording().sensor == sensor.__class__(**{**vars(sensor), "rate_hz": pytest.approx(50)})
    assert {path: path.read_text().strip() for path in before} == {path: text.strip() for path, text in before.items()}


def test_a_buffer_that_stays_empty_names_the_interrupt(tree):
    driver = IioDriver(IioFiles(), BOTH, SETTINGS)
    fifo = os.open(source.DEVICES / "iio:device0", os.O_RDWR)
    driver.start()
    driver._fruitless_ns = 3_000_000_000
    with pytest.raises(ChipError, match=r"iio:device0 stays empty: it waits for interrupts.*register 0"):
        driver.poll()
    os.close(fifo)


def test_attributes_are_restored_as_the_files_are_closed(tree):
    """The kernel keeps the buffer enabled after a reader has gone, and would refuse the next reader."""
    calibbias = tree / "in_accel_x_calibbias"
    calibbias.write_text("5\n")
    before = {path: path.read_text().strip() for path in tree.rglob("*") if path.is_file()}
    files = IioFiles()
    fifo = os.open(source.DEVICES / "iio:device0", os.O_RDWR)
    IioDriver(files, BOTH, SETTINGS).start()
    files.write("iio:device0/in_accel_x_calibbias", b"7")
    assert (tree / "buffer/enable").read_text() == "1"
    files.close()
    os.close(fifo)
    assert {path: path.read_text().strip() for path in before} == before | {calibbias: "7"}


def test_attributes_are_restored_by_the_process_that_reads_the_buffer(tree, tmp_path):
    before = {path: path.read_text().strip() for path in tree.rglob("*") if path.is_file()}
    writer = os.open(source.DEVICES / "iio:device0", os.O_RDWR | os.O_NONBLOCK)
    os.write(writer, frames((1, 2, 8192, -4, 5, 6), (1, 2, 8190, -4, 5, 7)))
    opened = open_source({"iio": "iio:device0", "rate": 50.0})
    with pytest.raises(ZeroDivisionError), opened.measuring(tmp_path / "board.mcap", print, "now") as measuring:
        measuring.source.start()
        assert len(measuring.source.poll()) == 2
        assert (tree / "buffer/enable").read_text() == "1"
        raise ZeroDivisionError
    os.close(writer)
    assert {path: path.read_text().strip() for path in before} == before


def test_polled_channels_are_interpolated_to_common_times(tree):
    """Each channel grows with its own time, so that all of one kind are equal at common times."""
    accesses = []
    for name in ("name", "in_accel_scale", "in_anglvel_scale"):
        accesses.append(Transaction("read", f"iio:device0/{name}", 4096, (tree / name).read_bytes(), 0))
    for row in range(20):
        for i, channel in enumerate(CHANNELS):
            t_ns = row * 10_000_000 + i * 1_000_000
            accesses.append(Transaction("read", f"iio:device0/{channel}_raw", 4096, b"%d" % (t_ns // 100_000), t_ns))
    recording = decode(accesses, decoder_of=IioDecoder)
    assert len(recording) == 19
    np.testing.assert_allclose(np.ptp(recording.acc, axis=1), 0, atol=1e-12)
    np.testing.assert_allclose(recording.acc[:, 0] / (9.80665 / 16384), recording.t * 1e4)


def simulated(**kind):
    bus = open_simulated("sim:hand=still,seed=4")
    bus.hear(Prompt(PromptKind.LAY_FLAT, ""))
    return SimulatedFiles(bus, **kind)


def run(files, devices, seconds=4.0, said=None, **kind):
    driver = IioDriver(files, devices, Config(rate_hz=200), say=(said if said is not None else []).append, **kind)
    driver.start()
    end_ns = driver.now_ns() + round(seconds * 1e9)
    while driver.now_ns() < end_ns:
        driver.poll()
    driver.stop()
    return driver.recording()


def test_two_devices_are_one_sensor_in_the_accelerometers_frame():
    files = simulated(two_devices=True)
    files._devices["iio:device1"].texts["in_mount_matrix"] = "0, 1, 0; -1, 0, 0; 0, 0, 1"
    one, two = run(simulated(), BOTH), run(files, Devices("iio:device0", "iio:device1"))
    count = min(len(one), len(two))
    assert count > 600
    np.testing.assert_array_equal(one.acc[-count:], two.acc[-count:])
    turn = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1.0]])
    np.testing.assert_allclose(two.gyr[-count:], one.gyr[-count:] @ turn.T)


def test_a_bit_flipped_on_the_way_to_the_kernel_is_repaired(monkeypatch):
    """The last sample of a read, or the one before, arrives with a flipped bit: nobody sees it."""
    plain, frame_bytes, flipped = run(simulated(), BOTH), 24, []
    read = SimulatedFiles.read

    def spoilt(self, register, count):
        reply = read(self, register, count)
        if register != "iio:device0" or len(reply.data) < 3 * frame_bytes:
            return reply
        flipped.append(len(flipped))
        data, at = bytearray(reply.data), len(reply.data) - frame_bytes * (1 + len(flipped) % 2)
        data[at + 8] ^= 0x20
        return reply._replace(data=bytes(data))

    monkeypatch.setattr(SimulatedFiles, "read", spoilt)
    repaired = run(simulated(), BOTH)
    assert len(flipped) > 10
    assert len(plain) - len(repaired) in (0, 1)
    np.testing.assert_allclose(repaired.gyr, plain.gyr[: len(repaired)], atol=1e-9)


def test_a_buffer_that_overran_leaves_a_gap_and_a_sentence():
    files, said = simulated(), []
    driver = IioDriver(files, BOTH, Config(rate_hz=200), say=said.append)
    driver.start()
    for pause_ns in [0] * 20 + [5_000_000_000] + [0] * 20:
        files.sleep_until(files._now_ns + pause_ns)
        driver.poll()
    driver.stop()
    recording = driver.recording()
    assert recording.gap.sum() == 1
    assert np.diff(recording.t)[recording.gap[1:]] > 2
    assert "missing in 1 places: the kernel's buffer overran" in said[0]


def change(files, name, text):
    files._devices["iio:device0"].texts[name] = text


@pytest.mark.parametrize(
    ("spoil", "kind", "says"),
    [
        (lambda f: change(f, "in_accel_scale", "0"), {}, "the scale of the accelerometer of iio:device0 is 0, 0, 0"),
        (lambda f: change(f, "in_accel_scale", "9.8"), {"trigger": "none"}, "which is not plausible"),
        (lambda f: change(f, "buffer/enable", "1"), {}, "another program reads the buffer of iio:device0: stop it"),
        (
            lambda f: change(f, "trigger/current_trigger", ""),
            {},
            "no trigger for the buffer of iio:device0: use --trigger",
        ),
        (lambda f: None, {"trigger": "mine"}, r"no trigger mine: use --trigger NAME \(available: hrtimer-0\)"),
        (lambda f: f._devices.clear(), {}, "iio:device0 is gone"),
        (lambda f: change(f, "in_mount_matrix", "0,0,0;0,0,0;0,0,0"), {}, "which is not a mount matrix"),
        (lambda f: f._devices.update(simulated(two_devices=True)._devices), {}, "iio:device0 has no gyroscope: give"),
    ],
)
def test_errors_of_the_start_are_one_sentence(spoil, kind, says):
    files = simulated()
    files._devices["iio:device0"].texts.pop("in_accel_scale_available")
    spoil(files)
    with pytest.raises((BusError, ChipError), match=says):
        run(files, BOTH, **kind)


@pytest.fixture(scope="module")
def accesses():
    """Records the accesses of a driver with a buffer."""
    found, feed = [], IioDecoder.feed
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(IioDecoder, "feed", lambda self, access: (found.append(access), feed(self, access))[1])
        run(simulated(), BOTH, 0.3)
    return found


ODD_TEXTS = [b"", b"abc", b"nan", b"-1", b"0", b"1e400", b"0,0,0;0,0,0;0,0,0", b"le:s0/16>>0", b"be:s16/16>>0", b"\xff"]


@settings(max_examples=25)
@given(data=st.data())
def test_damaged_accesses_are_decoded_or_reported(accesses, data):
    damaged = list(accesses)
    for _ in range(data.draw(st.integers(1, 2))):
        i = data.draw(st.sampled_from([i for i, access in enumerate(damaged) if "/" in access.register]))
        text = data.draw(st.sampled_from([*ODD_TEXTS, None]))
        damaged[i : i + 1] = [] if text is None else [replace(damaged[i], data=text)]
    with suppress(MpucalError):
        decode(damaged, decoder_of=IioDecoder)


def test_an_attribute_that_a_driver_does_not_answer_is_left_out(monkeypatch):
    files, read = simulated(), SimulatedFiles.read

    def refuse(self, register, count):
        if register.endswith("in_accel_x_calibbias"):
            raise file_error(OSError(errno.EINVAL, "Invalid argument"), "iio:device0", "in_accel_x_calibbias")
        return read(self, register, count)

    monkeypatch.setattr(SimulatedFiles, "read", refuse)
    recording = run(files, BOTH, 1.0)
    assert len(recording) > 50
    assert recording.sensor.accel_offsets is None


def test_a_device_that_vanishes_ends_it():
    files = simulated()
    driver = IioDriver(files, BOTH, SETTINGS)
    driver.start()
    driver.poll()
    files._devices.clear()
    with pytest.raises(NoAnswer, match="iio:device0 is gone: its driver was unbound"):
        driver.poll()
    driver.stop()


def test_a_device_that_is_not_there_names_those_that_are(tree):
    with pytest.raises(BusError, match=r"there is no iio:device3: use one of iio:device0 \(mpu6050\)"):
        open_source({"iio": "3"})
    with pytest.raises(UsageError, match="is not a device: give iio:deviceN"):
        open_source({"iio": "mpu"})


def test_a_session_that_is_to_write_is_refused_where_it_may_not(tree, tmp_path, monkeypatch):
    """Try it without the folder of udev, and with an attribute that is read-only."""
    rules, bias = tmp_path / "rules.d", tree / "in_accel_y_calibbias"
    monkeypatch.setattr(source, "RULES", rules)
    open_source({"iio": "0"})
    with pytest.raises(BusError, match=rf"{rules} cannot be written, .*: run it as root \(sudo\), or leave out --to"):
        open_source({"iio": "0", "writes": True})
    rules.mkdir()
    bias.write_text("0\n")
    open_source({"iio": "0", "writes": True})
    monkeypatch.setattr(os, "access", lambda path, mode: (path, mode) != (bias, os.W_OK))
    with pytest.raises(BusError, match=rf"{bias} cannot be written"):
        open_source({"iio": "0", "writes": True})


def test_a_chip_that_the_kernel_holds_is_pointed_to_by_its_other_name(tmp_path, monkeypatch):
    monkeypatch.setattr(host_bus, "SYSFS_DEVICES", tmp_path)
    (tmp_path / "1-0068" / "iio:device2").mkdir(parents=True)
    error = OSError(errno.EBUSY, "busy")
    assert "use --iio iio:device2 instead of --bus; or" in str(host_bus.transfer_error(error, "/dev/i2c-1", 0x68))
    assert "--iio" not in str(host_bus.transfer_error(error, "/dev/i2c-1", 0x69))
