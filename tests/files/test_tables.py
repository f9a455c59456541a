"""Tables in the dialects of loggers, data sets and sketches, written by pandas, and read."""

import zipfile

import numpy as np
import pandas as pd
import pytest

import mpucal
from mpucal.data import STANDARD_GRAVITY_MPS2 as G
from mpucal.errors import RecordingError, UsageError
from mpucal.files import load
from mpucal.files.hints import Hints, parse_columns, parse_units
from mpucal.files.tables.names import parse_column_name
from mpucal.files.tables.units import find_unit, rate_factor

COUNTS_A, COUNTS_G = 32768 / (4 * G), 32750 / np.radians(500)


def frame(names, *columns):
    table = np.column_stack(columns)
    return pd.DataFrame({name: table[:, i] for i, name in enumerate(names.split("|"))})


def timed(name, times, names, *columns):
    made = frame(names, *columns)
    made.insert(0, name, times)
    return made


DIALECTS = {
    "EuRoC": lambda w, ns: timed(
        "#timestamp [ns]",
        ns,
        "w_RS_S_x [rad s^-1]|w_RS_S_y [rad s^-1]|w_RS_S_z [rad s^-1]"
        "|a_RS_S_x [m s^-2]|a_RS_S_y [m s^-2]|a_RS_S_z [m s^-2]",
        w.gyr,
        w.acc,
    ),
    "Kalibr": lambda w, ns: timed("timestamp", ns, "omega_x|omega_y|omega_z|alpha_x|alpha_y|alpha_z", w.gyr, w.acc),
    "rostopic echo -p": lambda w, ns: timed(
        "%time",
        ns + 1000,
        "field.header.stamp|field.orientation.x|field.angular_velocity.x|field.angular_velocity.y"
        "|field.angular_velocity.z|field.linear_acceleration.x|field.linear_acceleration.y|field.linear_acceleration.z",
        w.t * 0,
        w.t * 0,
        w.gyr,
        w.acc,
    ).assign(**{"field.header.stamp": ns}),
    "ulog2csv": lambda w, ns: timed(
        "timestamp",
        (ns - ns[0]) // 1000,
        "gyro_rad[0]|gyro_rad[1]|gyro_rad[2]|gyro_integral_dt"
        "|accelerometer_m_s2[0]|accelerometer_m_s2[1]|accelerometer_m_s2[2]",
        w.gyr,
        w.t,
        w.acc,
    ),
    "AndroSensor": lambda w, ns: frame(
        "ACCELEROMETER X (m/s²)|ACCELEROMETER Y (m/s²)|ACCELEROMETER Z (m/s²)|GRAVITY X (m/s²)"
        "|LINEAR ACCELERATION X (m/s²)|LINEAR ACCELERATION Y (m/s²)|LINEAR ACCELERATION Z (m/s²)"
        "|GYROSCOPE X (rad/s)|GYROSCOPE Y (rad/s)|GYROSCOPE Z (rad/s)|Time since start in ms ",
        w.acc,
        w.t,
        w.acc * 0,
        w.gyr,
        w.t * 1000,
    ),
    "Physics Toolbox": lambda w, ns: frame("time|gFx|gFy|gFz|wx|wy|wz", w.t, w.acc / G, w.gyr),
    "SensorLog": lambda w, ns: frame(
        "accelerometerTimestamp_sinceReboot(s)|accelerometerAccelerationX(G)|accelerometerAccelerationY(G)"
        "|accelerometerAccelerationZ(G)|gyroTimestamp_sinceReboot(s)|gyroRotationX(rad/s)|gyroRotationY(rad/s)"
        "|gyroRotationZ(rad/s)|motionUserAccelerationX(G)|motionUserAccelerationY(G)|motionUserAccelerationZ(G)",
        w.t,
        -w.acc / G,
        w.t,
        w.gyr,
        w.acc * 0,
    ),
    "a sketch in g and deg/s": lambda w, ns: frame(
        "millis|AccX|AccY|AccZ|GyroX|GyroY|GyroZ", w.t * 1000, w.acc / G, np.degrees(w.gyr)
    ),
    "units in names": lambda w, ns: frame(
        "time_us|acc_x_mg|acc_y_mg|acc_z_mg|gyro_x_dps|gyro_y_dps|gyro_z_dps",
        w.t * 1e6,
        w.acc / G * 1000,
        np.degrees(w.gyr),
    ),
    "MARS logger": lambda w, ns: timed(
        "Timestamp[nanosec]", ns, " gx[rad/s]| gy[rad/s]| gz[rad/s]| ax[m/s^2]| ay[m/s^2]| az[m/s^2]", w.gyr, w.acc
    ),
    "Physics Toolbox with linear accelerations": lambda w, ns: frame(
        "time|gFx|gFy|gFz|ax|ay|az|wx|wy|wz",
        w.t,
        w.acc / G,
        w.gyr * 0.3,
        w.gyr,
    ),
    "WitMotion": lambda w, ns: timed(
        "Time(s)",
        pd.to_datetime(ns).strftime("%H:%M:%S.%f"),
        "ax(g)|ay(g)|az(g)|wx(deg/s)|wy(deg/s)|wz(deg/s)|T(°)",
        w.acc / G,
        np.degrees(w.gyr),
        w.t * 0 + 25,
    ),
    "axes first": lambda w, ns: frame("t|xacc|yacc|zacc|xgyro|ygyro|zgyro", w.t, w.acc, w.gyr),
}


SEPARATORS = {",": "", ";": "separated by semicolons", "\t": "by tabs"}
# each dialect with its commas; the others where there are blanks in names, brackets, dates
SEPARATED = [(d, s) for d in DIALECTS for s in SEPARATORS if s == "," or d in ("EuRoC", "AndroSensor", "WitMotion")]


@pytest.mark.parametrize(("dialect", "separator"), SEPARATED)
def test_dialects_give_the_samples_that_were_written(dialect, separator, walk, walk_ns, assert_same, load_table):
    read = load_table(DIALECTS[dialect](walk, walk_ns), sep=separator)
    assert_same(read, walk, 1e-9, 1e-9, 1e-6 if dialect in ("ulog2csv", "WitMotion") else 1e-9)
    assert read.taken.startswith("walk.csv was read with times in ")
    assert SEPARATORS[separator] in read.taken


@pytest.mark.parametrize("ending", [".tsv", ".log"])
def test_other_endings(ending, walk, walk_ns, assert_same, tmp_path):
    DIALECTS["axes first"](walk, walk_ns).to_csv(tmp_path / f"walk{ending}", sep="\t", index=False)
    assert_same(load(tmp_path / f"walk{ending}"), walk, 1e-9, 1e-9, 1e-9)


@pytest.mark.parametrize("written", [{"sep": ";", "decimal": ","}, {"encoding": "cp1252"}])
def test_decimal_commas_and_an_encoding_of_windows(written, walk, walk_ns, assert_same, load_table):
    assert_same(load_table(DIALECTS["AndroSensor"](walk, walk_ns), **written), walk, 1e-9, 1e-9, 1e-9)


def test_lines_before_the_header(walk, walk_ns, assert_same, tmp_path):
    table = DIALECTS["a sketch in g and deg/s"](walk, walk_ns).to_csv(index=False)
    (tmp_path / "walk.csv").write_text(f"sep=,\nMPU6050 found!\n\n{table}")
    assert_same(load(tmp_path / "walk.csv"), walk, 1e-9, 1e-9, 1e-9)


def test_dates_are_times(walk, walk_ns, assert_same, load_table):
    read = load_table(DIALECTS["axes first"](walk, walk_ns).assign(t=pd.to_datetime(walk_ns, utc=True)))
    assert_same(read, walk, 1e-9, 1e-9, 1e-6)
    assert abs(read.utc_ns - walk_ns[0]) < 1000


def test_ios_counts_gravity_the_other_way(walk, walk_ns, load_table):
    assert "the opposite sign, as on iOS" in load_table(DIALECTS["SensorLog"](walk, walk_ns)).taken


@pytest.mark.parametrize(
    ("names", "scale", "units", "says"),
    [
        (
            "time [s]|ax [m s^-2]|ay [m s^-2]|az [m s^-2]|gx|gy|gz",
            (1, 1 / G, 1),
            "acc=g",
            r"acc is said to be in m/s\^2, but .* suggests g",
        ),
        (
            "time [s]|ax|ay|az|omega_x|omega_y|omega_z",
            (1, 1, np.degrees(1)),
            "gyr=deg/s",
            "gyr is said to be in rad/s, but the turning of gravity suggests deg/s",
        ),
        ("time [s]|ax|ay|az|gx|gy|gz", (1000, 1, 1), "t=ms", r"t is said to be in s, but the step of .* suggests ms"),
    ],
)
def test_doubtful_units_are_refused_and_can_be_said(names, scale, units, says, walk, assert_same, load_table):
    table = frame(names, walk.t * scale[0], walk.acc * scale[1], walk.gyr * scale[2])
    with pytest.raises(RecordingError, match=says):
        load_table(table)
    assert_same(load_table(table, Hints(units=parse_units(units))), walk, 1e-9, 1e-9, 1e-9)


def test_rates_of_a_sensor_at_rest_need_a_unit(load_table):
    rng = np.random.default_rng(3)
    acc, gyr = rng.normal([0, 0, G], 0.02, (500, 3)), rng.normal(0, 0.3, (500, 3))
    table = timed("time", np.arange(500) * 5, "accX|accY|accZ|gyroX|gyroY|gyroZ", acc, gyr)
    read = load_table(table)
    assert np.isnan(read.gyr).all()
    assert "rates left out, because nothing shows their unit (--units gyr=UNIT)" in read.taken
    assert np.isfinite(load_table(table, Hints(units=parse_units("gyr=deg/s"))).gyr).all()


def test_linear_acceleration_is_none_that_can_be_calibrated(walk, walk_ns, load_table):
    made = DIALECTS["Kalibr"](walk, walk_ns)
    made.iloc[:, 4:] = np.random.default_rng(1).normal(0, 0.3, (len(walk), 3))
    with pytest.raises(RecordingError, match="gravity is not in it"):
        load_table(made)


def counts(walk):
    return np.rint(np.column_stack([walk.acc * COUNTS_A, walk.gyr * COUNTS_G])).astype(int)


def even(walk):
    """The walk at a steady rate, as a sketch without times has it."""
    rate = 1 / np.median(np.diff(walk.t))
    return type(walk).from_arrays(np.arange(len(walk)) / rate, walk.acc, walk.gyr), rate


def test_counts_need_their_ranges_and_a_rate(walk, assert_same, load_table):
    table, (steady, rate) = frame("ax|ay|az|gx|gy|gz", counts(walk)), even(walk)
    alone = load_table(table)
    assert "a rate of 100 Hz, accelerations in counts of ±4 g (by |a|) and without rates; this sample" in alone.taken
    np.testing.assert_allclose(alone.acc, walk.acc, atol=0.5 / COUNTS_A)
    assert np.isnan(alone.gyr).all()
    seen = load_table(table, Hints(rate_hz=rate))
    assert "counts of ±4 g (by |a|) and rates in counts of ±500 deg/s (by how gravity turns)" in seen.taken
    assert_same(seen, steady, 0.5 / COUNTS_A, 0.5 / COUNTS_G)
    read = load_table(table, Hints(rate_hz=rate, accel_range_g=4, gyro_range_dps=500))
    assert_same(read, steady, 0.5 / COUNTS_A, 0.5 / COUNTS_G)
    assert (read.sensor.accel_range_g, read.sensor.gyro_range_dps) == (4, 500)
    with pytest.raises(RecordingError, match="which is not gravity"):
        load_table(table, Hints(rate_hz=rate, accel_range_g=2, gyro_range_dps=500))
    with pytest.raises(RecordingError, match=r"gravity turns .* as fast"):
        load_table(table, Hints(rate_hz=rate, accel_range_g=4, gyro_range_dps=2000))


def test_counts_at_the_end_of_the_range_are_clipped(walk, load_table):
    made = counts(walk)
    made[7, 1], made[9, 5] = 32767, -32768
    read = load_table(
        frame("ax|ay|az|gx|gy|gz", made), Hints(rate_hz=even(walk)[1], accel_range_g=4, gyro_range_dps=500)
    )
    assert np.flatnonzero(read.acc_clipped).tolist() == [7]
    assert np.flatnonzero(read.gyr_clipped).tolist() == [9]


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ("a|b|c|d|e|f|g", "t,ax,ay,az,gx,gy,gz"),
        ("a|b|c|d|e|f|g", "t=a,ax=b,ay=c,az=d,gx=e,gy=f,gz=g"),
        ("a|b|c|d|e|f|g", "gx=5,gy=6,gz=7,t=1,ax=2,ay=3,az=4"),
        ("", "t,ax,ay,az,gx,gy,gz"),
    ],
)
def test_columns_are_named(names, said, walk, assert_same, load_table):
    table = frame(names or "0|1|2|3|4|5|6", walk.t * 1000, walk.acc, walk.gyr)
    seen = load_table(table, header=bool(names))
    assert "how gravity turns: --columns t,ax,ay,az,gx,gy,gz" in seen.taken
    assert_same(seen, walk, 1e-9, 1e-9, 1e-9)
    read = load_table(table, Hints(columns=parse_columns(said)), header=bool(names))
    assert_same(read, walk, 1e-9, 1e-9, 1e-9)


@pytest.mark.parametrize("names", ["t,{0}x,{0}y,{0}z,{1}x,{1}y,{1}z", "time,imu_{0}x,imu_{0}y,imu_{0}z,{1}x,{1}y,{1}z"])
def test_columns_of_a_second_imu_are_said_to_be_left_out(names, walk, assert_same, tmp_path):
    first = names.format("a", "g")
    second = ",".join(f"imu2_{sensor}{axis}" for sensor in ("acc", "gyro") for axis in "xyz")
    rows = np.column_stack([walk.t, walk.acc, walk.gyr, -walk.acc, walk.gyr])
    np.savetxt(tmp_path / "two.csv", rows, "%.17g", ",", header=f"{first},{second}", comments="")
    read = load(tmp_path / "two.csv")
    assert_same(read, walk, 1e-9, 1e-9, 1e-9)
    assert "columns of another IMU were not read (--columns chooses): imu2_accx, imu2_accy" in read.taken


def test_fractions_of_a_second_are_no_milliseconds(walk, load_table):
    slow = walk.part(0, 1400)
    read = load_table(timed("time", slow.t * 40, "ax|ay|az|gx|gy|gz", slow.acc, slow.gyr / 40))
    assert read.rate_hz == pytest.approx(2.5, rel=0.01)


def test_a_column_that_is_not_there(walk, load_table):
    hints = Hints(columns=parse_columns("t=h,ax=b,ay=c,az=d,gx=e,gy=f,gz=g"))
    with pytest.raises(RecordingError, match="there is no column h for t: name one of a, b, c, d, e, f, g"):
        load_table(frame("a|b|c|d|e|f|g", walk.t, walk.acc, walk.gyr), hints)


def test_the_public_name_takes_words(walk, assert_same, tmp_path):
    path = tmp_path / "walk.csv"
    frame("a|b|c|d|e|f|g", walk.t * 1000, walk.acc / G, walk.gyr).to_csv(path, index=False)
    assert_same(mpucal.load(path, columns="t,ax,ay,az,gx,gy,gz", units="t=ms,acc=g,gyr=rad/s"), walk, 1e-9, 1e-9, 1e-9)
    with pytest.raises(mpucal.MpucalError, match="is not a unit"):
        mpucal.load(path, units="acc=feet")


@pytest.mark.parametrize("text", ["t=a,t=b", "velocity=a", "t,ax,ax", "ax="])
def test_columns_that_say_nothing(text):
    with pytest.raises(ValueError, match="is not a column"):
        parse_columns(text)


@pytest.mark.parametrize("text", ["acc=rad/s", "speed=m/s", "g", "acc="])
def test_units_that_are_none(text):
    with pytest.raises(ValueError, match="is not a unit"):
        parse_units(text)


def test_hints_for_a_file_that_needs_none(tmp_path):
    (tmp_path / "walk.tlog").touch()
    with pytest.raises(UsageError, match="needs no options"):
        load(tmp_path / "walk.tlog", Hints(rate_hz=100))


def test_a_bad_line_is_named(walk, walk_ns, tmp_path):
    lines = DIALECTS["Kalibr"](walk, walk_ns).to_csv(index=False).splitlines()
    lines[40] = lines[40].replace(",", ",x", 1)
    (tmp_path / "walk.csv").write_text("\n".join(lines))
    assert "1 samples that lack a number were left out" in load(tmp_path / "walk.csv").taken
    lines[60:] = [line.replace(",", ",x", 1) for line in lines[60:]]
    (tmp_path / "walk.csv").write_text("\n".join(lines))
    with pytest.raises(RecordingError, match=r"line 41: omega_x is 'x.*', which is not a number"):
        load(tmp_path / "walk.csv")


def phyphox(walk, walk_ns, folder, later=0.0, sep=",", decimal="."):
    timed("Time (s)", walk.t, "Acceleration x (m/s^2)|Acceleration y (m/s^2)|Acceleration z (m/s^2)", walk.acc).to_csv(
        folder / "Accelerometer.csv", index=False, quoting=1, sep=sep, decimal=decimal
    )
    timed("Time (s)", walk.t + later, "Gyroscope x (rad/s)|Gyroscope y (rad/s)|Gyroscope z (rad/s)", walk.gyr).to_csv(
        folder / "Gyroscope.csv", index=False, quoting=1, sep=sep, decimal=decimal
    )


def sensor_logger(walk, walk_ns, folder):
    for name, values in (
        ("Accelerometer", walk.acc * 0.001),
        ("TotalAcceleration", walk.acc),
        ("AccelerometerUncalibrated", walk.acc / G),
        ("Gyroscope", walk.gyr + 0.1),
        ("GyroscopeUncalibrated", walk.gyr),
    ):
        made = timed("time", walk_ns, "seconds_elapsed|z|y|x", walk.t, values[:, ::-1])
        made.to_csv(folder / f"{name}.csv", index=False)


@pytest.mark.parametrize("written", [phyphox, sensor_logger])
@pytest.mark.parametrize("archived", [False, True])
def test_a_phones_tables(written, archived, walk, walk_ns, assert_same, tmp_path):
    folder = tmp_path / "phone"
    folder.mkdir()
    written(walk, walk_ns, folder)
    path = folder
    if archived:
        (folder / "meta").mkdir()
        (folder / "meta" / "device.csv").write_text("property,value\n")
        path = tmp_path / "phone.zip"
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for child in sorted(folder.rglob("*.csv")):
                archive.write(child, child.relative_to(folder))
    read = load(path)
    assert_same(read, walk)
    of = "Uncalibrated" if written is sensor_logger else ""
    assert f"from Accelerometer{of}.csv and Gyroscope{of}.csv" in read.taken


def test_two_tables_are_joined_by_time(walk, walk_ns, tmp_path):
    phyphox(walk, walk_ns, tmp_path, later=0.0123, sep=";", decimal=",")
    read = load(tmp_path)
    assert "the gyroscope begins +12.30 ms after the accelerometer" in read.taken
    wanted = np.column_stack([np.interp(read.t, walk.t + 0.0123, rate) for rate in walk.gyr.T])
    np.testing.assert_allclose(read.gyr, wanted, atol=1e-9)


def test_two_tables_of_different_times_are_none(walk, walk_ns, tmp_path):
    phyphox(walk, walk_ns, tmp_path, later=1e4)
    with pytest.raises(RecordingError, match="not recorded at the same time"):
        load(tmp_path)


@pytest.mark.parametrize("given", ["Accelerometer.csv", "Gyroscope.csv"])
def test_one_table_of_two_is_read_with_the_other(given, walk, walk_ns, assert_same, tmp_path):
    phyphox(walk, walk_ns, tmp_path)
    read = load(tmp_path / given)
    assert_same(read, walk, 1e-9, 1e-9, 1e-9)
    assert "from Accelerometer.csv and Gyroscope.csv" in read.taken


def test_one_table_without_the_other(walk, walk_ns, tmp_path):
    phyphox(walk, walk_ns, tmp_path)
    (tmp_path / "Accelerometer.csv").rename(tmp_path / "walk.csv")
    read = load(tmp_path / "walk.csv")
    np.testing.assert_allclose(read.acc, walk.acc, atol=1e-9)
    assert np.isnan(read.gyr).all()
    assert "and without rates" in read.taken
    with pytest.raises(RecordingError, match=r"no columns of an accelerometer.*give the folder"):
        load(tmp_path / "Gyroscope.csv")


def test_pairs_of_tables_are_told_apart_by_their_names(walk, walk_ns, assert_same, tmp_path):
    for name, part in (("run1", walk), ("run2", walk.part(0, 900))):
        (tmp_path / name).mkdir()
        phyphox(part, walk_ns, tmp_path / name)
        for sensor in ("Accelerometer", "Gyroscope"):
            (tmp_path / name / f"{sensor}.csv").rename(tmp_path / f"{name}_{sensor}.csv")
        (tmp_path / name).rmdir()
    first = load(tmp_path)
    assert_same(first, walk, 1e-9, 1e-9, 1e-9)
    assert "of 2 pairs of tables, it is the first" in first.taken
    assert len(load(tmp_path / "run2_Gyroscope.csv")) == 900


def test_lines_that_hold_one_sensor_each(walk, load_table):
    """Read what a logger writes that has one line for each event."""
    nothing = np.full((len(walk), 3), np.nan)
    of_acc = timed("time", walk.t, "ax|ay|az|wx|wy|wz", walk.acc, nothing)
    of_gyr = timed("time", walk.t + 0.002, "ax|ay|az|wx|wy|wz", nothing, walk.gyr)
    read = load_table(pd.concat([of_acc, of_gyr]).sort_values("time"))
    np.testing.assert_allclose(read.acc, walk.acc[1:], atol=1e-9)
    assert "+2.00 ms after" in read.taken


def a_g(walk):
    scale = 16384 / G, 32750 / np.radians(250)
    rows = np.rint(np.column_stack([walk.acc * scale[0], walk.gyr * scale[1]])).clip(-32768, 32767).astype(int)
    return "".join("a/g:\t" + "\t".join(map(str, row)) + "\r\n" for row in rows.tolist())


@pytest.mark.parametrize("ending", [".txt", ".csv"])
def test_what_i2cdevlibs_example_prints(ending, walk, assert_same, tmp_path):
    steady, rate = even(walk)
    text = "Initializing I2C devices...\r\nMPU6050 connection successful\r\n" + a_g(walk) + "a/g:\t1\t2"
    (tmp_path / f"walk{ending}").write_text(text)
    read = load(tmp_path / f"walk{ending}", Hints(rate_hz=rate))
    kept = ~read.gyr_clipped & ~read.acc_clipped
    np.testing.assert_allclose(read.acc[kept], steady.acc[kept], atol=0.5 * G / 16384 * 1.001)
    np.testing.assert_allclose(read.gyr[kept], steady.gyr[kept], atol=0.5 * np.radians(250) / 32750 * 1.001)
    assert kept.mean() > 0.5
    assert "MPU6050::initialize()" in read.taken
    assert "this sample rate is" in load(tmp_path / f"walk{ending}").taken


@pytest.mark.parametrize(
    ("name", "quantity", "axis", "unit"),
    [
        ("Gyroscope z (rad/s)", "gyr", 2, "rad/s"),
        ("AcX", "acc", 0, ""),
        ("gx_raw", "gyr", 0, ""),
        ("ax (LSB)", "acc", 0, "counts"),
        ("imu0.gyro.y", "gyr", 1, ""),
        ("GyroY[°/s]", "gyr", 1, "deg/s"),
        ("acceleration_z_m_s2", "acc", 2, "m/s^2"),
        ("timestamp_ms", "t", 0, "ms"),
        ("Timestamp (µs)", "t", 0, "us"),
        ("temperature_c", "temperature_c", 0, ""),
    ],
)
def test_names(name, quantity, axis, unit):
    found = parse_column_name(name, 3)
    assert (found.quantity, found.axis, found.unit, found.place) == (quantity, axis, unit, 3)


@pytest.mark.parametrize("name", ["x", "roll", "GRAVITY X (m/s²)", "motionUserAccelerationX(G)", "mag_x", "w", "q_w"])
def test_names_of_something_else(name):
    assert parse_column_name(name, 0) is None


@pytest.mark.parametrize(
    ("text", "unit"), [("m/s²", "m/s^2"), ("m s^-2", "m/s^2"), ("°/s", "deg/s"), ("µs", "us"), ("G", "g"), ("Hz", "")]
)
def test_units_as_people_spell_them(text, unit):
    assert find_unit(text) == unit


def test_gravity_turns_as_the_rates_say():
    """A vector that stands still, seen by a body that turns at a known rate: Rodrigues' formula."""
    t = np.arange(0, 20, 0.005)
    axis = np.array([0.6, -0.48, 0.64])
    angle, g = 2 * np.sin(t)[:, None], np.array([0.0, 0.0, G])
    acc = g * np.cos(angle) - np.cross(axis, g) * np.sin(angle) + axis * (axis @ g) * (1 - np.cos(angle))
    assert rate_factor(t, acc, 2 * np.cos(t)[:, None] * axis) == pytest.approx(1.0, rel=0.02)
