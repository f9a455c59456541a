"""The .tlog format: written, read, damaged, read by others, and made into recordings and sessions."""

import gc
import json
import struct
import tracemalloc
from dataclasses import asdict

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mpucal
from mpucal.__main__ import run
from mpucal.chip.config import RateOnlyConfig
from mpucal.chip.records import END, OPENED, SessionEvent
from mpucal.data import Samples
from mpucal.errors import CaptureError, EndOfCapture, RecordingError
from mpucal.files.mcap import CaptureWriter
from mpucal.files.messages import PACKETS
from mpucal.files.tlog import read_tlog
from mpucal.mavlink.dialect import dialect
from mpucal.mavlink.link import OWN_COMPONENT, OWN_SYSTEM
from mpucal.mavlink.log import read_log
from mpucal.mavlink.texts import CHUNK, PREFIX, Note, NoteReader
from mpucal.mavlink.tlog import RawPacket, TlogFile, encode_tlog
from mpucal.session.plan import Plan
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
    for name in Samples.__dataclass_fields__:
        assert np.array_equal(getattr(of_log, name), getattr(of_capture, name), equal_nan=True)


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


def noted(*notes):
    """Return the packets of events (name, data) as STATUSTEXT chunks, as an earlier mpucal wrote them."""
    sender = dialect().MAVLink(None, OWN_SYSTEM, OWN_COMPONENT)
    packets = []
    for number, (name, data) in enumerate(notes, 1):
        text = PREFIX + json.dumps({"name": name, "data": data}, separators=(",", ":")).encode()
        chunks = [text[at : at + CHUNK] for at in range(0, len(text) + 1, CHUNK)]
        messages = [dialect().MAVLink_statustext_message(7, chunk, number, k) for k, chunk in enumerate(chunks)]
        packets += [bytes(message.pack(sender)) for message in messages]
    return packets


LEAVES = st.none() | st.booleans() | st.integers(-9, 9) | st.text(max_size=60)
DATA = st.dictionaries(st.text(max_size=9), LEAVES | st.lists(LEAVES, max_size=4), max_size=4)


@given(name=st.text(max_size=80), data=DATA, lost=st.none() | st.integers(0, 20))
def test_a_note_comes_back_whole_or_not_at_all(decoded, name, data, lost):
    packets = noted((name, data))
    whole = lost is None or lost >= len(packets)
    reader = NoteReader()
    found = [reader.add(decoded(packet)) for k, packet in enumerate(packets) if k != lost]
    assert [note for note in found if note] == ([Note(name, data)] if whole else [])


def test_a_session_of_an_earlier_version_is_read_with_its_events(station, tmp_path):
    plan = asdict(Plan(RateOnlyConfig(rate_hz=50.0), target="quick"))
    heartbeat = station(7).heartbeat()
    head = noted((OPENED, {"mpucal": "1.0", "source": 4, "plan": plan, "system": 7, "prepare": True}))
    packets = [*head, heartbeat, *noted(("key", {"key": "enough"})), heartbeat, *noted((END, {}))]
    path = tmp_path / "capture.tlog"
    path.write_bytes(encode_tlog(RawPacket(k * 10**9, data) for k, data in enumerate(packets, 1)))
    capture = read_tlog(path)
    assert Plan.of_capture(capture.meta, "capture") == Plan(RateOnlyConfig(rate_hz=50.0), target="quick")
    assert (capture.meta["system"], capture.meta["prepare"]) == (7, True)
    replay = PacketReplay(capture.records, "capture")
    key = next(record for record in capture.records if record.data == {"key": "enough"})
    assert replay.receive(10**12).data == heartbeat
    assert replay.pending_events("key") == []
    assert replay.receive(key.t_ns + 1) is None
    assert replay.pending_events("key") == [SessionEvent("key", key.t_ns, {"key": "enough"})]
    assert replay.receive(10**12).data == heartbeat
    assert replay.receive(capture.records[-1].t_ns) is None
    assert [event.name for event in replay.pending_events(END)] == [END]
    with pytest.raises(EndOfCapture):
        replay.receive(10**12)
