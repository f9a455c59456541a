"""Tests for habits of loggers, apps and sketches: signs, dates, units below the header, a name at each number."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from mpucal.data import STANDARD_GRAVITY_MPS2 as G
from mpucal.errors import RecordingError
from mpucal.files import load
from mpucal.files.hints import NO_HINTS, Hints, parse_columns, parse_units

NAMES = ["ax", "ay", "az", "gx", "gy", "gz"]


def made(walk, times=None, names=NAMES):
    table = pd.DataFrame(np.column_stack([walk.acc, walk.gyr]), columns=names)
    if times is not None:
        table.insert(0, "time", times)
    return table


def phone(folder, walk, walk_ns, metadata):
    for name, values in (("TotalAcceleration", -walk.acc), ("Gyroscope", walk.gyr)):
        table = pd.DataFrame(values[:, ::-1], columns=["z", "y", "x"])
        table.insert(0, "time", walk_ns)
        table.to_csv(folder / f"{name}.csv", index=False)
    pd.DataFrame([metadata]).to_csv(folder / "Metadata.csv", index=False)
    return load(folder)


def test_sensor_logger_says_by_its_metadata_which_sign_it_has(walk, walk_ns, assert_same, tmp_path):
    read = phone(tmp_path, walk, walk_ns, {"version": 3, "device name": "a, b", "platform": "ios"})
    assert_same(read, walk)
    assert "accelerations have the opposite sign, as on iOS" in read.taken
    for others in ({"platform": "android"}, {"platform": "ios", "standardisation": "true"}):
        np.testing.assert_array_equal(phone(tmp_path, walk, walk_ns, others).acc, -walk.acc)


@pytest.mark.parametrize("starts", [1, 2])
def test_phyphox_says_the_time_of_day_in_a_file_beside_its_tables(starts, walk, walk_ns, assert_same, tmp_path):
    for name, of, values, unit in (
        ("Accelerometer", "Acceleration", walk.acc, "m/s^2"),
        ("Gyroscope", "Gyroscope", walk.gyr, "rad/s"),
    ):
        table = pd.DataFrame(values, columns=[f"{of} {axis} ({unit})" for axis in "xyz"])
        table.insert(0, "Time (s)", walk.t + 0.25)
        table.to_csv(tmp_path / f"{name}.csv", index=False)
    (tmp_path / "meta").mkdir()
    events = [["START", 0.0, 1.7e9, "x"], ["PAUSE", 30.0, 1.7e9 + 30, "x"]] * starts
    columns = ["event", "experiment time", "system time", "system time text"]
    pd.DataFrame(events, columns=columns).to_csv(tmp_path / "meta" / "time.csv", index=False)
    read = load(tmp_path)
    assert_same(read, walk, t=1e-9)
    assert read.utc_ns == (1_700_000_000_250_000_000 if starts == 1 else None)
    assert ("paused 1 times" in read.taken) == (starts == 2)


def test_tables_that_are_called_by_a_word_of_their_names(walk, walk_ns, assert_same, tmp_path):
    for name, values, unit in (("Accelerometer", walk.acc / G, "g"), ("Gyroscope", np.degrees(walk.gyr), "deg/s")):
        table = pd.DataFrame(values, columns=[f"{axis}-axis ({unit})" for axis in "xyz"])
        table.insert(0, "epoch (ms)", walk_ns / 1e6)
        table.insert(1, "elapsed (s)", walk.t + 0.5 * (name == "Gyroscope"))
        table.to_csv(tmp_path / f"MetaWear_2024_C8_{name}_100.000Hz_1.4.4.csv", index=False)
    made(walk).to_csv(tmp_path / "Linear Accelerometer.csv", index=False)
    assert_same(load(tmp_path), walk, 1e-9, 1e-9, 1e-6)


def test_a_date_of_no_zone_is_no_time_of_day(walk, walk_ns, assert_same, load_table):
    read = load_table(made(walk, pd.to_datetime(walk_ns)))
    assert_same(read, walk, 1e-9, 1e-9, 1e-6)
    assert read.utc_ns is None


def test_samples_that_are_written_again_are_left_out(walk, walk_ns, assert_same, load_table):
    table = made(walk, walk_ns)
    read = load_table(table.loc[table.index.repeat(np.where(np.arange(len(table)) % 7, 1, 2))])
    assert_same(read, walk)
    assert f"{-(-len(walk) // 7)} repeated samples were left out" in read.taken
    table.loc[10, "time"] = table.loc[9, "time"]
    again = load_table(table)
    assert_same(again, walk, t=1e-4)
    assert "arrival stamps" in again.taken


def test_units_in_the_line_below_the_header(walk, assert_same, tmp_path):
    table = made(walk, walk.t * 1000, [f"S_{name}_CAL" for name in NAMES])
    units = pd.DataFrame([["ms", *["m/(s^2)"] * 3, *["rad/s"] * 3]], columns=table.columns)
    path = tmp_path / "walk.csv"
    path.write_text('"sep=\t"\n' + pd.concat([units, table]).to_csv(index=False, sep="\t"))
    read = load(path, Hints(columns=parse_columns("t=time," + ",".join(f"{n}=S_{n}_CAL" for n in NAMES))))
    assert_same(read, walk, 1e-9, 1e-9, 1e-9)
    assert "times in ms, accelerations in m/s^2 and rates in rad/s" in read.taken


@pytest.mark.parametrize("said", ["t=when,ax=AccX(g),ay=AccY(g),az=AccZ,gx=wx,gy=wy,gz=wz", "-,t,ax,ay,az,gx,gy,gz"])
def test_named_columns_beside_columns_of_words(said, walk, assert_same, load_table):
    table = made(walk, walk.t, ["AccX(g)", "AccY(g)", "AccZ(g)", "wx", "wy", "wz"]).rename(columns={"time": "when"})
    table.iloc[:, 1:4] /= G
    table.insert(0, "device", "WT901")
    assert_same(load_table(table, Hints(columns=parse_columns(said))), walk, 1e-9, 1e-9, 1e-9)


LINES = {
    ".txt": "AccelX:{},AccelY:{},AccelZ:{}, GyroX:{},GyroY:{},GyroZ:{},t:{}",
    ".log": "AcX = {} | AcY = {} | AcZ = {} | Tmp = 25.31 | GyX = {} | GyY = {} | GyZ = {} | t = {}",
    ".csv": "12:34:56.789 -> acc x: {} m/s^2 acc y: {} acc z: {} m/s^2 gyro x: {} rad/s gyro y: {} gyro z: {} t: {}",
}


@pytest.mark.parametrize("ending", LINES)
def test_lines_that_name_each_number(ending, walk, assert_same, tmp_path):
    path = tmp_path / f"walk{ending}"
    lines = [LINES[ending].format(*a, *w, t) for a, w, t in zip(walk.acc, walk.gyr, walk.t, strict=True)]
    path.write_text("\n".join(["MPU6050 Found!", *lines[:50], "Temperature: 25.1 degC", *lines[50:], lines[0][:30]]))
    assert_same(load(path), walk, 1e-9, 1e-9, 1e-9)


@pytest.mark.parametrize("timed", [True, False])
def test_lines_that_lack_a_number_are_said(timed, walk, tmp_path):
    """Count the samples left out, whose time passes all the same; where several in a row are missing, is a gap."""
    line = LINES[".txt"] if timed else LINES[".txt"].partition(",t:")[0]
    lines = [line.format(*a, *w, t) for a, w, t in zip(walk.acc, walk.gyr, walk.t, strict=True)]
    # below a line that measures nothing; one has not a number, one is torn
    lines[60], lines[80:83] = line.format("nan", *range(6)), [torn[:30] for torn in lines[80:83]]
    (tmp_path / "walk.txt").write_text("\n".join([*lines[:40], "Temperature: 25.1 degC", *lines[40:]]))
    found = load(tmp_path / "walk.txt", NO_HINTS if timed else Hints(rate_hz=walk.rate_hz))
    assert f"4 {'lines' if timed else 'samples'} that lack a number were left out" in found.taken
    assert len(found) == len(walk) - 4
    assert np.flatnonzero(found.gap).tolist() == [79]
    np.testing.assert_allclose(found.t - found.t[0], np.delete(walk.t - walk.t[0], [60, 80, 81, 82]), atol=1e-9)


@pytest.mark.parametrize("text", ["a" * 30_000, "a_" * 15_000, "ab " * 10_000, "ax:" * 10_000, "ax:1 " * 6_000])
def test_a_long_line_of_letters_is_no_table(text, tmp_path):
    """Refuse it at once: the time that a pattern takes must not grow with the square of a line's length."""
    (tmp_path / "walk.txt").write_text(text)
    with pytest.raises(RecordingError, match="names no columns of an accelerometer"):
        load(tmp_path / "walk.txt")


def test_the_serial_monitors_times_before_the_lines_of_a_table(walk, assert_same, tmp_path):
    lines = made(walk, walk.t).to_csv(index=False).splitlines()
    (tmp_path / "walk.csv").write_text("\n".join(f"12:34:56.789 -> {line}" for line in lines))
    assert_same(load(tmp_path / "walk.csv"), walk, 1e-9, 1e-9, 1e-9)


def test_a_rate_that_does_not_fit_is_refused(walk, load_table):
    rate = 1 / np.median(np.diff(walk.t))
    assert len(load_table(made(walk), Hints(rate_hz=rate))) == len(walk)
    for units in ({}, parse_units("acc=m/s^2")):
        with pytest.raises(RecordingError, match=r"gravity turns 0\.\d+ times as fast .* for the times --rate \d"):
            load_table(made(walk), Hints(rate_hz=rate / 4, units=units))


def test_rates_of_the_other_sign_are_said(walk, load_table):
    assert "gravity turns the other way" in load_table(made(replace(walk, gyr=-walk.gyr), walk.t)).taken


def test_a_size_that_is_no_gravity_says_no_unit(walk, load_table):
    table = made(replace(walk, acc=np.round(walk.acc * 512 / G)), walk.t)
    with pytest.raises(RecordingError, match="the unit of acc is not known"):
        load_table(table, Hints(units=parse_units("gyr=rad/s,t=s")))


def test_times_that_are_not_known_by_their_name_are_known_by_how_gravity_turns(walk, assert_same, load_table):
    table = made(walk, walk.t).rename(columns={"time": "Ticks"})
    table.insert(0, "Line", np.arange(len(walk)))
    read = load_table(table)
    assert_same(read, walk, 1e-9, 1e-9, 1e-9)
    assert "its columns were guessed from how gravity turns: --columns -,t,ax,ay,az,gx,gy,gz" in read.taken


def sensor_loggers_one_table(walk, sign, in_g, uncalibrated=True):
    """Return Sensor Logger's table: columns in the order z, y, x, and `accelerometer` without gravity."""
    still = np.random.default_rng(0).normal(0.0, 0.05, (len(walk), 3))
    of = {"accelerometer": still, "totalAcceleration": sign * walk.acc, "gyroscope": walk.gyr}
    if uncalibrated:
        of["accelerometerUncalibrated"] = sign * walk.acc / (G if in_g else 1.0)
    columns = {f"{name}_{axis}": values[:, "xyz".index(axis)] for name, values in of.items() for axis in "zyx"}
    return pd.DataFrame({"seconds_elapsed": walk.t, **columns})


@pytest.mark.parametrize("ios", [False, True])
def test_sensor_loggers_one_table(ios, walk, assert_same, load_table):
    read = load_table(sensor_loggers_one_table(walk, -1 if ios else 1, ios))
    assert_same(read, walk, 1e-9, 1e-9, 1e-9)
    assert ("the opposite sign, as on iOS" in read.taken) == ios


def test_a_table_that_does_not_say_whose_sign_it_has_is_said(walk, load_table):
    read = load_table(sensor_loggers_one_table(walk, 1, False, uncalibrated=False))
    assert "if an iPhone recorded them, it is the opposite one" in read.taken


def pair(folder, walk, times, order=(0, 1, 2, 3)):
    """Two tables without names, as data sets have them: time, x, y, z."""
    for name, values in (("acce.txt", walk.acc), ("gyro.txt", walk.gyr)):
        columns = [times, *values.T]
        table = pd.DataFrame({k: columns[place] for k, place in enumerate(order)})
        table.to_csv(folder / name, sep=" ", header=False, index=False)


def test_two_tables_without_names(walk, walk_ns, assert_same, tmp_path):
    pair(tmp_path, walk, walk_ns)
    read = load(tmp_path)
    assert_same(read, walk)
    assert "from acce.txt and gyro.txt" in read.taken


@pytest.mark.parametrize("said", ["ax,ay,az,t", "t=4,ax=1,ay=2,az=3,gx=1,gy=2,gz=3"])
def test_two_tables_without_names_whose_columns_are_said(said, walk, walk_ns, assert_same, tmp_path):
    pair(tmp_path, walk, walk_ns, (1, 2, 3, 0))
    with pytest.raises(RecordingError):
        load(tmp_path)
    assert_same(load(tmp_path, Hints(columns=parse_columns(said))), walk)


@pytest.mark.parametrize("odd", ["", "nan", "inf"])
def test_lines_that_lack_a_number_are_left_out_and_said(odd, walk, load_table, tmp_path):
    rows = made(walk, walk.t).astype(str)
    rows.iloc[100, 2] = odd
    read = load_table(rows)
    np.testing.assert_allclose(read.acc, np.delete(walk.acc, 100, axis=0), atol=1e-9)
    assert "1 samples that lack a number were left out" in read.taken
    (tmp_path / "b.csv").write_text(rows.drop(columns="time").to_csv(index=False) + "1.0,2.0")
    read = load(tmp_path / "b.csv", Hints(rate_hz=100.0))
    assert read.t[100] - read.t[99] == pytest.approx(0.02), "its time passed all the same"


def test_a_line_that_was_torn_at_the_end_is_left_out_and_said(walk, assert_same, tmp_path):
    text = made(walk, walk.t).to_csv(index=False)
    (tmp_path / "a.csv").write_text(text + "99.0,1.0,2.0")
    read = load(tmp_path / "a.csv")
    assert_same(read, walk, 1e-9, 1e-9, 1e-9)
    assert "1 lines that lack a number" in read.taken


def test_seconds_and_nanoseconds_in_columns_of_their_own(walk, walk_ns, assert_same, load_table):
    table = made(walk, walk_ns // 10**9).rename(columns={"time": "header.stamp.sec"})
    table.insert(1, "header.stamp.nanosec", walk_ns % 10**9)
    read = load_table(table)
    assert_same(read, walk, 1e-9, 1e-9, 1e-9)
    assert read.utc_ns == walk_ns[0]


@pytest.mark.parametrize(("encoding", "end"), [("utf-16", "\n"), ("utf-8-sig", "\r\n"), ("utf-8", "\r")])
def test_text_as_other_systems_write_it(encoding, end, walk, assert_same, load_table):
    assert_same(load_table(made(walk, walk.t), encoding=encoding, lineterminator=end), walk, 1e-9, 1e-9, 1e-9)


def test_a_line_for_each_sensor(walk, tmp_path):
    """Read what Adafruit's basic_readings prints."""
    lines = "Acceleration X: {:.4f}, Y: {:.4f}, Z: {:.4f} m/s^2\r\nRotation X: {:.5f}, Y: {:.5f}, Z: {:.5f} rad/s\r\n"
    text = "".join(
        lines.format(*a, *w) + "Temperature: 25.00 degC\r\n\r\n" for a, w in zip(walk.acc, walk.gyr, strict=True)
    )
    (tmp_path / "a.txt").write_text("MPU6050 Found!\r\n" + text)
    read = load(tmp_path / "a.txt", Hints(rate_hz=100.0))
    np.testing.assert_allclose(read.acc, walk.acc, atol=1e-4)
    np.testing.assert_allclose(read.gyr, walk.gyr, atol=1e-5)
