"""The .tlog format: written, read, damaged, read by others, and made into recordings and sessions."""

import gc
import struct
import tracemalloc

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mpucal
from mpucal.__main__ import run
from mpucal.chip.access import END, SessionEvent
from mpucal.errors import CaptureError, EndOfCapture, RecordingError
from mpucal.files.capture_writer import CaptureWriter
from mpucal.files.messages import PACKETS
from mpucal.files.vehicle_logs import read_tlog
from mpucal.mavlink.dialect import dialect
from mpucal.mavlink.link import OWN_COMPONENT, OWN_SYSTEM
from mpucal.mavlink.log import read_log
from mpucal.mavlink.tlog import RawPacket, TlogFile, encode_tlog
from mpucal.sources.replay import PacketReplay

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


def test_a_capture_of_the_same_packets_exports_to_the_same_log(written, tmp_path):
    captured, out = tmp_path / "capture.mcap", tmp_path / "out.tlog"
    with CaptureWriter(captured) as writer:
        writer.start({}, PACKETS)
        for packet in written[1]:
            writer.packet(*packet)
    assert run(["export", str(captured), "--to", "tlog", "-o", str(out)]) == 0
    assert out.read_bytes() == written[0].read_bytes()
    of_log, of_capture = mpucal.load(written[0]), mpucal.load(captured)
    assert of_log.at(slice(None)) == of_capture.at(slice(None))


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


@settings(max_examples=30)
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
    for bits in (6, 5):
        with pytest.raises(RecordingError, match="estimator's bias is subtracted"):
            mpucal.load(made([(0.0, px4.heartbeat()), (0.0, control(bits)), *stream]))
    unbiased = made([(0.0, px4.heartbeat()), (0.0, control(4)), *stream])
    assert mpucal.load(unbiased).sensor.message == "HIGHRES_IMU"


def test_a_log_that_lacks_messages_is_refused(station, made):
    for packet, words in (
        (b"no packet of MAVLink", "no MAVLink packet"),
        (station().heartbeat(), "no accelerations"),
        (station().raw(1000), "no autopilot's heartbeat"),
    ):
        with pytest.raises((CaptureError, RecordingError), match=f"holds {words}"):
            mpucal.load(made([(0.0, packet)]))


def test_a_log_is_not_held_as_messages(station, made):
    """A message takes two thousand bytes, a reading two hundred at most."""
    vehicle = station()
    path = made([(0.0, vehicle.heartbeat()), *turned(vehicle, 1, 1500)])
    mpucal.load(path)
    gc.collect()  # else earlier tests decide when garbage in cycles goes
    tracemalloc.start()
    try:
        assert len(mpucal.load(path)) == 1499
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 400 * 1500


def test_the_log_of_another_station_is_a_capture_of_its_packets(written):
    path, records = written
    capture = read_tlog(path)
    assert (capture.meta, list(capture.records), capture.recovered) == ({}, records, None)


def test_a_replay_gives_the_packets_of_a_vehicle_and_the_keys_between_them(station):
    own = dialect().MAVLink(None, OWN_SYSTEM, OWN_COMPONENT)
    ours = bytes(dialect().MAVLink_statustext_message(6, b"mpucal: rotate").pack(own))
    heartbeat = station(7).heartbeat()
    key = SessionEvent("key", 3 * 10**9, {"key": "enough"})
    records = [*(RawPacket(k * 10**9, data) for k, data in ((1, ours), (2, heartbeat))), key]
    records += [RawPacket(4 * 10**9, heartbeat), SessionEvent(END, 5 * 10**9)]
    replay = PacketReplay(records, "capture")
    assert replay.receive(10**12).data == heartbeat
    assert replay.pending_events("key") == []
    assert replay.receive(key.t_ns + 1) is None
    assert replay.pending_events("key") == [key]
    assert replay.receive(10**12).data == heartbeat
    assert replay.receive(records[-1].t_ns) is None
    assert [event.name for event in replay.pending_events(END)] == [END]
    with pytest.raises(EndOfCapture):
        replay.receive(10**12)
