"""Tables of one sensor each in a folder, beside each other or in an archive, and folders of recordings."""

import gzip
import json
import zipfile

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

import mpucal
from mpucal.data import STANDARD_GRAVITY_MPS2 as G
from mpucal.errors import RecordingError


def put(folder, name, t, values, columns, of_t="Time (s)", **how):
    """Write a table of one sensor: its times, then a column for each axis."""
    made = pd.DataFrame(values, columns=columns)
    made.insert(0, of_t, t)
    made.to_csv(folder / name, index=False, **how)


def phyphox(folder, walk, ns, later=0.0, prefix="", **how):
    for name, of, values, unit in (
        ("Accelerometer", "Acceleration", walk.acc, "m/s^2"),
        ("Gyroscope", "Gyroscope", walk.gyr, "rad/s"),
    ):
        columns = [f"{of} {axis} ({unit})" for axis in "xyz"]
        put(folder, f"{prefix}{name}.csv", walk.t + later * (name == "Gyroscope"), values, columns, quoting=1, **how)


def sensor_logger(folder, walk, ns, metadata=None, sign=1):
    for name, values in (
        ("Accelerometer", walk.acc * 0.001),
        ("TotalAcceleration", sign * walk.acc),
        ("AccelerometerUncalibrated", sign * walk.acc / G),
        ("Gyroscope", walk.gyr + 0.1),
        ("GyroscopeUncalibrated", walk.gyr),
    ):
        put(folder, f"{name}.csv", ns, values[:, ::-1], list("zyx"), "time")
    if metadata:
        pd.DataFrame([metadata]).to_csv(folder / "Metadata.csv", index=False)


def metawear(folder, walk, ns):
    """Name the tables by a word within longer names, beside one without gravity."""
    for name, values, unit in (("Accelerometer", walk.acc / G, "g"), ("Gyroscope", np.degrees(walk.gyr), "deg/s")):
        columns = [f"{axis}-axis ({unit})" for axis in "xyz"]
        put(folder, f"MetaWear_C8_{name}_100.000Hz_1.4.4.csv", ns / 1e6, values, columns, "epoch (ms)")
    put(folder, "Linear Accelerometer.csv", walk.t, 0 * walk.acc, list("xyz"))


def pair(folder, walk, ns, order=(0, 1, 2, 3)):
    """Write two tables without names, as data sets have them: time, x, y, z."""
    for name, values in (("acce.txt", walk.acc), ("gyro.txt", walk.gyr)):
        columns = [ns, *values.T]
        table = pd.DataFrame({k: columns[place] for k, place in enumerate(order)})
        table.to_csv(folder / name, sep=" ", header=False, index=False)


def of_arrays(folder, walk, ns):
    """Write an object of JSON for each sensor, whose columns have other names."""
    for name, values, letter in (("ArsAccel", walk.acc, "f"), ("ArsGyro", walk.gyr, "w")):
        columns = {"t": walk.t.tolist()} | {f"{letter}{k}": values[:, k].tolist() for k in range(3)}
        (folder / f"{name}.json").write_text(json.dumps({"header": "of MATLAB", "data": columns}))


def marked(folder, walk, ns):
    """Begin each line with the sensor's name, and name no units."""
    for name, values in (("acceleration", walk.acc / G), ("gyroscope", np.degrees(walk.gyr))):
        made = pd.DataFrame(np.column_stack([walk.t * 1e3, values]))
        made.insert(0, "of", name)
        made.to_csv(folder / f"{name}_20180927.csv", header=False, index=False)


WRITTEN = {
    "phyphox, a folder": (phyphox, "from Accelerometer.csv and Gyroscope.csv"),
    "Sensor Logger, a folder": (sensor_logger, "from AccelerometerUncalibrated.csv and GyroscopeUncalibrated.csv"),
    "MetaWear, a folder": (metawear, "accelerations in g and rates in deg/s"),
    "two tables without names": (pair, "from acce.txt and gyro.txt"),
    "two files of JSON": (of_arrays, "from ArsAccel.json and ArsGyro.json"),
    "two tables of marked lines": (marked, "accelerations in g and rates in deg/s"),
}


@pytest.mark.parametrize("name", WRITTEN)
def test_the_tables_of_two_sensors_are_one_recording(name, walk, walk_ns, assert_same, tmp_path):
    write, says = WRITTEN[name]
    (tmp_path / "phone").mkdir()
    write(tmp_path / "phone", walk, walk_ns)
    read = mpucal.load(tmp_path / "phone")
    assert_same(read, walk, 1e-9, 1e-9, 1e-6)
    assert says in read.taken


@pytest.mark.parametrize("write", [phyphox, sensor_logger])
def test_an_archive_of_them_is_read_as_the_folder(write, walk, walk_ns, assert_same, tmp_path):
    (tmp_path / "meta").mkdir()
    (tmp_path / "meta" / "device.csv").write_text("property,value\n")
    write(tmp_path, walk, walk_ns)
    with zipfile.ZipFile(tmp_path / "phone.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        for child in sorted(tmp_path.rglob("*.csv")):
            archive.write(child, child.relative_to(tmp_path))
    assert_same(mpucal.load(tmp_path / "phone.zip"), walk)


def test_sensor_logger_says_by_its_metadata_which_sign_it_has(walk, walk_ns, assert_same, tmp_path):
    for said, sign in (
        ({"version": 3, "device name": "a, b", "platform": "ios"}, -1),
        ({"platform": "android"}, 1),
        ({"platform": "ios", "standardisation": "true"}, 1),
    ):
        sensor_logger(tmp_path, walk, walk_ns, said, sign)
        read = mpucal.load(tmp_path)
        assert_same(read, walk)
        assert ("accelerations have the opposite sign, as on iOS" in read.taken) == (sign < 0)


@pytest.mark.parametrize(
    ("events", "utc_ns"),
    [
        ([["START", 0.0, 1.7e9]], 1_700_000_000 * 10**9),
        ([["START", 0.0, 1.7e9], ["PAUSE", 30.0, 1.7e9 + 30]] * 2, None),
        ([["START", 0, "9e999999"]], None),
    ],
)
def test_phyphox_says_the_time_of_day_in_a_file_beside_its_tables(events, utc_ns, walk, walk_ns, tmp_path):
    phyphox(tmp_path, walk, walk_ns)
    (tmp_path / "meta").mkdir()
    columns = ["event", "experiment time", "system time"]
    pd.DataFrame(events, columns=columns).to_csv(tmp_path / "meta" / "time.csv", index=False)
    read = mpucal.load(tmp_path)
    assert read.utc_ns == utc_ns
    assert ("paused once" in read.taken) == (len(events) > 1)


def test_sensor_loggers_table_without_gravity_is_called_so(walk, walk_ns, table):
    path = table("time,seconds_elapsed,z,y,x", walk_ns, walk.t, walk.acc[:, ::-1], file="Accelerometer.csv")
    with pytest.raises(RecordingError, match="writes accelerations without gravity into that table: record its Total"):
        mpucal.load(path)


def test_two_tables_are_joined_by_time(walk, walk_ns, tmp_path):
    phyphox(tmp_path, walk, walk_ns, later=0.0123, sep=";", decimal=",")
    read = mpucal.load(tmp_path)
    assert "the gyroscope begins +12.30 ms after the accelerometer" in read.taken
    wanted = np.column_stack([np.interp(read.t, walk.t + 0.0123, rate) for rate in walk.gyr.T])
    np.testing.assert_allclose(read.gyr, wanted, atol=1e-9)
    phyphox(tmp_path, walk, walk_ns, later=1e4)
    with pytest.raises(RecordingError, match="not recorded at the same time"):
        mpucal.load(tmp_path)


def test_a_letter_in_a_files_name_is_no_sensor(walk, assert_same, table):
    for name, values in (("accm", walk.acc), ("gyrm", walk.gyr)):
        path = table("time,X_value,Y_value,Z_value", walk.t, values, file=f"house_f_158_{name}.csv")
    assert_same(mpucal.load(path), walk)


def test_a_table_is_read_with_the_other_of_its_pair_if_that_exists(walk, walk_ns, assert_same, tmp_path):
    phyphox(tmp_path, walk, walk_ns)
    for given in ("Accelerometer.csv", "Gyroscope.csv"):
        assert_same(mpucal.load(tmp_path / given), walk, 1e-9, 1e-9, 1e-9)
    (tmp_path / "Accelerometer.csv").rename(tmp_path / "walk.csv")
    read = mpucal.load(tmp_path / "walk.csv")
    np.testing.assert_allclose(read.acc, walk.acc, atol=1e-9)
    assert np.isnan(read.gyr).all()
    assert "and without rates" in read.taken
    with pytest.raises(RecordingError, match=r"no columns of an accelerometer.*give the folder"):
        mpucal.load(tmp_path / "Gyroscope.csv")


def test_the_given_one_of_two_recordings_in_a_folder_is_read(walk, assert_same, tmp_path):
    """Read accel.csv with gyro.csv, also beside another recording's accelerometer.csv and gyroscope.csv."""
    for acc, gyr, sign in (("accel", "gyro", 1), ("accelerometer", "gyroscope", -1)):
        put(tmp_path, f"{acc}.csv", walk.t, sign * walk.acc, list("xyz"), "time")
        put(tmp_path, f"{gyr}.csv", walk.t, walk.gyr, list("xyz"), "time")
    for given in ("accel.csv", "gyro.csv"):
        found = mpucal.load(tmp_path / given)
        assert_same(found, walk, 1e-9, 1e-9, 1e-9)
        assert "from accel.csv and gyro.csv" in found.taken
    assert "from accelerometer.csv and gyroscope.csv" in mpucal.load(tmp_path / "gyroscope.csv").taken


def test_pairs_of_tables_are_told_apart_by_their_names(walk, walk_ns, assert_same, tmp_path):
    phyphox(tmp_path, walk, walk_ns, prefix="run1_")
    phyphox(tmp_path, walk.part(0, 600), walk_ns, prefix="run2_")
    first = mpucal.load(tmp_path)
    assert_same(first, walk, 1e-9, 1e-9, 1e-9)
    assert "of 2 pairs of tables, it is the first" in first.taken
    assert len(mpucal.load(tmp_path / "run2_Gyroscope.csv")) == 600


@pytest.mark.parametrize("said", ["ax,ay,az,t", "t=4,ax=1,ay=2,az=3,gx=1,gy=2,gz=3"])
def test_two_tables_without_names_are_read_by_given_columns(said, walk, walk_ns, assert_same, tmp_path):
    pair(tmp_path, walk, walk_ns, (1, 2, 3, 0))
    assert_same(mpucal.load(tmp_path, columns=said), walk)


def test_two_tables_without_names_may_have_the_time_last_but_not_between(walk, walk_ns, assert_same, tmp_path):
    pair(tmp_path, walk, walk_ns, (1, 2, 3, 0))
    assert_same(mpucal.load(tmp_path), walk)
    pair(tmp_path, walk, walk_ns, (1, 0, 2, 3))
    with pytest.raises(RecordingError):
        mpucal.load(tmp_path)


def test_files_of_a_folder_are_one_recording_and_others_are_left_out(walk, tmp_path):
    for name, part in (("b", walk.part(500, 1000)), ("a", walk.part(0, 500))):
        np.save(tmp_path / f"{name}.npy", np.column_stack([part.t, part.acc, part.gyr]))
    (tmp_path / "notes.txt").write_text("turned by hand\n")
    (tmp_path / "settings.json").write_text(json.dumps({"rate": 100}))
    savemat(tmp_path / "results.mat", {"accel_bias": np.zeros((3, 1)), "M_a": 0.005 * np.eye(3)})
    read = mpucal.load(tmp_path)
    np.testing.assert_allclose(read.acc, walk.acc, atol=1e-9)
    assert np.flatnonzero(read.gap).tolist() == [500]
    # of which `data_lost` says nothing
    assert read.interrupted == (read.t[499],)
    assert "how the board turned between them is unknown: a.npy, b.npy." in read.taken
    assert "Left out were results.mat (" in read.taken


def test_a_side_with_a_large_bias_has_the_columns_of_the_others(tmp_path):
    """Read its columns as in the other files, as |a| does not show them; leave out a table of another unit."""
    rng = np.random.default_rng(4)
    for name, side in (("x_up", [1.07, 0, 0]), ("y_up", [0, 1, 0]), ("z_up", [0, 0, 1]), ("places", [900, 1, 5])):
        values = [*(np.array(side) * 16384 / (1 if side[0] < 2 else 16384)), 90, -70, 30]
        np.savetxt(tmp_path / f"{name}.txt", np.rint(values + rng.normal(0, 3, (300, 6))), "%d")
    read = mpucal.load(tmp_path)
    assert "of 3 files" in read.taken
    assert "x_up.txt, y_up.txt, z_up.txt" in read.taken
    np.testing.assert_allclose(np.abs(read.acc).max(axis=0) / G, [1.07, 1.0, 1.0], atol=0.01)


def test_the_one_recording_among_other_tables_is_named(walk, tmp_path):
    np.save(tmp_path / "imu.npy", np.column_stack([walk.t, walk.acc, walk.gyr]))
    np.save(tmp_path / "places.npy", np.column_stack([walk.t, 1e-3 * walk.acc]))
    with pytest.raises(RecordingError, match=r"places\.npy holds no .*: give imu\.npy alone"):
        mpucal.load(tmp_path)


def test_packed_recordings_are_read_as_what_is_in_them(walk, table, assert_same, tmp_path):
    """Read a packed file and a packed folder, with files that systems add; name a file that cannot be read."""
    content = table("t,ax,ay,az,gx,gy,gz", walk.t, walk.acc, walk.gyr).read_bytes()
    (tmp_path / "walk.csv.gz").write_bytes(gzip.compress(content))
    (tmp_path / "cut.csv.gz").write_bytes(gzip.compress(content)[:-9])
    for name, members in (("one.zip", ["a/walk.csv", "README.md"]), ("two.zip", ["both/a.csv", "both/b.csv"])):
        with zipfile.ZipFile(tmp_path / name, "w") as archive:
            for member in members:
                archive.writestr(member, content if member.endswith(".csv") else "a walk\n")
            archive.writestr("README.txt", "Turned by hand, twice.\nNo gloves.\n")
            archive.writestr("__MACOSX/._walk.csv", b"\0\5\26\7")
    with zipfile.ZipFile(tmp_path / "one.zip") as archive:
        archive.extractall(tmp_path / "unpacked")
    for name in ("walk.csv.gz", "one.zip", "unpacked/a"):
        assert_same(mpucal.load(tmp_path / name), walk)
    both = mpucal.load(tmp_path / "two.zip")
    assert (len(both), "one recording of 2 files" in both.taken) == (2 * len(walk), True)
    with pytest.raises(RecordingError, match="is not a whole archive"):
        mpucal.load(tmp_path / "cut.csv.gz")
    with zipfile.ZipFile(tmp_path / "one.zip", "w") as archive:
        archive.writestr("walk.csv", "time,ax\n")
    with pytest.raises(RecordingError, match="walk"):
        mpucal.load(tmp_path / "one.zip")


def test_pairs_of_tables_of_sides_are_one_recording_at_the_rate_that_they_state(walk, tmp_path):
    for k, side in enumerate(("x_up", "y_down")):
        part = walk.part(500 * k, 500 * (k + 1))
        savemat(tmp_path / f"{side}_accel.mat", {"accel": part.acc, "Fs": 50})
        savemat(tmp_path / f"{side}_gyro.mat", {"gyro": part.gyr, "Fs": 50})
    read = mpucal.load(tmp_path, units="gyr=rad/s", rate=100)
    np.testing.assert_allclose(read.acc, walk.acc)
    assert np.flatnonzero(read.gap).tolist() == [500]
    assert mpucal.load(tmp_path / "x_up_accel.mat", units="gyr=rad/s").rate_hz == pytest.approx(50.0)


def test_an_error_about_the_present_folder_names_it(tmp_path, monkeypatch):
    for name in ("a.npz", "b.npz"):
        (tmp_path / name).write_bytes(b"")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(RecordingError, match=r"^\.: a\.npz is "):
        mpucal.load(".")


def test_two_tables_whose_columns_are_numbered_are_those_of_their_files_names(walk, assert_same, tmp_path):
    """Read the tables that `writetimetable` makes of MATLAB's timeseries, as the message on such objects advises."""
    for name, values in (("acc", walk.acc), ("gyro", walk.gyr)):
        put(
            tmp_path,
            f"{name}.csv",
            [f"{t!r} sec" for t in walk.t.tolist()],
            values,
            [f"Data_{i}" for i in (1, 2, 3)],
            "Time",
        )
    assert_same(mpucal.load(tmp_path), walk, 1e-9, 1e-9, 1e-9)


def test_an_archive_in_an_archive_and_a_damaged_gz_file_are_refused(tmp_path):
    """Levels of archives could fill the disk; the error of a .gz file is of its content, and not of its path."""
    inner, outer, damaged = tmp_path / "walk.zip", tmp_path / "all.zip", tmp_path / "walk.csv.gz"
    for path, name in ((inner, "walk.csv"), (outer, "walk.zip")):
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr(name, inner.read_bytes() if path is outer else "ax,ay,az\n")
    with pytest.raises(RecordingError, match=r"holds another archive, walk\.zip: unpack it"):
        mpucal.load(outer)
    damaged.write_bytes(gzip.compress(b"ax,ay,az\n" * 1000)[:-8] + bytes(8))
    with pytest.raises(RecordingError, match="is not a whole archive"):
        mpucal.load(damaged)


def test_a_damaged_file_of_a_pair_is_named_alone_beside_the_given_one(tmp_path):
    (tmp_path / "walk_acc.csv").write_text("t,x,y,z\n" + "".join(f"{0.01 * n:.2f},0.1,0.2,9.8\n" for n in range(300)))
    (tmp_path / "walk_gyro.csv").write_text("t,x\n0.00,0.1\n")
    with pytest.raises(RecordingError, match=r"^walk_gyro\.csv "):
        mpucal.load(tmp_path / "walk_acc.csv")
