"""Whole files without a recording in them: a dead sensor, one sample over and over, no samples, times that are none."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from mcap.writer import Writer

import mpucal
from mpucal.chip.decode import decode
from mpucal.chip.records import FORGET, SessionEvent
from mpucal.data import Samples
from mpucal.errors import CaptureError, RecordingError
from mpucal.files import open_rows
from mpucal.files.imu import encode_messages
from mpucal.files.mcap import CaptureWriter, read_capture
from mpucal.files.ros import load_bag

FIXTURE = Path(__file__).parents[2] / "fixtures" / "sessions" / "mpu6050.mcap"
N = 40
NAMES = ["t [s]", *(f"a{axis} [m/s^2]" for axis in "xyz"), *(f"g{axis} [rad/s]" for axis in "xyz")]
TIMES = np.arange(N) / 100
AT_REST = np.tile([0.0, 0.0, 9.8, 0.0, 0.0, 0.0], (N, 1))


def table(times=TIMES, n=N):
    made = pd.DataFrame(AT_REST, columns=NAMES[1:])
    made.insert(0, NAMES[0], times)
    return made[:n]


def test_a_sensor_that_counts_zeros_measures_no_gravity(tmp_path):
    path = tmp_path / "dead.txt"
    path.write_text("a/g:\t0\t0\t0\t0\t0\t0\n" * N)
    with pytest.raises(RecordingError, match=r"at ±2 g the median \|a\| is 0 m/s\^2, which is not gravity"):
        mpucal.load(path, rate=100)


@pytest.mark.parametrize("times", [0, "2026-11-22T12:00:00"])
def test_one_line_over_and_over_is_one_sample(tmp_path, times):
    table(times).to_csv(tmp_path / "a.csv", index=False)
    with pytest.raises(RecordingError, match="repeats one sample of accelerations at one time: record it again"):
        mpucal.load(tmp_path / "a.csv")


DATES = pd.Series(pd.to_datetime(np.arange(N) * 10_000_000)).to_numpy()
NO_TIMES = {
    "none lies ahead": (np.where(np.arange(N) == 0, np.datetime64("NaT"), DATES), "t.* lacks a time"),
    "one is missing": (np.where(np.arange(N) == 7, np.datetime64("NaT"), DATES), "t.* lacks a time"),
    "the first is infinite": (np.where(np.arange(N) == 0, np.inf, TIMES), "times that are not finite"),
    "all are infinite": (np.full(N, np.inf), "repeats one sample of accelerations"),
    "they overflow": (
        np.where(np.arange(N) == 0, -1.7e308, 1.7e308 + TIMES),
        "times that are not finite|repeats one sample",
    ),
    "all are one": (np.zeros(N), "repeats one sample of accelerations"),
}


@pytest.mark.parametrize("what", NO_TIMES)
def test_times_that_are_none(tmp_path, what):
    times, says = NO_TIMES[what]
    table(times).to_parquet(tmp_path / "a.parquet")
    with pytest.raises(RecordingError, match=says):
        mpucal.load(tmp_path / "a.parquet")


@pytest.mark.parametrize("step", [5e-324, 1e-315, 1e-13])
def test_steps_that_no_sensor_takes(tmp_path, step):
    table(np.arange(1, N + 1) * step).to_parquet(tmp_path / "a.parquet")
    with pytest.raises(RecordingError, match=f"t has steps of {step:g} s"):
        mpucal.load(tmp_path / "a.parquet", units="t=s,gyr=rad/s")


def test_times_in_small_integers_do_not_wrap(tmp_path, walk):
    n = 3 * len(walk)  # 42 s
    made = pd.DataFrame(np.tile(np.column_stack([walk.acc, walk.gyr]), (3, 1)), columns=NAMES[1:])
    made.insert(0, "t [ms]", (np.arange(n) * 10 - 20_000).astype(np.int16))
    made.to_parquet(tmp_path / "a.parquet")
    np.testing.assert_allclose(mpucal.load(tmp_path / "a.parquet").t, np.arange(n) / 100, atol=1e-12)


def test_a_parquet_file_without_lines(tmp_path):
    table(n=0).to_parquet(tmp_path / "a.parquet")
    with pytest.raises(RecordingError, match="holds 0 accelerations: record for longer"):
        mpucal.load(tmp_path / "a.parquet")


@pytest.mark.parametrize(
    ("received_ns", "says"),
    [([], "holds 0 accelerations: record for longer"), (range(1 << 63, (1 << 63) + N), "holds impossible times")],
    ids=["no messages", "times beyond any clock"],
)
def test_a_bag_without_usable_messages(received_ns, says, ros1, encode_imu, tmp_path):
    """Refuse a bag of ROS 1 as an MCAP file, whose messages have no times of their own."""
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start("ros1")
        schema = writer.register_schema("sensor_msgs/Imu", "ros1msg", b"")
        channel = writer.register_channel("/imu", "ros1", schema)
        for t_ns in received_ns:
            writer.add_message(channel, t_ns, encode_imu(ros1, 0, (0.0, 0.0, 9.8), np.zeros(3)), t_ns)
        writer.finish()
    with pytest.raises(RecordingError, match=says):
        load_bag(tmp_path / "a.mcap")


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ({"flat": [0, np.inf]}, "give flat as"),
        ({"flat_samples": np.inf}, "give flat as"),
        ({"flat": [1j, 3]}, "give flat as"),
        ({"t": np.where(np.arange(N) == 0, -1.7e308, np.arange(N) + 1.7e308)}, "time does not increase|t has steps of"),
        ({"t": np.array([-1.7e308, 1.7e308])}, "t has steps of"),
        ({"acc": np.full((N, 3), np.longdouble("1e400"))}, "lacks a number in every sample"),
    ],
)
def test_an_archive_with_what_no_number_holds(tmp_path, more, says):
    n = len(more.get("t", TIMES))
    np.savez(tmp_path / "a.npz", **{"t": TIMES, "acc": AT_REST[:n, :3], "gyr": AT_REST[:n, 3:]} | more)
    with pytest.raises(RecordingError, match=says):
        mpucal.load(tmp_path / "a.npz")


SIGNALLING = np.where(np.arange(N) == 7, 0x7F800001, 0x3F800000).astype(np.uint32).view(np.float32)


def test_a_nan_that_signals_is_a_nan(tmp_path):
    """A float32 of which NumPy warns where it becomes a float64."""
    acc = np.tile(SIGNALLING[:, None], (1, 3))
    np.savez(tmp_path / "a.npz", t=TIMES, acc=acc, gyr=AT_REST[:, 3:])
    assert len(mpucal.load(tmp_path / "a.npz")) == N - 1
    (samples,) = open_rows(tmp_path / "a.npz").runs
    assert np.flatnonzero(np.isnan(samples.acc[:, 0])).tolist() == [7]
    table().assign(**{"ax [m/s^2]": SIGNALLING, "temperature_c": SIGNALLING}).to_parquet(tmp_path / "a.parquet")
    assert len(mpucal.load(tmp_path / "a.parquet", units="gyr=rad/s")) == N - 1


def test_a_time_of_day_beyond_any_number_is_left_out(tmp_path, walk):
    (tmp_path / "meta").mkdir()
    (tmp_path / "meta" / "time.csv").write_text('"event","experiment time","system time"\n"START",0,9e999999\n')
    for name, values in (("Accelerometer", walk.acc), ("Gyroscope", walk.gyr)):
        made = pd.DataFrame(np.column_stack([walk.t, values])[:1000], columns=["Time (s)", "x", "y", "z"])
        made.to_csv(tmp_path / f"{name}.csv", index=False)
    assert mpucal.load(tmp_path).utc_ns is None


def test_a_message_of_ros_holds_no_time_after_2038():
    samples = Samples(TIMES, AT_REST[:, :3], AT_REST[:, 3:], TIMES, *3 * [TIMES < 0])
    with pytest.raises(
        RecordingError, match=r"a message of ROS can only hold times from 0 to 2\^31 s: write a \.csv or \.npz"
    ):
        encode_messages(samples, np.full((2, 3), np.nan), utc_ns=2_200_000_000 * 10**9)


@pytest.fixture(scope="module")
def capture():
    """The head of a capture, some of its accesses, and how many samples these hold."""
    written = read_capture(FIXTURE)
    accesses = [record for record in written.records if not isinstance(record, SessionEvent)][:400]
    return written.meta, accesses, len(decode(accesses))


FORGOTTEN = [
    ({}, None),
    ({"first": "x", "last": 1}, None),
    ({"first": float("1e400"), "last": 1}, None),
    ({"first": 10, "last": 2}, 0),
    ({"first": 10**22, "last": 10**30}, 0),
    ({"first": -5, "last": 100}, 100),
    ({"first": 0, "last": 10**30}, 10**30),
]


@pytest.mark.parametrize(("data", "lost"), FORGOTTEN)
def test_samples_that_are_to_be_forgotten_and_are_not_there(capture, tmp_path, data, lost):
    meta, accesses, n = capture
    with CaptureWriter(tmp_path / "a.mcap") as writer:
        writer.start(meta)
        for access in accesses:
            writer.transaction(access)
        writer.event(FORGET, accesses[-1].t_ns, data)
    if lost is None:
        with pytest.raises(CaptureError, match="an event forget without a whole number"):
            mpucal.load(tmp_path / "a.mcap")
        with pytest.raises(CaptureError, match="an event forget without a whole number"):
            open_rows(tmp_path / "a.mcap")
    elif lost > n:
        with pytest.raises(RecordingError, match="holds 0 usable samples"):
            mpucal.load(tmp_path / "a.mcap")
    else:
        assert len(mpucal.load(tmp_path / "a.mcap")) == n - lost
