"""Samples that pass through a run at a time: what goes in comes out, of every kind; of a failure nothing is left."""

import csv
import tracemalloc
from dataclasses import replace
from pathlib import Path

import hypothesis.extra.numpy as hnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import NonSeekingReader, make_reader

from mpucal.chip.access import Transaction
from mpucal.chip.fifo import Run
from mpucal.data import Recording, Samples, Sensor
from mpucal.errors import RecordingError
from mpucal.files import capture as capture_module
from mpucal.files import csv as csv_module
from mpucal.files import load, open_rows, open_writer
from mpucal.files._text import lines, numbers
from mpucal.files.capture import Spool
from mpucal.files.chunks import MESSAGES
from mpucal.files.mcap import CaptureWriter, read_capture
from mpucal.files.rows import ROWS, Rows

FIXTURES = Path(__file__).parents[2] / "fixtures"
N = ROWS + 1000


def recording(n=N, warm=True):
    rng = np.random.default_rng(4)
    return Recording.from_arrays(
        np.arange(n) * 0.005 + 3.25,
        rng.normal(size=(n, 3)),
        rng.normal(size=(n, 3)),
        (5, 200),
        temperature_c=rng.normal(30.0, 1.0, n) if warm else None,
        gap=np.arange(n) == 77,
        acc_clipped=np.arange(n) % 7 == 0,
        gyr_clipped=np.arange(n) % 5 == 0,
        sensor=Sensor(chip="MPU-6050", who_am_i=0x68, accel_offsets=(1, 2, 3)),
    )


def through(source, target):
    rows = open_rows(source)
    runs = []
    with open_writer(target, rows, "nothing was done") as write:
        for samples in rows.runs:
            runs.append(len(samples))
            write(samples)
    return runs


@pytest.fixture(scope="module")
def archive(tmp_path_factory, save):
    path = tmp_path_factory.mktemp("rows") / "recording.npz"
    save(recording(), path)
    return path


def test_an_archive_comes_out_as_it_went_in(archive, tmp_path):
    assert through(archive, tmp_path / "out.npz") == [ROWS, 1000]
    before, after = load(archive), load(tmp_path / "out.npz")
    for name in ("t", "acc", "gyr", "temperature_c", "gap", "acc_clipped", "gyr_clipped"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))
    assert (after.flat, after.sensor) == (before.flat, before.sensor)
    assert open_rows(tmp_path / "out.npz").done == "nothing was done"
    # numpy's own reader agrees, and reads no pickle
    with np.load(tmp_path / "out.npz", allow_pickle=False) as arrays:
        assert set(arrays.files) >= {"t", "acc", "gyr", "done"}


@pytest.mark.parametrize("kind", [".csv", ".npz"])
@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("t", np.nan, "t is not a finite number in sample 16484"),
        ("t", 0.0, "time does not increase at sample 16484"),
    ],
)
def test_a_sample_that_is_none_is_named_and_leaves_no_file(kind, key, value, said, tmp_path):
    arrays = {name: getattr(recording(), name).copy() for name in ("t", "acc", "gyr")}
    arrays[key][ROWS + 100] = value
    source = tmp_path / f"in{kind}"
    if kind == ".npz":
        np.savez(source, **arrays)
    else:
        table = np.column_stack([arrays["t"], arrays["acc"], arrays["gyr"]])
        source.write_bytes(b"t,ax,ay,az,gx,gy,gz\n" + lines(table))
    with pytest.raises(RecordingError, match=said):
        through(source, tmp_path / "out.csv")
    assert not (tmp_path / "out.csv").exists()


@pytest.mark.parametrize("kind", [".csv", ".npz"])
@pytest.mark.parametrize(("key", "value"), [("acc", np.nan), ("gyr", -np.inf)])
def test_a_sample_that_lacks_a_number_passes_through_and_is_no_part_of_a_recording(kind, key, value, tmp_path):
    before = recording()
    arrays = {name: getattr(before, name).copy() for name in ("t", "acc", "gyr")}
    arrays[key][ROWS + 100, 1] = value
    np.savez(tmp_path / "in.npz", **arrays)
    through(tmp_path / "in.npz", tmp_path / "in.csv")
    through(tmp_path / f"in{kind}", tmp_path / "out.npz")
    with np.load(tmp_path / "out.npz") as out:
        assert np.argwhere(np.isnan(out[key])).tolist() == [[ROWS + 100, 1]]
        np.testing.assert_array_equal(out["t"], before.t)
    read, kept = load(tmp_path / f"in{kind}"), np.arange(N) != ROWS + 100
    np.testing.assert_array_equal(getattr(read, key), getattr(before, key)[kept])
    # one step of two intervals is no gap
    assert not read.gap.any()
    assert read.taken == f"in{kind}: 1 samples that lack a number were left out."


def test_time_increases_from_run_to_run(tmp_path):
    t = recording().t.copy()
    t[ROWS] = t[ROWS - 1] - 1e-6
    np.savez(tmp_path / "in.npz", t=t, acc=recording().acc, gyr=recording().gyr)
    with pytest.raises(RecordingError, match=f"time does not increase at sample {ROWS}"):
        through(tmp_path / "in.npz", tmp_path / "out.npz")


def test_a_table_of_no_samples_is_no_recording(tmp_path):
    (tmp_path / "in.csv").write_text("t,ax,ay,az,gx,gy,gz\n\n")
    with pytest.raises(RecordingError, match="holds no samples"):
        through(tmp_path / "in.csv", tmp_path / "out.csv")


@pytest.mark.parametrize("more", [{"gap": (300, 2)}, {"acc_clipped": (7,)}, {"temperature_c": (300, 1)}])
def test_an_array_of_another_shape_is_named(more, tmp_path):
    some = recording(300)
    arrays = {key: np.zeros(shape) for key, shape in more.items()}
    np.savez(tmp_path / "in.npz", t=some.t, acc=some.acc, gyr=some.gyr, **arrays)
    with pytest.raises(RecordingError, match=f"{next(iter(more))} has shape"):
        through(tmp_path / "in.npz", tmp_path / "out.npz")


@given(hnp.arrays(float, st.tuples(st.integers(1, 4), st.integers(1, 3)), elements=st.floats(allow_subnormal=True)))
def test_text_gives_back_each_number_that_there_is(table):
    text = lines(table)
    assert [len(row) for row in csv.reader(text.decode().splitlines())] == [table.shape[1]] * len(table)
    np.testing.assert_array_equal([[float(cell) for cell in row.split(b",")] for row in text.splitlines()], table)
    np.testing.assert_array_equal(numbers(text, table.shape[1], range(table.shape[1])), table)


def test_text_is_as_a_person_writes_it():
    assert lines(np.array([[0.0, 1.0, -0.25, 100000.0], [1e-4, 1e-9, 1e20, np.nan]])) == (
        b"0,1,-0.25,100000\n0.0001,1e-09,1e+20,nan\n"
    )


@pytest.mark.parametrize(
    ("text", "found"),
    [
        (b"1,2,3", [[3.0, 1.0]]),
        (b"1, 2 ,3\r\n\r\n  \n4,note,6\n", [[3.0, 1.0], [6.0, 4.0]]),
        (b"", []),
        (b"1,2\n", None),
        (b"1,2,3,4\n", None),
        (b"1,2,\n", None),
        (b'1,"2",3\n', None),
        (b"+1,2,3\n", None),
        (b"1,2,3\n1,2,3x\n", None),
        (b"1\r2,2,3\n", None),
    ],
)
def test_what_is_no_plain_line_is_left_to_others(text, found):
    values = numbers(text, 3, [2, 0])
    assert values is None if found is None else values.tolist() == found


@pytest.mark.parametrize("places", [[], [3], [0, 2**40]])
def test_cells_outside_a_line_are_refused(places):
    with pytest.raises(ValueError, match="places"):
        numbers(b"1,2,3\n", 3, places)


@pytest.mark.parametrize("block", [1, 8, 30, 1 << 21])
def test_the_end_of_a_line_within_quotation_marks_is_none(block, tmp_path, monkeypatch):
    monkeypatch.setattr(csv_module, "BLOCK", block)
    (tmp_path / "a.csv").write_text('note,t,ax,ay,az,gx,gy,gz\n"one\ntwo",0,1,2,3,4,5,6\n"a ""b""",1,1,2,3,4,5,6\n')
    np.testing.assert_array_equal(load(tmp_path / "a.csv").acc, [[1, 2, 3]] * 2)


@pytest.mark.parametrize("line", [2, 250])
def test_a_bad_line_is_named(line, tmp_path, monkeypatch):
    monkeypatch.setattr(csv_module, "BLOCK", 1000)
    rows = [[i, 1, 2, 3, 4, 5, 6] for i in range(300)]
    rows[line - 2][3] = "nonsense"
    with (tmp_path / "bad.csv").open("w", newline="") as file:
        csv.writer(file).writerows([["t", "ax", "ay", "az", "gx", "gy", "gz"], *rows])
    with pytest.raises(RecordingError, match=f"line {line}: az is 'nonsense'"):
        list(open_rows(tmp_path / "bad.csv").runs)


def test_the_index_of_an_mcap_leads_to_its_messages(save, tmp_path):
    n = 2 * MESSAGES + 5
    before = recording(n)
    save(before, tmp_path / "in.npz")
    through(tmp_path / "in.npz", tmp_path / "out.mcap")
    t_ns = np.rint(before.t * 1e9).astype(int).tolist()
    with (tmp_path / "out.mcap").open("rb") as file:
        indexed = make_reader(file, validate_crcs=True)
        summary = indexed.get_summary()
        assert indexed.get_header().profile == "ros2"
        assert {(schema.name, schema.encoding) for schema in summary.schemas.values()} == {
            ("sensor_msgs/msg/Imu", "ros2msg")
        }
        assert summary.statistics.message_count == n
        assert (summary.statistics.message_start_time, summary.statistics.message_end_time) == (t_ns[0], t_ns[-1])
        assert len(summary.chunk_indexes) == 3
        found = [m.log_time for _, _, m in indexed.iter_messages(starting_at=t_ns[MESSAGES], ending_before=t_ns[-2])]
        assert found == t_ns[MESSAGES:-2]
        assert [(m.name, m.metadata) for m in indexed.iter_metadata()] == [("mpucal.imu", {"done": "nothing was done"})]
        file.seek(0)
        sequence = [m.sequence for _, _, m in NonSeekingReader(file, validate_crcs=True).iter_messages()]
        assert sequence == list(range(n))


@pytest.mark.parametrize("ending", [".csv", ".npz", ".mcap"])
def test_a_failure_leaves_the_old_file_and_no_other(ending, archive, tmp_path):
    target = tmp_path / f"out{ending}"
    target.write_text("old")
    rows = open_rows(archive)
    with pytest.raises(RecordingError), open_writer(target, rows, "") as write:
        write(next(rows.runs))
        raise RecordingError("the source failed", "try again")
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def columns(runs):
    joined = Samples.joined(list(runs))
    return {name: getattr(joined, name) for name in Samples.__dataclass_fields__}


def assert_the_same_as_loaded(path):
    rows, whole = open_rows(path), load(path)
    for name, column in columns(rows.runs).items():
        np.testing.assert_allclose(column, getattr(whole, name), rtol=0, atol=1e-9, err_msg=name)
    assert rows.sensor == whole.sensor
    assert (rows.recovered, rows.name) == (whole.recovered, whole.name)


def test_a_cut_capture_gives_what_is_whole(tmp_path):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes((FIXTURES / "faults" / "overflow.mcap").read_bytes()[:-5000])
    assert_the_same_as_loaded(cut)
    assert "cut short" in open_rows(cut).recovered


@pytest.mark.parametrize("forgotten", [[(0, 10)], [(5, 9), (200, 1700)], [(100, 100_000)]])
def test_what_was_forgotten_is_left_out(tmp_path, forgotten):
    """The second range takes whole polls with it, and the last all that follow."""
    capture = read_capture(FIXTURES / "faults" / "overflow.mcap")
    with CaptureWriter(tmp_path / "c.mcap") as writer:
        writer.start(capture.meta)
        for record in capture.records:
            if isinstance(record, Transaction):
                writer.transaction(record)
        for first, last in forgotten:
            writer.event("forget", capture.records[-1].t_ns, {"first": first, "last": last})
    assert_the_same_as_loaded(tmp_path / "c.mcap")


def test_the_frames_of_a_long_capture_wait_in_a_file(monkeypatch):
    """Keep no byte of a sample in memory; the 16 bytes for each read of the FIFO's count are not measured here."""
    monkeypatch.setattr(capture_module, "ROWS", 500)
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


@pytest.mark.parametrize(("source", "target"), [(".csv", ".mcap"), (".npz", ".csv"), (".csv", ".npz")])
def test_memory_is_that_of_a_run_however_many_there_are(source, target, tmp_path):
    def peak(runs):
        whole = recording(runs * ROWS)
        path = tmp_path / f"{runs}{source}"
        with open_writer(path, Rows(iter(())), "") as write:
            for first in range(0, len(whole), ROWS):
                write(whole.part(first, first + ROWS))
        del whole
        tracemalloc.start()
        through(path, tmp_path / f"out{target}")
        _, heaviest = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return heaviest

    peak(1)  # loads the modules
    # the samples of the runs between take 3 MB
    assert peak(5) - peak(2) < 600_000


def test_a_cut_archive_is_refused(archive, tmp_path):
    (tmp_path / "cut.npz").write_bytes(archive.read_bytes()[:-3000])
    with pytest.raises(RecordingError):
        list(open_rows(tmp_path / "cut.npz").runs)


def test_a_time_that_no_message_holds_is_refused(tmp_path):
    samples = Samples(*(getattr(recording(300), name) for name in Samples.__dataclass_fields__))
    samples.t[0] = -1.0
    with pytest.raises(RecordingError, match="time"), open_writer(tmp_path / "x.mcap", Rows(iter(())), "") as write:
        write(samples)


@pytest.mark.parametrize("utc_s", ["1e30", "1e400", "-1e9", "nan"])
def test_a_time_of_day_that_is_none_is_left_out(utc_s, tmp_path):
    lines = [f"{0.01 * k},0,0,9.8,0,0,0,{utc_s}" for k in range(40)]
    (tmp_path / "a.csv").write_text("\n".join(["t,ax,ay,az,gx,gy,gz,utc_s", *lines]))
    assert open_rows(tmp_path / "a.csv").utc_ns is None


@pytest.mark.parametrize("suffix", [".npz", ".csv", ".mcap"])
@pytest.mark.parametrize("utc_ns", [None, 1_718_030_736_872_695_300])
def test_the_time_of_day_is_kept(suffix, utc_ns, tmp_path):
    n = 40
    made = Recording.from_arrays(np.arange(n) * 0.01 + 0.5, np.full((n, 3), 5.66), np.full((n, 3), 0.1))
    with open_writer(tmp_path / f"a{suffix}", Rows.of(replace(made, utc_ns=utc_ns)), "") as write:
        write(made)
    read = open_rows(tmp_path / f"a{suffix}") if suffix != ".mcap" else load(tmp_path / f"a{suffix}")
    if utc_ns is None:
        assert read.utc_ns is None
    else:
        # an .mcap's times begin with its first sample; a float64 of seconds has 0.2 us
        assert abs(read.utc_ns - utc_ns - (500_000_000 if suffix == ".mcap" else 0)) <= 300


def test_stamps_of_arrival_are_replaced_in_runs_as_in_the_whole(walk, tmp_path):
    """Read a table of the own format with late stamps, as apply does and as calibrate does."""
    t = np.arange(len(walk)) / 100.0
    late = np.maximum.accumulate(t + np.random.default_rng(2).exponential(4e-3, len(t)))
    rows = np.column_stack([late, walk.acc, walk.gyr])
    np.savetxt(tmp_path / "walk.csv", rows, "%.9f", ",", header="t,ax,ay,az,gx,gy,gz", comments="")
    read, runs = load(tmp_path / "walk.csv"), open_rows(tmp_path / "walk.csv")
    assert "arrival stamps" in read.taken
    assert runs.taken == read.taken
    np.testing.assert_array_equal(np.concatenate([samples.t for samples in runs.runs]), read.t)
