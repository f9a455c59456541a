"""Captures: what is written is read, by others too; of what is killed, cut or damaged, all that is whole."""

import gc
import json
import os
import re
import signal
import subprocess
import sys
import tracemalloc
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import replace
from itertools import accumulate
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.records import ChunkIndex
from mcap_protobuf.decoder import DecoderFactory

import mpucal
from mpucal.chip.access import FORGET, Failure, SessionEvent, Transaction
from mpucal.chip.accesses import Accesses
from mpucal.chip.decode import decode
from mpucal.chip.fifo import Run
from mpucal.data import Samples
from mpucal.errors import CaptureError, OutputError, RecordingError
from mpucal.files import capture as capture_module
from mpucal.files import capture_writer, mcap, open_rows, protobuf
from mpucal.files.capture import Spool, capture_rows, load_capture
from mpucal.files.capture_writer import CaptureWriter
from mpucal.files.mcap import read_capture
from mpucal.files.messages import encode_accesses

FIXTURES = Path(__file__).parents[2] / "fixtures"
META = {"mpucal": "0.1.0", "chip": "MPU-6050", "options": {"gravity": 9.81, "seed": None}}

times = st.integers(0, 2**63 - 1)
words = st.text(max_size=30)
registers = st.integers(0, 255) | st.sampled_from(["iio:device0", "iio:device0/in_accel_scale"])
data = st.binary(max_size=40)
failures = st.none() | st.builds(Failure, words, words, words)
reads = st.builds(lambda r, d, t, f: Transaction("read", r, len(d), d, t, f), registers, data, times, failures)
writes = st.builds(lambda r, d, t, f: Transaction("write", r, len(d), d, t, f), registers, data, times, failures)
plain = st.none() | st.booleans() | st.integers(-(2**53), 2**53) | st.floats(allow_nan=False) | words
events = st.builds(SessionEvent, words, times, st.dictionaries(words, plain, max_size=3))


def write(path, records, meta=META):
    path.unlink(missing_ok=True)
    with CaptureWriter(path) as writer:
        writer.start(meta)
        for record in records:
            if isinstance(record, SessionEvent):
                writer.event(record.name, record.t_ns, record.data)
            else:
                writer.transaction(record)


def polls(count, period_ns=20_000_000, fifo=4):
    """Reads of a FIFO, every one different."""
    return [Transaction("read", 0x74, fifo, (7919 * i).to_bytes(fifo, "big"), i * period_ns) for i in range(count)]


@contextmanager
def killed_at_the_end(monkeypatch):
    """A capture's chunks as they are while it is written."""
    with monkeypatch.context() as as_killed:
        as_killed.setattr(capture_writer, "CLOSED_CHUNK_NS", capture_writer.CHUNK_NS)
        yield


@pytest.fixture
def path(tmp_path):
    return tmp_path / "capture.mcap"


def test_a_growing_capture_takes_no_more_memory(path):
    def chunks():
        return [each for each in gc.get_objects() if isinstance(each, ChunkIndex)]

    others = chunks()  # of readers elsewhere, which are still referred to
    with CaptureWriter(path) as writer:
        writer.start(META)
        for record in polls(1_000, period_ns=200_000_000):
            writer.transaction(record)
        own = [each for each in chunks() if not any(each is other for other in others)]
    assert own == []
    with path.open("rb") as file:
        assert len(make_reader(file).get_summary().chunk_indexes) > 30


@settings(max_examples=15)
@given(
    st.lists(reads | writes | events, max_size=20),
    st.dictionaries(words.filter(lambda word: word != mcap.VERSION_KEY), plain),
)
def test_reads_what_was_written_in_the_order_in_which_it_happened(path, records, meta):
    write(path, records, meta)
    capture = read_capture(path)
    assert list(capture.records) == records
    assert capture.meta == meta
    assert capture.recovered is None


def test_other_programs_read_it(path, monkeypatch):
    """Read it by the reader of the library mcap, with its index, and by Protocol Buffers, as a viewer of files does."""
    failed = Transaction("read", 0x38, 3, b"", 2_000_000_001, Failure("NoAnswer", "no answer of 0x68", "wire it"))
    heard = [replace(each, host_ns=each.t_ns + 7_000_000_000 - i) for i, each in enumerate(polls(200, fifo=14))]
    records = [*heard[:101], failed, *heard[101:], SessionEvent("key", 5_000_000_000, {"key": "enough"})]
    monkeypatch.setattr(capture_writer, "CHUNK_NS", 5_000_000_000)
    write(path, records)
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        assert summary.statistics.channel_message_counts == {1: 1, 2: 1}
        assert {channel.topic for channel in summary.channels.values()} == {"/bus", "/session"}
        assert {schema.encoding for schema in summary.schemas.values()} == {"protobuf", "jsonschema"}
        ((_, _, message, accesses),) = reader.iter_decoded_messages("/bus")
        ((_, _, event),) = reader.iter_messages("/session")
        (metadata,) = reader.iter_metadata()
    assert json.loads(metadata.metadata["chip"]) == "MPU-6050"
    assert message.publish_time == 7_000_000_000
    assert list(accumulate(accesses.step_ns)) == [record.t_ns for record in records[:-1]]
    ahead = list(accumulate(accesses.heard_ns))
    assert ahead == [each.host_ns - each.t_ns for each in heard]
    assert [each & 2 > 0 for each in accesses.kind] == [record.error is None for record in records[:-1]]
    words = np.array(accesses.words).reshape(-1, accesses.frame_words).cumsum(axis=0).astype(np.int16)
    assert words.astype(">i2").tobytes() == b"".join(each.data for each in heard)
    (failure,) = accesses.failures
    assert (failure.access, failure.name, failure.what, failure.remedy) == (101, *failed.error)
    assert json.loads(event.data) == {"name": "key", "data": {"key": "enough"}}


KILLED = """
import sys
from mpucal.files.capture_writer import CaptureWriter
from mpucal.chip.access import Transaction
writers = []
for count in map(int, sys.argv[1:]):
    writers.append(CaptureWriter(f"{count}.mcap"))
    writers[-1].start({"chip": "MPU-6050"})
    for i in range(count):
        writers[-1].transaction(Transaction("read", 0x74, 4, (7919 * i).to_bytes(4, "big"), i * 20_000_000))
print("written", flush=True)
sys.stdin.read()
"""


def test_a_killed_program_loses_its_last_second_at_most(tmp_path):
    counts = (0, 30, 523)  # killed at the start, in the first second, later
    words = [sys.executable, "-c", KILLED, *map(str, counts)]
    child = subprocess.Popen(words, cwd=tmp_path, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    with child:
        assert child.stdout.readline() == b"written\n"
        child.send_signal(signal.SIGKILL)
    assert child.returncode == -signal.SIGKILL
    for count in counts:
        capture = read_capture(tmp_path / f"{count}.mcap")
        kept = len(capture.records)
        assert list(capture.records) == polls(count)[:kept]
        assert count - kept <= 50  # polls in a second
        assert "was never closed" in capture.recovered
        assert f"{kept} records" in capture.recovered


def test_all_whole_chunks_of_a_cut_file_are_read(path, monkeypatch):
    records = polls(120)
    with killed_at_the_end(monkeypatch):
        write(path, records)
    whole = path.read_bytes()
    held, kept = [], 0
    for size in [*range(1, len(whole), 37), len(whole) - 1]:
        path.write_bytes(whole[:size])
        try:
            capture = read_capture(path)
        except CaptureError:
            assert kept == 0, "the head was there before"
            continue
        assert list(capture.records) == records[: len(capture.records)]
        assert capture.recovered.startswith("capture.mcap")
        assert len(capture.records) >= kept
        kept = len(capture.records)
        held.append(kept)
    assert held[0] == 0
    assert held[-1] == 120
    assert len(set(held)) == 6  # nothing, then a chunk of 26 polls more each time


@pytest.fixture(scope="module")
def sixty_polls(tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "capture.mcap"
    write(path, polls(60))
    return path.read_bytes()


@settings(max_examples=40)
@given(share=st.floats(0.0, 1.0, exclude_max=True), bit=st.integers(0, 7))
def test_a_changed_bit_is_noticed_and_what_precedes_it_is_kept(sixty_polls, path, share, bit):
    records, whole = polls(60), bytearray(sixty_polls)
    whole[int(share * len(whole))] ^= 1 << bit
    path.write_bytes(whole)
    with suppress(CaptureError):
        capture = read_capture(path)
        kept = [record for record in records if record in capture.records]
        assert list(capture.records) == kept
        assert capture.recovered is not None or kept == records


def test_a_chunk_longer_than_any_memory_is_damage(sixty_polls, path):
    kept = []
    for name in re.finditer(b"zstd", sixty_polls):
        # a chunk: its length without compression (8), a checksum (4), the length of the name (4), the name
        damaged = bytearray(sixty_polls)
        damaged[name.start() - 9] |= 0x80
        path.write_bytes(damaged)
        capture = read_capture(path)
        kept.append(len(capture.records))
        assert list(capture.records) == polls(60)[: kept[-1]]
    assert min(kept) == 0


@pytest.mark.parametrize(
    ("content", "says"),
    [
        pytest.param(b"", "is empty", id="empty"),
        pytest.param(b"t,ax,ay,az\n0,0,0,9.8\n", "not an MCAP file", id="text"),
        pytest.param(b"\x89MCAP0\r\n", "lacks the metadata", id="magic alone"),
        pytest.param(b"\x89MCAP0\r\n\x05\x05" + bytes(29), "lacks the metadata", id="a message of 5 bytes"),
    ],
)
def test_other_content_is_refused(path, content, says):
    path.write_bytes(content)
    with pytest.raises(CaptureError, match=says):
        read_capture(path)


@pytest.mark.parametrize("version", [1, 3])
def test_a_capture_of_another_version_is_refused(path, version, monkeypatch):
    with monkeypatch.context() as other:
        other.setattr(capture_writer, "VERSION", version)
        write(path, polls(3))
    with pytest.raises(CaptureError, match=f"version {version}"):
        read_capture(path)


def test_a_full_disk_is_an_output_error(monkeypatch):
    # the one device that is written to
    monkeypatch.setattr(os, "devnull", "/dev/full")
    with pytest.raises(OutputError, match="No space left"), CaptureWriter("/dev/full") as writer:
        writer.start(META)


def test_closing_before_the_start_leaves_an_empty_file(path):
    with CaptureWriter(path):
        pass
    assert path.read_bytes() == b""


CAPTURES = sorted(FIXTURES.glob("*/*.mcap"))


@pytest.mark.parametrize("capture", CAPTURES, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_many_accesses_at_once_are_decoded_as_one_by_one(capture, path, monkeypatch):
    """Decode stored captures, some with faults, and new files of the same records.

    Of a session's, the first 700 records, in which there are events, rest and motion.
    """
    read = read_capture(capture)
    records = read.records[:700]
    one_by_one = decode([each for each in records if isinstance(each, Transaction)], path.name)
    forgotten = [each.data for each in records if isinstance(each, SessionEvent) and each.name == FORGET]
    one_by_one = one_by_one.without({int(span["first"]): int(span["last"]) for span in forgotten})
    for chunks in (nullcontext(), killed_at_the_end(monkeypatch)):
        with chunks:
            write(path, records, read.meta)
        again = read_capture(path)
        assert (again.records, again.meta, again.recovered) == (records, read.meta, None)
        whole, rows = load_capture(path), capture_rows(path)
        assert replace(whole, utc_ns=None) == one_by_one
        assert rows.recording() == replace(whole, name=rows.name)


@pytest.mark.parametrize("number", [5, 6], ids=["times", "times heard"])
def test_a_message_whose_columns_do_not_fit_is_refused(path, number, monkeypatch):
    monkeypatch.setattr(capture_writer, "encode_accesses", lambda accesses: message + protobuf.field(number, b"\2"))
    message = encode_accesses(Accesses.from_transactions(polls(3)))
    write(path, polls(3))
    with pytest.raises(CaptureError, match="an invalid message"):
        read_capture(path)


def assert_rows_are_as_loaded(path):
    rows, whole = open_rows(path), mpucal.load(path)
    joined = Samples.joined(list(rows.runs))
    for name in Samples.__dataclass_fields__:
        np.testing.assert_allclose(getattr(joined, name), getattr(whole, name), rtol=0, atol=1e-9, err_msg=name)
    assert (rows.sensor, rows.recovered, rows.name) == (whole.sensor, whole.recovered, whole.name)


def test_a_cut_capture_gives_what_is_whole(tmp_path):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes((FIXTURES / "faults" / "overflow.mcap").read_bytes()[:-5000])
    assert_rows_are_as_loaded(cut)
    assert "cut short" in open_rows(cut).recovered


@pytest.mark.parametrize(
    ("forgotten", "lost"),
    [
        ([(0, 10)], 10),
        ([(5, 9), (200, 1700)], 274),
        ([(100, 10**30)], None),
        ([(10, 2)], 0),
        ([(10**22, 10**30)], 0),
        ([(-5, 100)], 100),
        ([(0, 10**30)], "holds 0 usable samples"),
        ([("x", 1)], "an event forget without a whole number"),
        ([(float("1e400"), 1)], "an event forget without a whole number"),
    ],
)
def test_forgotten_polls_are_left_out(forgotten, lost, tmp_path):
    """Leave out whole polls, and what lies beyond the end."""
    capture = read_capture(FIXTURES / "faults" / "overflow.mcap")
    with CaptureWriter(tmp_path / "c.mcap") as writer:
        writer.start(capture.meta)
        for record in capture.records:
            if isinstance(record, Transaction):
                writer.transaction(record)
        for first, last in forgotten:
            writer.event(FORGET, capture.records[-1].t_ns, {"first": first, "last": last})
    if isinstance(lost, str):
        with pytest.raises((CaptureError, RecordingError), match=lost):
            mpucal.load(tmp_path / "c.mcap")
        return
    assert_rows_are_as_loaded(tmp_path / "c.mcap")
    whole = len(mpucal.load(FIXTURES / "faults" / "overflow.mcap"))
    assert len(mpucal.load(tmp_path / "c.mcap")) == (100 if lost is None else whole - lost)


def test_the_frames_of_a_long_capture_wait_in_a_file(monkeypatch):
    """Keep no byte of a sample in memory; the 16 bytes for each read of the FIFO's count are not measured here."""
    monkeypatch.setattr(capture_module, "RUN", 500)
    spool, frames = Spool(), np.arange(7000, dtype=np.int16).reshape(1000, 7)
    tracemalloc.start()
    for number in range(100):
        lost = number == 50
        spool.add([Run(int(number >= 50), (number % 50) * 1000, frames, gap=lost)])
    weight, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert weight < 50_000
    runs = list(spool.runs())
    assert [len(run.frames) for run in runs] == [500] * 200
    assert [run.gap for run in runs] == [False] * 100 + [True] + [False] * 99
    assert [(run.segment, run.first) for run in runs] == [(i // 100, i % 100 * 500) for i in range(200)]
    np.testing.assert_array_equal(np.concatenate([run.frames for run in runs]), np.tile(frames, (100, 1)))
