"""What loggers, apps and sketches do besides naming columns: signs, dates, units below the header, lines of names."""

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
    assert "accelerations with the other sign, as iOS has them" in read.taken
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


def test_a_date_of_no_zone_is_no_time_of_day(walk, walk_ns, assert_same, tmp_path):
    made(walk, pd.to_datetime(walk_ns)).to_csv(tmp_path / "walk.csv", index=False)
    read = load(tmp_path / "walk.csv")
    assert_same(read, walk, 1e-9, 1e-9, 1e-6)
    assert read.utc_ns is None


def test_samples_that_are_written_again_are_left_out(walk, walk_ns, assert_same, tmp_path):
    table = made(walk, walk_ns)
    table.loc[table.index.repeat(np.where(np.arange(len(table)) % 7, 1, 2))].to_csv(tmp_path / "walk.csv", index=False)
    read = load(tmp_path / "walk.csv")
    assert_same(read, walk)
    assert f"{-(-len(walk) // 7)} samples that are written again were left out" in read.taken
    table.loc[10, "time"] = table.loc[9, "time"]
    table.to_csv(tmp_path / "walk.csv", index=False)
    with pytest.raises(RecordingError, match="time does not increase at sample 10"):
        load(tmp_path / "walk.csv")


def test_units_in_the_line_below_the_header(walk, assert_same, tmp_path):
    table = made(walk, walk.t * 1000, [f"S_{name}_CAL" for name in NAMES])
    units = pd.DataFrame([["ms", *["m/(s^2)"] * 3, *["rad/s"] * 3]], columns=table.columns)
    path = tmp_path / "walk.csv"
    path.write_text('"sep=\t"\n' + pd.concat([units, table]).to_csv(index=False, sep="\t"))
    read = load(path, Hints(columns=parse_columns("t=time," + ",".join(f"{n}=S_{n}_CAL" for n in NAMES))))
    assert_same(read, walk, 1e-9, 1e-9, 1e-9)
    assert "times in ms, accelerations in m/s^2 and rates in rad/s" in read.taken


@pytest.mark.parametrize("said", ["t=when,ax=AccX(g),ay=AccY(g),az=AccZ,gx=wx,gy=wy,gz=wz", "-,t,ax,ay,az,gx,gy,gz"])
def test_named_columns_beside_columns_of_words(said, walk, assert_same, tmp_path):
    table = made(walk, walk.t, ["AccX(g)", "AccY(g)", "AccZ(g)", "wx", "wy", "wz"]).rename(columns={"time": "when"})
    table.iloc[:, 1:4] /= G
    table.insert(0, "device", "WT901")
    table.to_csv(tmp_path / "walk.csv", index=False)
    assert_same(load(tmp_path / "walk.csv", Hints(columns=parse_columns(said))), walk, 1e-9, 1e-9, 1e-9)


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
    """And are gaps where the samples have no times of their own."""
    line = LINES[".txt"] if timed else LINES[".txt"].partition(",t:")[0]
    lines = [line.format(*a, *w, t) for a, w, t in zip(walk.acc, walk.gyr, walk.t, strict=True)]
    # below a line that measures nothing; one has not a number, one is torn
    lines[60], lines[80] = line.format("nan", *range(6)), lines[80][:30]
    (tmp_path / "walk.txt").write_text("\n".join([*lines[:40], "Temperature: 25.1 degC", *lines[40:]]))
    found = load(tmp_path / "walk.txt", NO_HINTS if timed else Hints(rate_hz=walk.rate_hz))
    assert "2 lines that lack a number were left out" in found.taken
    assert len(found) == len(walk) - 2
    assert np.flatnonzero(found.gap).tolist() == ([] if timed else [60, 79])


@pytest.mark.parametrize("text", ["a" * 60_000, "a_" * 30_000, "ab " * 20_000, "ax:" * 20_000, "ax:1 " * 12_000])
def test_a_long_line_of_letters_is_no_table(text, tmp_path):
    """At once: the time that a pattern takes must not grow with the square of a line's length."""
    (tmp_path / "walk.txt").write_text(text)
    with pytest.raises(RecordingError, match="names no columns of an accelerometer"):
        load(tmp_path / "walk.txt")


def test_the_serial_monitors_times_before_the_lines_of_a_table(walk, assert_same, tmp_path):
    lines = made(walk, walk.t).to_csv(index=False).splitlines()
    (tmp_path / "walk.csv").write_text("\n".join(f"12:34:56.789 -> {line}" for line in lines))
    assert_same(load(tmp_path / "walk.csv"), walk, 1e-9, 1e-9, 1e-9)


def test_a_rate_that_does_not_fit_is_refused(walk, tmp_path):
    path, rate = tmp_path / "walk.csv", 1 / np.median(np.diff(walk.t))
    made(walk).to_csv(path, index=False)
    assert len(load(path, Hints(rate_hz=rate))) == len(walk)
    for units in ({}, parse_units("acc=m/s^2")):
        with pytest.raises(RecordingError, match=r"gravity turns 0\.\d+ times as fast .* of the times --rate HZ"):
            load(path, Hints(rate_hz=rate / 4, units=units))


def test_rates_of_the_other_sign_are_said(walk, tmp_path):
    table = made(walk, walk.t)
    table[["gx", "gy", "gz"]] *= -1
    table.to_csv(tmp_path / "walk.csv", index=False)
    assert "gravity turns the other way" in load(tmp_path / "walk.csv").taken


def test_a_size_that_is_no_gravity_says_no_unit(walk, tmp_path):
    table = made(walk, walk.t)
    table[["ax", "ay", "az"]] *= 512 / G
    table[["ax", "ay", "az"]] = table[["ax", "ay", "az"]].round()
    table.to_csv(tmp_path / "walk.csv", index=False)
    with pytest.raises(RecordingError, match="nothing says in which unit acc is"):
        load(tmp_path / "walk.csv", Hints(units=parse_units("gyr=rad/s,t=s")))


def test_times_that_are_not_known_as_such_are_named(walk, tmp_path):
    made(walk, walk.t).rename(columns={"time": "SampleTimeFine"}).to_csv(tmp_path / "walk.csv", index=False)
    with pytest.raises(RecordingError, match="no times that are known as such; its columns are SampleTimeFine, ax"):
        load(tmp_path / "walk.csv")
