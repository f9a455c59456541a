"""mpucal's own tables and archives: what goes in comes out, whole or a run at a time; of a failure nothing is left."""

import csv
import tracemalloc
from dataclasses import replace

import hypothesis.extra.numpy as hnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.data import RUN, Recording, Sensor
from mpucal.errors import RecordingError
from mpucal.files import csv as csv_module
from mpucal.files import load, open_rows, open_writer
from mpucal.files._text import lines, numbers
from mpucal.files.rows import Rows

N = RUN + 1000
HEADER = "t,ax,ay,az,gx,gy,gz\n"


def recording(n=N):
    rng = np.random.default_rng(4)
    return Recording.from_arrays(
        np.arange(n) * 0.005 + 3.25,
        rng.normal(size=(n, 3)),
        rng.normal(size=(n, 3)),
        (5, 200),
        temperature_c=rng.normal(30.0, 1.0, n),
        gap=np.arange(n) == 77,
        acc_clipped=np.arange(n) % 7 == 0,
        gyr_clipped=np.arange(n) % 5 == 0,
        sensor=Sensor(chip="MPU-6050", who_am_i=0x68, accel_offsets=(1, 2, 3)),
    )


def through(source, target, done=""):
    rows = open_rows(source)
    runs = []
    with open_writer(target, rows, done) as write:
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
    assert through(archive, tmp_path / "out.npz", "nothing was done") == [RUN, 1000]
    before, after = load(archive), load(tmp_path / "out.npz")
    assert after.at(slice(None)) == before.at(slice(None))
    assert (after.flat, after.sensor) == (before.flat, before.sensor)
    assert open_rows(tmp_path / "out.npz").done == "nothing was done"
    # numpy's own reader agrees, and reads no pickle
    with np.load(tmp_path / "out.npz", allow_pickle=False) as arrays:
        assert set(arrays.files) >= {"t", "acc", "gyr", "done"}


@settings(max_examples=30)
@given(hnp.arrays(float, (4, 6), elements=st.floats(-1e9, 1e9)), st.booleans())
def test_a_table_gives_the_numbers_that_were_saved(save, tmp_path, values, warm):
    temperature_c = values[:, 0] if warm else None
    made = Recording.from_arrays([0.0, 0.1, 0.2, 1 / 3], values[:, :3], values[:, 3:], temperature_c=temperature_c)
    save(made, tmp_path / "made.csv")
    read = load(tmp_path / "made.csv")
    for name in ("t", "acc", "gyr", "temperature_c"):
        np.testing.assert_array_equal(getattr(read, name), getattr(made, name))


@pytest.mark.parametrize(
    "text",
    [
        pytest.param("gz,t,gx,note,ay,ax,az,gy\n6,0,4,a,2,1,3,5\n6,1,4,b,2,1,3,5\n", id="another order, one more"),
        pytest.param("\ufeffT, Ax, AY ,az,gx,gy,gz\r\n0,1,2,3,4,5,6\r\n\r\n1, 1,2,3,4,5,6", id="a spreadsheet's"),
        pytest.param('"t","ax","ay","az","gx","gy","gz"\n"0",1,2,3,4,5,6\n"1",1,2,3,4,5,6\n,,,,,,\n', id="quoted"),
        pytest.param("t,ax,ay,az,gx,gy,gz\r0,1,2,3,4,5,6\r1,1,2,3,4,5,6\r", id="an old Macintosh's"),
        pytest.param("t,ax,ay,az,gx,gy,gz\n  \n0,1,2,3,4,5,6\n \t\n1,1,2,3,4,5,6\n  ", id="lines of blanks"),
    ],
)
def test_columns_go_by_their_names(text, tmp_path):
    (tmp_path / "made.csv").write_text(text, newline="")
    read = load(tmp_path / "made.csv")
    np.testing.assert_array_equal(np.column_stack([read.t, read.acc, read.gyr]), [[0, *range(1, 7)], [1, *range(1, 7)]])
    assert np.isnan(read.temperature_c).all()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        pytest.param("", "is empty", id="empty"),
        pytest.param(HEADER, "holds no samples", id="header alone"),
        pytest.param("0,1,2,3,4,5,6\n1,1,2,3,4,5,6\n", "its columns are unnamed: name its columns", id="no header"),
        pytest.param("t,ax,ay,az,gx,gy\n", "holds no lines below", id="no gz"),
        pytest.param("t;ax;ay;az;gx;gy;gz\n0;1;2;3;4;5;6\n", "holds 1 accelerations", id="semicolons"),
        pytest.param("t,t,ax,ay,az,gx,gy,gz\n", "names t twice", id="t twice"),
        pytest.param(HEADER + "0,1,2,3,4,5,6\n\n1,1,2,3,4,5\n", "lacks a number in nearly", id="a value short"),
        pytest.param(HEADER + "0,1,2,3,4,5,6\n1,1,2,x,4,5,6\n", "line 3: az is 'x'", id="a word"),
        pytest.param(HEADER + "0,1,2,,4,5,6\n", "lacks a number in every sample", id="nothing"),
        pytest.param(HEADER + "0,1,2,3,4,5,6\n1,1,nan,3,4,5,6\n", "lacks a number in nearly every", id="NaN"),
        pytest.param(HEADER + "0,1,2,3,4,5,6\n", r"shape \(1,\)", id="one sample"),
        pytest.param(HEADER + '0,"' + "1" * 200_000, "is not a table", id="a field without end"),
        pytest.param("\x89MCAP0\r\n", "names no columns of", id="no text"),
    ],
)
def test_tables_that_are_no_recording_are_refused(text, says, tmp_path):
    (tmp_path / "made.csv").write_text(text)
    with pytest.raises(RecordingError, match=says) as raised:
        load(tmp_path / "made.csv")
    assert "made.csv" in str(raised.value)


N_SMALL = 50
SMALL = {
    "t": np.arange(N_SMALL) / 100,
    "acc": np.random.default_rng(1).normal(size=(N_SMALL, 3)),
    "gyr": np.ones((50, 3)),
}


@pytest.mark.parametrize(
    ("extra", "flat"),
    [({}, None), ({"flat": (5, 15)}, (5, 15)), ({"flat_samples": 20}, (0, 20)), ({"flat_samples": [20]}, (0, 20))],
)
def test_values_missing_from_an_archive_are_unknown(extra, flat, tmp_path):
    np.savez(tmp_path / "a.npz", **SMALL, **extra, units="s, m/s^2, rad/s", notes="ignored")
    read = load(tmp_path / "a.npz")
    assert (read.flat, read.sensor) == (flat, Sensor())
    assert np.isnan(read.temperature_c).all()
    assert not (read.gap | read.acc_clipped | read.gyr_clipped).any()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"gyr": None}, "so gravity is not in it"),
        ({"acc": np.zeros((N_SMALL, 2))}, r"a\.npz: acc has shape \(50, 2\)"),
        ({"t": np.where(np.arange(N_SMALL) == 0, -1.7e308, 1.7e308)}, "time does not increase|t has steps of"),
        ({"t": np.array(["a"] * N_SMALL)}, "t holds values that are not numbers"),
        ({"acc": np.full((N_SMALL, 3), np.longdouble("1e400"))}, "lacks a number in every sample"),
        ({"flat": (1, 2, 3)}, "flat is"),
        ({"flat": [0, np.inf]}, "give flat as"),
        ({"flat": [1j, 3]}, "give flat as"),
        ({"flat_samples": np.nan}, "flat_samples is nan"),
        ({"sensor": "MPU"}, "sensor is not a JSON object"),
        ({"sensor": "[1]"}, "sensor is not a JSON object"),
    ],
)
def test_arrays_that_are_no_recording_are_refused(change, says, tmp_path):
    np.savez(tmp_path / "a.npz", **{key: value for key, value in (SMALL | change).items() if value is not None})
    with pytest.raises(RecordingError, match=says):
        load(tmp_path / "a.npz")


def test_files_that_are_no_archive_are_refused(tmp_path):
    path = tmp_path / "a.npz"
    np.savez_compressed(path, **SMALL)
    whole = path.read_bytes()
    broken = bytearray(whole)
    broken[len(whole) // 2] ^= 0xFF
    for content in [b"", b"t,acc,gyr", whole[:-30], whole[: len(whole) // 2], bytes(broken)]:
        path.write_bytes(content)
        with pytest.raises(RecordingError, match="not a whole NumPy archive"):
            load(path)


def test_an_archive_of_objects_runs_no_code(tmp_path):
    class Trap:
        def __reduce__(self):
            return (pytest.fail, ("a pickle was loaded",))

    np.savez(tmp_path / "a.npz", **(SMALL | {"t": np.array([Trap()], dtype=object)}))
    with pytest.raises(RecordingError, match="allow_pickle=False"):
        load(tmp_path / "a.npz")


def test_real_and_simulated_recordings_of_others_are_read(shared):
    recordings, simulated = shared("recordings", "simulated")
    for path in [*recordings.glob("*.npz"), *simulated.glob("*.npz")]:
        with np.load(path) as archive:
            read = load(path)
            np.testing.assert_array_equal(read.acc, archive["acc"])
            assert read.flat == ((0, archive["flat_samples"]) if "flat_samples" in archive else None)


@pytest.mark.parametrize("kind", [".csv", ".npz"])
@pytest.mark.parametrize(
    ("at", "value", "said"),
    [
        (RUN + 100, np.nan, "t is not a finite number in sample"),
        (RUN, 0.0, "time does not increase at sample"),
    ],
)
def test_a_bad_time_is_named_from_run_to_run_and_leaves_no_file(kind, at, value, said, tmp_path):
    made = recording()
    t = made.t.copy()
    t[at::2] = value
    source = tmp_path / f"in{kind}"
    if kind == ".npz":
        np.savez(source, t=t, acc=made.acc, gyr=made.gyr)
    else:
        source.write_bytes(HEADER.encode() + lines(np.column_stack([t, made.acc, made.gyr])))
    # an archive is checked whole, and does not name the sample that lacks a time; a few late times of a table are read
    named = said.partition(" in sample")[0] if (kind == ".npz") == np.isnan(value) else f"{said} {at}"
    with pytest.raises(RecordingError, match=named) as raised:
        through(source, tmp_path / "out.csv")
    assert ("another recording begins there" in str(raised.value)) == (not np.isnan(value))
    assert not (tmp_path / "out.csv").exists()


@pytest.mark.parametrize(("kind", "key", "value"), [(".csv", "acc", np.nan), (".npz", "gyr", -np.inf)])
def test_a_sample_that_lacks_a_number_passes_through_and_is_no_part_of_a_recording(kind, key, value, tmp_path):
    before = recording()
    arrays = {name: getattr(before, name).copy() for name in ("t", "acc", "gyr")}
    arrays[key][RUN + 100, 1] = value
    np.savez(tmp_path / "in.npz", **arrays)
    through(tmp_path / "in.npz", tmp_path / "in.csv")
    through(tmp_path / f"in{kind}", tmp_path / "out.npz")
    with np.load(tmp_path / "out.npz") as out:
        assert np.argwhere(np.isnan(out[key])).tolist() == [[RUN + 100, 1]]
    read, kept = load(tmp_path / f"in{kind}"), np.arange(N) != RUN + 100
    np.testing.assert_array_equal(getattr(read, key), getattr(before, key)[kept])
    # one step of two intervals is no gap
    assert not read.gap.any()
    assert read.taken == f"in{kind}: 1 samples that lack a number were left out."


@given(hnp.arrays(float, st.tuples(st.integers(1, 4), st.integers(1, 3)), elements=st.floats(allow_subnormal=True)))
def test_text_gives_back_each_number_that_there_is(table):
    text = lines(table)
    np.testing.assert_array_equal([[float(cell) for cell in row.split(b",")] for row in text.splitlines()], table)
    np.testing.assert_array_equal(numbers(text, table.shape[1], range(table.shape[1])), table)


def test_text_is_as_a_person_writes_it():
    assert lines(np.array([[0.0, 1.0, -0.25, 100000.0], [1e-4, 1e-9, 1e20, np.nan]])) == (
        b"0,1,-0.25,100000\n0.0001,1e-09,1e+20,nan\n"
    )


@pytest.mark.parametrize("block", [1, 30])
def test_lines_may_end_within_a_block_and_within_quotation_marks(block, tmp_path, monkeypatch):
    monkeypatch.setattr(csv_module, "BLOCK", block)
    (tmp_path / "a.csv").write_text('note,t,ax,ay,az,gx,gy,gz\n"one\ntwo",0,1,2,3,4,5,6\n"a ""b""",1,1,2,3,4,5,6\n')
    np.testing.assert_array_equal(load(tmp_path / "a.csv").acc, [[1, 2, 3]] * 2)
    rows = [[i, 1, 2, 3, 4, 5, 6] for i in range(300)]
    rows[248][3] = "nonsense"
    with (tmp_path / "bad.csv").open("w", newline="") as file:
        csv.writer(file).writerows([["t", "ax", "ay", "az", "gx", "gy", "gz"], *rows])
    with pytest.raises(RecordingError, match="line 250: az is 'nonsense'"):
        list(open_rows(tmp_path / "bad.csv").runs)


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


@pytest.mark.parametrize("target", [".csv", ".mcap"])
def test_memory_is_that_of_one_run_at_any_length(target, tmp_path):
    def peak(n):
        whole = recording(n)
        path = tmp_path / f"{n}.csv"
        with open_writer(path, Rows(iter(())), "") as write:
            for first in range(0, len(whole), RUN):
                write(whole.part(first, first + RUN))
        del whole
        tracemalloc.start()
        through(path, tmp_path / f"out{target}")
        _, heaviest = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return heaviest

    peak(500)  # loads the modules
    # the samples of the run between take 1 MB
    assert peak(2 * RUN) - peak(RUN) < 600_000


@pytest.mark.parametrize(
    ("t_s", "utc_ns"), [(-1.0, None), (0.0, 2_200_000_000 * 10**9)], ids=["before 1970", "after 2038"]
)
def test_a_time_that_no_message_of_ros_holds_is_refused(t_s, utc_ns, tmp_path):
    samples = recording(300).at(slice(None))
    samples.t[0] = t_s
    with (
        pytest.raises(RecordingError, match=r"can only hold times from 0 to 2\^31 s"),
        open_writer(tmp_path / "x.mcap", Rows(iter(()), utc_ns=utc_ns), "") as write,
    ):
        write(samples)


@pytest.mark.parametrize("utc_s", ["1e30", "1e400", "-1e9", "nan"])
def test_a_time_of_day_that_is_none_is_left_out(utc_s, tmp_path):
    rows = [f"{0.01 * k},0,0,9.8,0,0,0,{utc_s}" for k in range(40)]
    (tmp_path / "a.csv").write_text("\n".join(["t,ax,ay,az,gx,gy,gz,utc_s", *rows]))
    assert open_rows(tmp_path / "a.csv").utc_ns is None


@pytest.mark.parametrize("suffix", [".npz", ".csv", ".mcap"])
@pytest.mark.parametrize("utc_ns", [None, 1_718_030_736_872_695_300])
def test_the_time_of_day_is_kept(suffix, utc_ns, tmp_path):
    n = 40
    made = Recording.from_arrays(np.arange(n) * 0.01 + 0.5, np.full((n, 3), 5.66), np.full((n, 3), 0.1))
    with open_writer(tmp_path / f"a{suffix}", Rows.of(replace(made, utc_ns=utc_ns)), "") as write:
        write(made)
    read = load(tmp_path / f"a{suffix}")
    if utc_ns is None:
        assert read.utc_ns is None
    else:
        # an .mcap's times begin with its first sample; a float64 of seconds has 0.2 us
        assert abs(read.utc_ns - utc_ns - (500_000_000 if suffix == ".mcap" else 0)) <= 300
