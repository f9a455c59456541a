"""The .tlog format: written, read, damaged, read by others, and made into recordings."""

import gc
import struct
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mpucal
from mpucal.__main__ import run
from mpucal.data import Samples
from mpucal.errors import CaptureError, RecordingError
from mpucal.files.mcap import CaptureWriter, read_capture
from mpucal.files.messages import PACKETS
from mpucal.files.tlog import tlog_of
from mpucal.mavlink.log import Log, read_log
from mpucal.mavlink.tlog import RawPacket, TlogFile, encode_tlog

START_NS = 1_700_000_000_000_000_000


@pytest.fixture
def made(tmp_path):
    """made(packets) writes a .tlog of (time [s], packet)."""

    def make(packets):
        path = tmp_path / "made.tlog"
        path.write_bytes(encode_tlog(RawPacket(START_NS + round(t_s * 1e9), data) for t_s, data in packets))
        return path

    return make


def turned(vehicle, begin=0, end=200, at_us=0):
    """Packets of RAW_IMU at 100 Hz, numbered from `begin`, whose clock is ahead by `at_us`."""
    return [(0.01 * k, vehicle.raw(at_us + 10_000 * k)) for k in range(begin, end)]


@pytest.fixture
def written(station, made):
    """A .tlog of two seconds, and its records."""
    vehicle = station()
    packets = [(0.0, vehicle.heartbeat()), *turned(vehicle, 1)]
    return made(packets), [RawPacket(START_NS + round(t_s * 1e9), data) for t_s, data in packets]


def test_a_log_is_read_as_it_was_written(written):
    path, records = written
    tlog = TlogFile(path)
    assert list(tlog) == records
    assert tlog.recovered is None


@pytest.fixture
def captured(written, tmp_path):
    """A capture of these packets."""
    path = tmp_path / "capture.mcap"
    with CaptureWriter(path) as writer:
        writer.start({}, PACKETS)
        for packet in written[1]:
            writer.packet(*packet)
    return path


def test_a_capture_of_the_same_packets_exports_to_the_same_log(written, captured):
    out = captured.with_name("out.tlog")
    assert run(["export", str(captured), "--to", "tlog", "-o", str(out)]) == 0
    assert out.read_bytes() == written[0].read_bytes()
    of_log, of_capture = mpucal.load(written[0]), mpucal.load(captured)
    for name in Samples.__dataclass_fields__:
        assert np.array_equal(getattr(of_log, name), getattr(of_capture, name), equal_nan=True)


def test_a_capture_of_a_chip_exports_to_no_log(tmp_path):
    with CaptureWriter(tmp_path / "capture.mcap") as writer:
        writer.start({})
    with pytest.raises(RecordingError, match="holds no packets of a vehicle"):
        tlog_of(tmp_path)


@pytest.mark.parametrize("share", [0.3, 0.9])
def test_a_damaged_capture_gives_the_packets_before_the_damage(written, captured, share):
    data = bytearray(captured.read_bytes())
    data[int(share * len(data))] ^= 0xFF
    captured.write_bytes(data)
    try:
        read = read_capture(captured)
    except CaptureError:
        assert share < 0.5
    else:
        assert list(read.records) == written[1][: len(read.records)]
        assert read.recovered or len(read.records) == len(written[1])


def test_a_message_that_is_no_packet_is_refused(captured):
    with CaptureWriter(path := captured.with_name("other.mcap")) as writer:
        writer.start({}, PACKETS)
        writer.packet(5, b"no packet")
    with pytest.raises(CaptureError, match=r"invalid message on /mavlink \(9 bytes are no packet\)"):
        read_capture(path)


def test_packets_are_on_the_disk_before_a_capture_is_closed(written, tmp_path):
    writer = CaptureWriter(tmp_path / "capture.mcap")
    writer.start({}, PACKETS)
    for packet in written[1]:
        writer.packet(*packet)
    read = read_capture(tmp_path / "capture.mcap")
    assert "was never closed" in read.recovered
    assert list(read.records) == written[1][: len(read.records)]
    assert written[1][-1].t_ns - read.records[-1].t_ns < 1e9
    writer.close()


def test_pymavlink_reads_it(written, monkeypatch):
    path, records = written
    monkeypatch.setenv("MAVLINK20", "1")
    mavutil = pytest.importorskip("pymavlink.mavutil")
    mavutil.set_dialect("ardupilotmega")
    mavlogfile = mavutil.mavlogfile(str(path), robust_parsing=True)
    try:
        read = []
        while (message := mavlogfile.recv_msg()) is not None:
            read.append((message.get_type(), round(message._timestamp * 1e6)))
    finally:
        mavlogfile.close()
    assert read == [("HEARTBEAT" if k == 0 else "RAW_IMU", record.t_ns // 1000) for k, record in enumerate(records)]


@settings(max_examples=50)
@given(cut=st.integers(1, 400), junk=st.binary(max_size=100))
def test_a_damaged_log_gives_its_whole_packets(written, cut, junk):
    path, records = written
    whole = b"".join((record.t_ns // 1000).to_bytes(8, "big") + record.data for record in records)
    path.write_bytes(whole[:-cut] + junk)
    tlog = TlogFile(path)
    read = list(tlog)
    least = next(
        k for k in range(len(records), -1, -1) if sum(8 + len(r.data) for r in records[:k]) <= len(whole) - cut
    )
    assert read[:least] == records[:least]
    if len(whole) - cut + len(junk) != sum(8 + len(r.data) for r in read):
        assert "are no packets" in tlog.recovered


def test_no_packets_at_all(tmp_path):
    (tmp_path / "x.tlog").write_bytes(b"hello, this is no log of packets")
    with pytest.raises(CaptureError, match="holds no MAVLink packet"):
        list(TlogFile(tmp_path / "x.tlog"))


def test_a_reboot_splits_a_log_and_the_longest_part_is_taken(station, made):
    vehicle = station()
    before, after = turned(vehicle, 0, 100, 50_000_000), turned(vehicle, 100, 400, 1_000_000)
    recording = mpucal.load(made([(0.0, vehicle.heartbeat()), *before, *after]))
    assert len(recording) == 300
    assert recording.t[0] == pytest.approx(2.0)


def test_a_parameter_that_changes_splits_a_log(station, made):
    vehicle = station()

    def offset(value):
        return vehicle.message("param_value", b"INS_ACCOFFS_X", value, 9, 1, 0)

    head = [(0.0, vehicle.heartbeat()), (0.0, offset(0.25))]
    packets = [*head, *turned(vehicle, 0, 300), (3.0, offset(0.5)), *turned(vehicle, 300, 400)]
    recording = mpucal.load(made(packets))
    assert len(recording) == 300
    assert recording.autopilot.parameters["INS_ACCOFFS_X"] == 0.25


@pytest.mark.parametrize(("name", "kept"), [("INS_POS1_X", True), ("a\x1b[2J", False), ("", False), ("Ä", False)])
def test_a_name_that_no_firmware_uses_is_ignored(name, kept):
    log = Log("ArduPilot")
    log.add_parameter(name, 1.0)
    assert (name in log.segments[-1].parameters) == kept


def test_more_parameters_than_any_firmware_has_are_not_kept():
    log = Log("ArduPilot")
    for number in range(10_000):
        log.add_parameter(f"P{number}", 1.0)
    log.add_parameter("P1", 2.0)
    assert len(log.segments[-1].parameters) < 10_000
    assert log.segments[-1].parameters["P1"] == 2.0


def test_several_vehicles_are_listed_and_one_can_be_chosen(station, made):
    packets = []
    for system in (1, 7):
        vehicle = station(system)
        packets += [(0.0, vehicle.heartbeat()), *turned(vehicle, 1, 50)]
    path = made(sorted(packets, key=lambda packet: packet[0]))
    with pytest.raises(RecordingError, match=r"several vehicles: system 1 \(ArduPilot\), system 7"):
        mpucal.load(path)
    assert len(read_log(TlogFile(path), path.name, system=7)) == 49


def test_px4_highres_is_believed_only_without_the_estimators_biases(station, made):
    px4 = station(autopilot=12)

    def highres(k):
        return px4.message("highres_imu", 10_000 * k, 0.1, 0.2, -9.8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 20.0, 0xFFFF, 0)

    def control(bits):
        as_float = struct.unpack("<f", bits.to_bytes(4, "little"))[0]
        return px4.message("param_value", b"EKF2_IMU_CTRL", as_float, 6, 1, 0)

    stream = [(0.01 * k, highres(k)) for k in range(1, 50)]
    # bit 0: the gyroscope's, bit 1: the accelerometer's
    for bits in (7, 6, 5):
        with pytest.raises(RecordingError, match="estimator's bias is subtracted"):
            mpucal.load(made([(0.0, px4.heartbeat()), (0.0, control(bits)), *stream]))
    unbiased = made([(0.0, px4.heartbeat()), (0.0, control(4)), *stream])
    assert mpucal.load(unbiased).sensor.message == "HIGHRES_IMU"


@pytest.mark.parametrize(("kind", "words"), [("heartbeat", "no accelerations"), ("raw", "no autopilot's heartbeat")])
def test_a_log_that_lacks_messages_is_refused(station, made, kind, words):
    packet = station().heartbeat() if kind == "heartbeat" else station().raw(1000)
    with pytest.raises(RecordingError, match=f"holds {words}"):
        mpucal.load(made([(0.0, packet)]))


def test_a_log_is_not_held_as_messages(station, made):
    """A message takes two thousand bytes, a reading two hundred at most."""
    vehicle = station()
    path = made([(0.0, vehicle.heartbeat()), *turned(vehicle, 1, 3000)])
    mpucal.load(path)
    gc.collect()  # else earlier tests decide when garbage in cycles goes
    tracemalloc.start()
    try:
        assert len(mpucal.load(path)) == 2999
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 400 * 3000
