"""Files as people keep them who never heard of mpucal: in the forms of public sources, and read at the first try."""

import json
import struct
import sys
import zlib
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

import mpucal
from mpucal.data import STANDARD_GRAVITY_MPS2 as G
from mpucal.errors import RecordingError
from mpucal.report import render

FIXTURE = Path(__file__).parents[2] / "fixtures" / "sessions" / "mpu6050.mcap"
HZ = 100.0
COUNTS = np.r_[[16384 / G] * 3, [32750 / np.radians(500)] * 3]


def si(walk):
    return np.column_stack([walk.acc, walk.gyr])


def counts(walk, g=4, dps=500):
    return np.rint(si(walk) * np.r_[[32768 / (g * G)] * 3, [32750 / np.radians(dps)] * 3]).astype(int)


def text(rows, separator=" "):
    return "".join(separator.join(map(repr, row)) + "\n" for row in rows.tolist())


def poses(walk):
    """TUM's style, as np.savetxt writes a header."""
    rows = np.column_stack([walk.t + 1535630275.9, si(walk), si(walk)[:, :3] * 0.01])
    return "# time tx ty tz wx wy wz mx my mz\n" + text(rows)


def two_lines_of_names(walk):
    head = "Time;Reference;;;;IMU Acceleration;;;IMU Gyroscope;;\ns;W;X;Y;Z;X;Y;Z;X;Y;Z\n"
    return head + text(np.column_stack([walk.t, np.full((len(walk), 4), 0.5), si(walk)]), ";")


def a_log_of_a_board(walk):
    lines = [
        f"RAW 0x68: accel=({a}, {b}, {c}) temp_raw=4000 gyro=({d}, {e}, {f})\r\n"
        for a, b, c, d, e, f in counts(walk).tolist()
    ]
    boot = "ESP-ROM:esp32c3-api1-20210207\r\nself_test accel=(17020,-1262) baseline_gyro=(645,315,-309)\r\n"
    return boot + "".join(line if i % 40 else f"advanced fifo_end\r\n{line}" for i, line in enumerate(lines))


def mt_manager(walk):
    ticks = 10259826 + np.rint(walk.t * 1e4).astype(int)
    lines = [
        f"{16213 + i}\t{tick}\t" + "\t".join(f"{value:.9f}" for value in row) + ("\t1.0\t2.0\n" if i % 4 else "\t\t\n")
        for i, (tick, row) in enumerate(zip(ticks.tolist(), si(walk).tolist(), strict=True))
    ]
    head = "PacketCounter\tSampleTimeFine\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z\tRoll\tPitch\n"
    return (
        "// General information:\n//  MT Manager version: 2022.0.0\n// Coordinate system: ENU\n" + head + "".join(lines)
    )


def zeros_and_a_second_header(walk):
    head = "timestamp_us,ax,ay,az,gx,gy,gz,temp_raw\n"
    rows = np.column_stack([np.rint(walk.t * 1e6), counts(walk), np.full(len(walk), -1136)]).astype(int)
    body = text(rows, ",").splitlines(keepends=True)
    return head + "\0" * 400 + head + "".join(body)


def without_a_sign(walk):
    """Return int16 counts printed as uint16, without names."""
    return text(np.column_stack([np.rint(walk.t * 1000), counts(walk) % 65536, counts(walk) % 7]).astype(int), "\t")


def from_the_lowest_on(walk):
    return text(np.column_stack([walk.t, counts(walk) + 32768]))


def a_rocket(walk):
    names = ["state", "timestamp_seconds", "temperature_celsius"]
    names += [f"raw_acceleration_{axis}_gs" for axis in "xyz"] + [
        f"raw_angular_rate_{axis}_deg_per_s" for axis in "xyz"
    ]
    rows = np.column_stack([walk.t + 129.0, np.full(len(walk), 26.3), walk.acc / G, np.degrees(walk.gyr)])
    return ",".join(names) + "\n" + "".join(f"S,{line}\n" for line in text(rows, ",").splitlines())


def a_racebox(walk):
    names = "Record,Time,Latitude,Altitude,GForceX,GForceY,GForceZ,Lap,GyroX,GyroY,GyroZ\n"
    n, none = np.arange(len(walk)), np.zeros(len(walk))
    acc, rates = walk.acc / G, np.degrees(walk.gyr)
    return names + text(np.column_stack([n, walk.t, none + 53.3, none + 133.0, acc, none, rates]), ",")


FORMS = {
    "poses.txt": poses,
    "two lines of names.csv": two_lines_of_names,
    "a log of a board.log": a_log_of_a_board,
    "MT Manager.txt": mt_manager,
    "zeros and a second header.csv": zeros_and_a_second_header,
    "without a sign.txt": without_a_sign,
    "from the lowest on.txt": from_the_lowest_on,
    "a rocket.csv": a_rocket,
    "a racebox.csv": a_racebox,
}


@pytest.fixture(scope="module")
def even_walk(walk):
    return replace(walk, t=np.arange(len(walk)) / HZ)


@pytest.mark.parametrize("name", FORMS)
def test_what_strangers_write_is_read_at_the_first_try(name, even_walk, tmp_path):
    path = tmp_path / name
    path.write_text(FORMS[name](even_walk))
    read = mpucal.load(path, rate=HZ if "board" in name else None)
    assert len(read) == len(even_walk)
    np.testing.assert_allclose(read.t - read.t[0], even_walk.t, atol=2e-3)
    rounded = 0.51 / COUNTS if "counts" in read.taken else np.full(6, 1e-6)
    assert (np.abs(si(read) - si(even_walk)) < rounded * np.r_[2, 2, 2, 1, 1, 1]).all()


def as_npy(walk, path):
    np.save(path, np.column_stack([walk.t, si(walk)]))


def as_fields(walk, path):
    names = ("time_ms", "accel_x", "accel_y", "accel_z", "gyro_x", "gyro_y", "gyro_z", "temperature")
    rows = np.column_stack([walk.t * 1000, si(walk), np.full(len(walk), 31.5)])
    np.save(path, np.array([tuple(row) for row in rows], [(name, "f8") for name in names]))


def as_other_names(walk, path):
    np.savez(path, timestamps=walk.t * 1e6, accel=walk.acc.T / G, gyro=np.degrees(walk.gyr), serial=np.arange(5))


def as_matlab(walk, path):
    savemat(
        path,
        {"imu": {"time": walk.t, "acc": walk.acc, "gyro": walk.gyr}, "Fs": 100.0, "note": "a walk"},
        do_compression=True,
    )


def as_matlabs_matrix(walk, path):
    savemat(path, {"cal_data": np.column_stack([walk.t, counts(walk), counts(walk)[:, :3] * 0.1])})


@pytest.mark.parametrize(
    ("written", "suffix"),
    [(as_npy, ".npy"), (as_fields, ".npy"), (as_other_names, ".npz"), (as_matlab, ".mat"), (as_matlabs_matrix, ".mat")],
)
def test_arrays_are_read_at_the_first_try(written, suffix, even_walk, tmp_path):
    written(even_walk, tmp_path / f"walk{suffix}")
    read = mpucal.load(tmp_path / f"walk{suffix}")
    np.testing.assert_allclose(read.t - read.t[0], even_walk.t, atol=1e-9)
    np.testing.assert_allclose(si(read), si(even_walk), atol=1.01 / COUNTS[0] if "counts" in read.taken else 1e-9)
    assert read.sensor.temperature_c == (31.5 if written is as_fields else None)


def without_times(walk):
    return "ax,ay,az,gx,gy,gz\n" + text(np.column_stack([walk.acc, np.degrees(walk.gyr)]), ",")


@pytest.mark.parametrize(
    ("arrays", "says"),
    [
        ({"acc": np.zeros((5, 3))}, "which is not gravity"),
        ({"note": "nothing"}, "holds no columns of numbers"),
        ({"data": np.random.default_rng(0).normal(size=(900, 7))}, "holds no three columns as long as gravity"),
    ],
)
def test_arrays_that_are_no_recording(arrays, says, tmp_path):
    savemat(tmp_path / "a.mat", arrays)
    with pytest.raises(RecordingError, match=says):
        mpucal.load(tmp_path / "a.mat")


@pytest.mark.parametrize("data", [b"", b"MATLAB 5.0 MAT-file", b"\x93NUMPY\x01\x00", b"PK\x03\x04 and no more"])
@pytest.mark.parametrize("suffix", [".mat", ".npy", ".npz"])
def test_files_of_arrays_that_are_none(data, suffix, tmp_path):
    (tmp_path / f"a{suffix}").write_bytes(data)
    with pytest.raises(mpucal.MpucalError):
        mpucal.load(tmp_path / f"a{suffix}")


@pytest.mark.parametrize("compressed", [False, True])
def test_a_damaged_file_of_matlab_is_an_error_or_a_recording(compressed, even_walk, tmp_path):
    """SciPy's reader crashes on some."""
    savemat(tmp_path / "a.mat", {"imu": {"acc": even_walk.acc[:50], "t": 1}, "m": [1, 2]}, do_compression=compressed)
    whole, rng = (tmp_path / "a.mat").read_bytes(), np.random.default_rng(2)
    for _ in range(150):
        damaged = bytearray(whole[: rng.integers(130, len(whole))] if rng.random() < 0.3 else whole)
        for at in rng.integers(100, min(len(damaged), 600), 3):
            damaged[at] = rng.integers(256)
        (tmp_path / "a.mat").write_bytes(damaged)
        with suppress(mpucal.MpucalError):
            mpucal.load(tmp_path / "a.mat")


HEAD_OF_7_3 = b"MATLAB 7.3 MAT-file, Platform: PCWIN64".ljust(124) + b"\0\2IM" + bytes(384)


def test_files_of_matlab_7_3_are_read_by_h5py(even_walk, tmp_path):
    """Read two buffers of four rows, as a Simulink model keeps them."""
    h5py = pytest.importorskip("h5py")
    for name, values in (("accelerometer", even_walk.acc / G), ("gyroscope", np.degrees(even_walk.gyr))):
        path = tmp_path / f"mpu6050_{name}.mat"
        with h5py.File(path, "w", userblock_size=512) as file:
            file[f"{name}Buffer"] = np.vstack([even_walk.t, values.T]).T.copy()
        path.write_bytes(HEAD_OF_7_3 + path.read_bytes()[512:])
    for given in ("mpu6050_gyroscope.mat", "."):
        read = mpucal.load(tmp_path / given)
        assert "accelerations in g and rates in deg/s" in read.taken
        np.testing.assert_allclose(si(read), si(even_walk), atol=1e-9)
    (tmp_path / "a.mat").write_bytes(HEAD_OF_7_3)
    with pytest.raises(RecordingError, match="is not a whole file of arrays"):
        mpucal.load(tmp_path / "a.mat")


def test_without_h5py_a_file_of_matlab_7_3_names_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "h5py", None)
    (tmp_path / "a.mat").write_bytes(HEAD_OF_7_3)
    with pytest.raises(RecordingError, match=r"needs h5py, which is not installed: pip install 'mpucal\[matlab\]'"):
        mpucal.load(tmp_path / "a.mat")


def test_what_physics_does_not_confirm_is_not_guessed(even_walk, tmp_path):
    rows = np.column_stack([even_walk.t, even_walk.acc, np.roll(even_walk.gyr, 700, axis=0)])
    (tmp_path / "walk.txt").write_text(text(rows))
    with pytest.raises(RecordingError, match="name its columns in their order"):
        mpucal.load(tmp_path / "walk.txt")


def test_a_rate_that_nothing_says_is_found_by_how_gravity_turns(even_walk, tmp_path):
    table = "ax,ay,az,gx,gy,gz\n" + text(np.column_stack([even_walk.acc, np.degrees(even_walk.gyr)]), ",")
    (tmp_path / "walk.csv").write_text(table)
    read = mpucal.load(tmp_path / "walk.csv")
    assert read.rate_hz == pytest.approx(HZ, rel=0.15)
    assert "this sample rate is that at which its rates turn gravity" in read.taken
    np.testing.assert_allclose(si(read), si(even_walk), atol=1e-9)


def element(kind, data):
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8 if kind != 15 else 0)


def matrix(of, shape, name, *parts):
    """Return a matrix of the class `of`; see MAT-File Format."""
    said = element(6, struct.pack("<II", of, 0)) + element(5, struct.pack(f"<{len(shape)}i", *shape))
    return element(14, said + element(1, name) + b"".join(parts))


def numbers(values):
    return matrix(6, (len(values), 1), b"", element(9, np.asarray(values, float).tobytes()))


def cells(*parts):
    return matrix(1, (len(parts), 1), b"", *parts)


def fields(**values):
    names = b"".join(name.encode().ljust(16, b"\0") for name in values)
    head = element(5, struct.pack("<i", 16)) + element(1, names)
    return matrix(2, (1, 1), b"", head, *values.values())


def thing(name, kind, value):
    said = element(6, struct.pack("<II", 17, 0)) + b"".join(element(1, word) for word in (name, b"MCOS", kind))
    return element(14, said + value)


def as_timetables(path, **sensors):
    """Write tables {X, Y, Z} with their times in ms as MATLAB Mobile saves a phone's sensors."""
    contents = [numbers([])]
    for t_ms, values in sensors.values():
        names = [matrix(4, (1, 1), b"", element(16, axis)) for axis in (b"X", b"Y", b"Z")]
        columns = [numbers(column) for column in values.T]
        contents += [numbers(t_ms), fields(data=cells(*columns), varNames=cells(*names))]
    inner = b"\0\1IM\0\0\0\0" + fields(MCOS=thing(b"", b"FileWrapper__", cells(*contents)))
    named = [thing(name.encode(), b"timetable", numbers([1.0, 2.0])) for name in sensors]
    last = matrix(9, (1, len(inner)), b"", element(2, inner))
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM"
    path.write_bytes(head + b"".join(element(15, zlib.compress(each)) for each in (*named, last)))


def test_timetables_of_matlab_mobile_are_read(even_walk, tmp_path):
    t_ms = even_walk.t * 1000 + 1.6e12
    later = slice(7, None)
    as_timetables(
        tmp_path / "sensorlog.mat",
        Acceleration=(t_ms, even_walk.acc),
        Orientation=(t_ms, even_walk.acc * 10),
        AngularVelocity=(t_ms[later], even_walk.gyr[later]),
    )
    read = mpucal.load(tmp_path / "sensorlog.mat")
    assert "from Acceleration and AngularVelocity" in read.taken
    np.testing.assert_allclose(si(read), si(even_walk)[later], atol=1e-6)
    assert read.utc_ns is not None


def test_objects_of_matlab_are_named(tmp_path):
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM"
    (tmp_path / "log.mat").write_bytes(head + thing(b"log", b"table", numbers([1.0, 2.0])))
    with pytest.raises(RecordingError, match=r"objects of MATLAB \(table\)"):
        mpucal.load(tmp_path / "log.mat")


@pytest.mark.parametrize("name", ["AccTest.txt", "acc.csv", "2021-acceldata.txt"])
def test_three_columns_are_an_accelerometers_if_the_file_is_called_so(name, even_walk, tmp_path):
    (tmp_path / name).write_text(text(even_walk.acc / G, ","))
    read = mpucal.load(tmp_path / name)
    np.testing.assert_allclose(read.acc, even_walk.acc)
    assert np.isnan(read.gyr).all()


def test_lines_without_times_that_repeat_a_sample_are_left_out(even_walk, tmp_path):
    (tmp_path / "acc.txt").write_text(text(np.repeat(even_walk.acc, 5, axis=0)))
    read = mpucal.load(tmp_path / "acc.txt")
    np.testing.assert_allclose(read.acc, even_walk.acc)
    np.testing.assert_allclose(read.t, even_walk.t * 5, atol=1e-9)
    assert not read.gap.any()
    assert f"{4 * len(even_walk)} repeated samples were left out" in read.taken


def test_three_columns_of_an_unknown_sensor_name_the_command(even_walk, tmp_path):
    (tmp_path / "field.txt").write_text(text(even_walk.acc, ","))
    with pytest.raises(RecordingError, match="holds no columns that are known") as error:
        mpucal.load(tmp_path / "field.txt")
    read = mpucal.load(tmp_path / "field.txt", columns=error.value.options.split()[1])
    np.testing.assert_allclose(read.acc, even_walk.acc)


def test_a_unit_that_shaking_hides_is_asked_for(even_walk, tmp_path):
    shaken = replace(even_walk, acc=even_walk.acc / G * np.random.default_rng(4).uniform(0.2, 3, (len(even_walk), 1)))
    (tmp_path / "walk.csv").write_text(without_times(shaken))
    with pytest.raises(RecordingError, match="would be gravity in g") as error:
        mpucal.load(tmp_path / "walk.csv")
    assert error.value.options == "--units acc=g"


def test_accelerations_without_gravity_are_named(even_walk, tmp_path):
    names = "PacketCounter,SampleTimeFine,Euler_X,Euler_Y,Euler_Z,FreeAcc_X,FreeAcc_Y,FreeAcc_Z\n"
    ticks = np.rint(even_walk.t * 1e4)
    rows = np.column_stack([np.arange(len(ticks)), ticks, np.random.default_rng(6).normal(size=(len(ticks), 6))])
    (tmp_path / "dot.csv").write_text(names + text(rows, ","))
    with pytest.raises(RecordingError, match=r"without gravity \(FreeAcc_X, FreeAcc_Y, FreeAcc_Z\)"):
        mpucal.load(tmp_path / "dot.csv")


def test_packets_of_an_unknown_program_are_called_so(tmp_path):
    packets = np.random.default_rng(5).integers(0, 256, (900, 106), np.uint8)
    packets[:, :60] = np.arange(60)
    (tmp_path / "data.bin").write_bytes(packets.tobytes())
    with pytest.raises(RecordingError, match="packets of 106 bytes"):
        mpucal.load(tmp_path / "data.bin")


HEADS = [
    "Fs,100",
    "# Config: data_rate = 100.0 Hz, filter = 488 Hz, acc_range = 4 g",
    "OutputRate:,100Hz,,,",
    "Sample rate (Hz): 100",
]


@pytest.mark.parametrize("head", HEADS)
def test_a_rate_above_the_names_of_columns_is_read(head, even_walk, tmp_path):
    head = f"{head}\nLogging Type,1\nWaiting time,3\nax,ay,az,gx,gy,gz\n"
    (tmp_path / "walk.csv").write_text(head + text(counts(even_walk), ","))
    read = mpucal.load(tmp_path / "walk.csv")
    assert "a rate of 100 Hz, accelerations in counts of ±4 g (by |a|) and rates in counts of ±500 deg/s" in read.taken
    np.testing.assert_allclose(si(read), si(even_walk), atol=1.01 / COUNTS[0])


def test_files_of_a_folder_are_one_recording(even_walk, tmp_path):
    for name, part in (("b.txt", even_walk.part(700, 1400)), ("a.txt", even_walk.part(0, 700))):
        (tmp_path / name).write_text(poses(part))
    (tmp_path / "notes.txt").write_text("turned by hand\n")
    (tmp_path / "settings.json").write_text(json.dumps({"rate": 100}))
    read = mpucal.load(tmp_path)
    np.testing.assert_allclose(si(read), si(even_walk), atol=1e-9)
    assert np.flatnonzero(read.gap).tolist() == [700]
    assert "how the board turned between them is unknown: a.txt, b.txt." in read.taken


def test_what_was_read_without_rates_is_used_for_what_needs_none(tmp_path):
    whole = mpucal.load(FIXTURE, span=":50")
    (tmp_path / "walk.csv").write_text("ax,ay,az,gx,gy,gz\n" + text(counts(whole), ","))
    read = mpucal.load(tmp_path / "walk.csv")
    assert np.isnan(read.gyr).all()
    found = mpucal.calibrate(read)
    assert (found.verdict, found.fit["model"]) == ("usable", "static")
    assert 'id="accelerometer"' in render(found, read)
    assert mpucal.check(mpucal.calibrate(whole), read).verdict == "still good"
    with pytest.raises(RecordingError, match=r"was read without rates: .*--rate HZ"):
        mpucal.noise(tmp_path / "walk.csv")


def test_a_temperature_is_kept_everywhere(walk, tmp_path):
    warm = np.linspace(30.0, 32.0, len(walk))
    made = mpucal.Recording.from_arrays(walk.t, walk.acc, walk.gyr, temperature_c=warm)
    assert made.sensor.temperature_c == pytest.approx(31.0)
    np.savez(tmp_path / "a.npz", t=walk.t, acc=walk.acc, gyr=walk.gyr, temperature=warm)
    rows = np.column_stack([walk.t, si(walk), warm])
    for name, header in (("own", "temperature_c"), ("other", "Temp (°C)"), ("bare", "temp")):
        (tmp_path / f"{name}.csv").write_text(f"t,ax,ay,az,gx,gy,gz,{header}\n{text(rows, ',')}")
    for name in ("a.npz", "own.csv", "other.csv"):
        assert mpucal.load(tmp_path / name).sensor.temperature_c == pytest.approx(31.0)
        assert mpucal.calibrate(tmp_path / name).sensor.temperature_c == pytest.approx(31.0)
    rows[:, 7] = 4000
    (tmp_path / "counts.csv").write_text("time,ax,ay,az,gx,gy,gz,temp\n" + text(rows, ","))
    assert mpucal.load(tmp_path / "counts.csv").sensor.temperature_c is None


def test_a_slow_recording_is_called_slow(even_walk, tmp_path):
    slow = mpucal.Recording.from_arrays(np.arange(300) * 0.4, even_walk.acc[:300], even_walk.gyr[:300])
    (reason,) = [r for r in mpucal.calibrate(slow).quality["reasons"] if r["code"] == "units_suspect"]
    assert "0.4 s apart (2.5 Hz), too far to follow a turn" in reason["message"]


def as_sides(walk, path):
    """Write pairs of tables that are called after sides, with their rate in each, and a file of something else."""
    for k, side in enumerate(("x_up", "y_down")):
        part = walk.part(700 * k, 700 * (k + 1))
        savemat(path / f"{side}_accel.mat", {"accel": part.acc, "Fs": 50})
        savemat(path / f"{side}_gyro.mat", {"gyro": part.gyr, "Fs": 50})


def test_pairs_of_tables_of_sides_are_one_recording_at_the_rate_that_they_state(even_walk, tmp_path):
    as_sides(even_walk, tmp_path)
    read = mpucal.load(tmp_path, units="gyr=rad/s", rate=HZ)
    np.testing.assert_allclose(si(read), si(even_walk))
    assert np.flatnonzero(read.gap).tolist() == [700]
    assert mpucal.load(tmp_path / "x_up_accel.mat", units="gyr=rad/s").rate_hz == pytest.approx(50.0)


def test_a_file_of_a_folder_that_is_no_recording_is_left_out_and_said(even_walk, tmp_path):
    for name, part in (("a.npy", even_walk.part(0, 700)), ("b.npy", even_walk.part(700, 1400))):
        as_npy(part, tmp_path / name)
    savemat(tmp_path / "results.mat", {"accel_bias": np.zeros((3, 1)), "M_a": 0.005 * np.eye(3)})
    read = mpucal.load(tmp_path)
    assert len(read) == len(even_walk)
    assert "Left out were results.mat (" in read.taken


def vectornav(walk):
    rows = (f"+00.1,+00.2,+00.3,{','.join(f'{v:+.9f}' for v in row)},+26.8,+096.5" for row in si(walk))
    return "\n".join(f"$VNIMU,{row}*67" for row in rows) + "\n"


def axes_by_words(walk):
    at = (walk.t[:, None] * 1e3).round().astype(np.int64)[:, 0] + np.datetime64("2025-10-04T16:35:12.186", "ms")
    lines = zip(np.datetime_as_string(at).tolist(), walk.gyr.tolist(), walk.acc.tolist(), strict=True)
    text = "{},EULER(deg): R=1.7,GYRO: X={:.9f},Y={:.9f},Z={:.9f},ACCEL: X={:.9f},Y={:.9f},Z={:.9f},GPS: FIX,SAT=4"
    return "\n".join(text.format(at.replace("T", " "), *w, *a) for at, w, a in lines) + "\n"


def names_over_lines(walk):
    """Write the whole seconds and the microseconds of a time in columns of their own."""
    names = ['"Date\n(YY:MM:DD)"', '"Time\n(HH:MM:SS)"', '"Time\n(µs)"']
    names += [f'"A{axis}\n(m/s^2)"' for axis in "xyz"] + [f'"G{axis}\n(rad/s)"' for axis in "xyz"]
    us = np.rint(walk.t * 1e6).astype(np.int64).tolist()
    lines = (
        f"2021-09-22,13:11:{at // 10**6:02d},{at % 10**6},{','.join(map(str, row))}"
        for at, row in zip(us, si(walk).tolist(), strict=True)
    )
    return ",".join(names) + "\n" + "\n".join(lines) + "\n"


def minutes_of_a_spreadsheet(walk):
    """Write one time as a spreadsheet does that takes it for a date."""
    at = [f"{int(t) // 60 + 34}:{t % 60:05.2f}" for t in walk.t]
    at[500] = "6/25/2022 14:05"
    rows = [f"{','.join(map(str, row))},{t},1" for row, t in zip(si(walk).tolist(), at, strict=True)]
    return "accX,accY,accZ,gyroX,gyroY,gyroZ,timestamp,Activity\n" + "\n".join(rows) + "\n"


def a_bag_in_text(walk):
    """Write the text and covariances of messages between the numbers, with clocks that one word calls so."""
    cells = zip(walk.t.tolist(), walk.gyr.tolist(), walk.acc.tolist(), strict=True)
    rows = (f'{t},base,"[1.0, 0.0]",{",".join(map(str, w))},0.25,{",".join(map(str, a))}' for t, w, a in cells)
    return "bagTimestamp,frame_id,orientation,xav,yav,zav,cov,xla,yla,zla\n" + "\n".join(rows) + "\n"


def lines_of_json(walk):
    names = ("ax", "ay", "az", "gx", "gy", "gz")
    found = ({"mac_timestamp": t} | dict(zip(names, row, strict=True)) for t, row in rows_of(walk))
    return "".join(json.dumps(row) + "\n" for row in found)


def echoed(walk):
    """Write messages as `ros2 topic echo` prints them."""
    axes = "  x: {}\n  y: {}\n  z: {}\n"
    record = (
        "header:\n  stamp:\n    sec: {}\n    nanosec: {}\n  frame_id: imu\norientation:\n  x: 0.0\n  w: 1.0\n"
        f"angular_velocity:\n{axes}angular_velocity_covariance: [0.0, 0.0]\nlinear_acceleration:\n{axes}---\n"
    )
    ns = np.rint(walk.t * 1e9).astype(np.int64).tolist()
    numbers = zip(ns, walk.gyr.tolist(), walk.acc.tolist(), strict=True)
    return "".join(record.format(at // 10**9, at % 10**9, *w, *a) for at, w, a in numbers)


def of_a_satellite(walk):
    """Write a time under a name that no list holds, beside an index, of which one sample has that before."""
    t = np.where(np.arange(len(walk)) == 500, walk.t[499], walk.t) + 390884.272
    rows = np.column_stack([np.arange(len(walk)), t, si(walk)])
    return "N,GPST,Ax,Ay,Az,Gx,Gy,Gz\n" + text(rows, ",")


def rows_of(walk):
    return zip(walk.t.tolist(), si(walk).tolist(), strict=True)


FURTHER = [vectornav, axes_by_words, names_over_lines, minutes_of_a_spreadsheet, a_bag_in_text, lines_of_json]
FURTHER += [echoed, of_a_satellite]


@pytest.mark.parametrize("form", FURTHER)
def test_further_forms_are_read_at_the_first_try(form, even_walk, tmp_path):
    (tmp_path / "walk.csv").write_text(form(even_walk), encoding="utf-8")
    read = mpucal.load(tmp_path / "walk.csv")
    np.testing.assert_allclose(si(read), si(even_walk), atol=1e-8)
    assert read.rate_hz == pytest.approx(HZ, rel=0.15 if form is vectornav else 1e-6)


def test_a_board_that_never_turned_has_an_accelerometer_all_the_same(even_walk, tmp_path):
    """Name no rates, which nothing shows."""
    rng = np.random.default_rng(7)
    acc = np.array([9.85, 0.1, -0.3]) + rng.normal(0, 0.05, (900, 3))
    still = np.column_stack([rng.normal(0, 0.004, (900, 3)), acc])
    (tmp_path / "x_up.txt").write_text(text(np.column_stack([254500 + np.arange(900) / HZ, still])))
    read = mpucal.load(tmp_path / "x_up.txt")
    assert "its columns were guessed from the length of gravity: --columns t,-,-,-,ax,ay,az" in read.taken
    np.testing.assert_allclose(read.acc, still[:, 3:])
    assert np.isnan(read.gyr).all()


def objects(walk):
    return [{"t": t, "acc": dict(zip("xyz", row[:3], strict=True)), "gyro": row[3:]} for t, row in rows_of(walk)]


def columns_of_json(walk):
    return {"imu": {"timestamp": walk.t.tolist(), "accel": walk.acc.tolist(), "gyro": walk.gyr.tolist()}, "n": 3}


def edge_impulse(walk):
    names = [f"{of}{axis}" for of in ("acc", "gyr") for axis in "XYZ"]
    units = ["m/s2"] * 3 + ["rad/s"] * 3
    sensors = [{"name": name, "units": unit} for name, unit in zip(names, units, strict=True)]
    return {"payload": {"interval_ms": 1000 / HZ, "sensors": sensors, "values": si(walk).tolist()}}


def edge_impulse_without_units(walk):
    document = edge_impulse(walk)
    for sensor in document["payload"]["sensors"]:
        del sensor["units"]
    return document


def at_a_frequency(walk):
    """Write many more values of another sensor, at another rate."""
    data = [{"gyroscope": row[3:], "acceleration": row[:3]} for _, row in rows_of(walk)]
    return {"at": "26/06/20", "emg": {"data": [[0] * 8] * 4000}, "imu": {"frequency": HZ, "data": data}}


@pytest.mark.parametrize("form", [objects, columns_of_json, edge_impulse, edge_impulse_without_units, at_a_frequency])
def test_samples_in_json_are_read_at_the_first_try(form, even_walk, tmp_path):
    (tmp_path / "walk.json").write_text(json.dumps(form(even_walk)))
    read = mpucal.load(tmp_path / "walk.json")
    np.testing.assert_allclose(si(read), si(even_walk), atol=1e-12)
    assert read.rate_hz == pytest.approx(HZ, rel=1e-6)


def test_an_object_on_each_line_of_which_the_last_is_torn(even_walk, tmp_path):
    (tmp_path / "walk.jsonl").write_text(lines_of_json(even_walk) + '{"mac_timestamp": 14.0, "ax"')
    np.testing.assert_allclose(si(mpucal.load(tmp_path / "walk.jsonl")), si(even_walk))


@pytest.mark.parametrize("content", ["[1, 2", "{}", '{"rates": [1.0, "a", null]}', "[" * 9000])
def test_json_that_is_no_recording(content, tmp_path):
    path = tmp_path / "walk.json"
    path.write_text(content + " " * 9 + "\n" + "," * 300 * content.startswith("[["))
    with pytest.raises(RecordingError, match=r"is not a recording that mpucal knows|is not a whole file"):
        mpucal.load(path)


def test_a_calibration_is_no_recording(even_walk, tmp_path):
    mpucal.calibrate(even_walk).save(tmp_path / "calibration.json")
    with pytest.raises(RecordingError, match="is not a recording that mpucal knows"):
        mpucal.load(tmp_path / "calibration.json")


def test_two_tables_of_marked_lines_without_names(even_walk, tmp_path):
    """Tell their unit by how gravity turns."""
    for name, values in (("acceleration", even_walk.acc / G), ("gyroscope", np.degrees(even_walk.gyr))):
        rows = text(np.column_stack([even_walk.t * 1e3, values]), ",").splitlines()
        (tmp_path / f"{name}_20180927.csv").write_text("".join(f"{name},{row}\n" for row in rows))
    read = mpucal.load(tmp_path / "gyroscope_20180927.csv")
    assert "accelerations in g and rates in deg/s" in read.taken
    np.testing.assert_allclose(si(read), si(even_walk))


def test_times_that_begin_anew_are_an_interruption(even_walk, tmp_path):
    """Tell a sketch that is started again from a clock that is set back a little."""
    half = len(even_walk) // 2
    t = np.where(np.arange(len(even_walk)) < half, even_walk.t, even_walk.t - even_walk.t[half])
    t[half + 300] -= 0.02
    (tmp_path / "walk.csv").write_text(
        "t,ax,ay,az,gx,gy,gz,n\n" + text(np.column_stack([t, si(even_walk), t * 0]), ",")
    )
    read = mpucal.load(tmp_path / "walk.csv", units="acc=m/s^2,gyr=rad/s")
    assert "times in s, which begin anew 1 times," in read.taken
    np.testing.assert_array_equal(si(read), si(even_walk))
    assert np.flatnonzero(read.gap).tolist() == [half]
    assert np.diff(read.t)[half - 1] == pytest.approx(15.0, abs=0.02)


def still(unit_in_rad_s, shaking_mps2, seed=3):
    """Return accelerations and rates in a unit, of a board that is shaken and hardly turned."""
    rng = np.random.default_rng(seed)
    rates = np.radians(rng.normal((0.3, -0.5, 0.2), 0.05, (900, 3)))
    rates[300:] += rng.normal(0.0, 0.2, (600, 3))
    return np.array([0.1, -0.2, G]) + rng.normal(0, shaking_mps2, (900, 3)), rates / unit_in_rad_s


@pytest.mark.parametrize(("unit", "si_of_it"), [("rad/s", 1.0), ("deg/s", np.radians(1))])
def test_the_unit_of_rates_that_turn_nothing_is_one_of_a_gyroscope(unit, si_of_it, tmp_path):
    acc, rates = still(si_of_it, 0.5)
    rows = np.column_stack([np.arange(900) / HZ, acc, rates])
    (tmp_path / "shaken.csv").write_text("time,accX,accY,accZ,gyroX,gyroY,gyroZ\n" + text(rows, ","))
    read = mpucal.load(tmp_path / "shaken.csv")
    assert f"rates in {unit} (by their noise and bias, as gravity hardly turns)" in read.taken
    np.testing.assert_allclose(read.gyr, rates * si_of_it)


def test_the_command_for_unknown_columns_gives_the_clock_its_place(even_walk, tmp_path):
    """Read a runner's counts, whose |a| is no gravity, by their mean."""
    rng = np.random.default_rng(5)
    acc = np.array([0.0, 4000.0, 7150.0]) + rng.normal(0.0, 6000.0, (900, 3))
    rows = np.column_stack([100 + 20 * np.arange(900), acc.clip(-32768, 32767), rng.normal(0, 900.0, (900, 3))])
    (tmp_path / "running.csv").write_text(text(np.rint(rows).astype(int), ","))
    with pytest.raises(RecordingError) as refused:
        mpucal.load(tmp_path / "running.csv")
    assert refused.value.options == "--columns t,ax,ay,az,gx,gy,gz"
    read = mpucal.load(tmp_path / "running.csv", columns="t,ax,ay,az,gx,gy,gz")
    assert "times in ms, accelerations in counts of ±4 g (by |a|)" in read.taken


@pytest.mark.parametrize(
    "text", ['{"acc": [' + "1," * 300, '{"values": [' + ",".join(["[NaN,Infinity,1,2,3,4]"] * 300) + "]}"]
)
def test_json_without_samples_is_refused(text, tmp_path):
    (tmp_path / "walk.json").write_text(text)
    with pytest.raises(RecordingError, match="holds no columns that are known"):
        mpucal.load(tmp_path / "walk.json")


@pytest.mark.parametrize(
    ("name", "head"), [("avAccelerometer.csv", "t,X,Y,Z"), ("a.csv", "t,X (m/s^2),Y (m/s^2),Z (m/s^2)")]
)
def test_three_axes_are_those_of_their_unit_or_of_the_files_name(name, head, even_walk, tmp_path):
    (tmp_path / name).write_text(head + "\n" + text(np.column_stack([even_walk.t, even_walk.acc]), ","))
    np.testing.assert_array_equal(mpucal.load(tmp_path / name).acc, even_walk.acc)


def driven(order):
    """Return an index, times, rates, accelerations in that order, and a magnetic field: of a car, without names."""
    rng = np.random.default_rng(8)
    acc, rates = np.array([0.0, 0.0, G]) + rng.normal(0.0, 6.0, (900, 3)), rng.normal(0.0, 0.1, (900, 3))
    sensors = {"acc": acc, "gyr": rates, "mag": np.array([20.0, -4.0, 40.0]) + rng.normal(0.0, 1.0, (900, 3))}
    n = np.arange(900)
    return np.column_stack([14953 + n, 4908.696 + n / HZ, *(sensors[of] for of in order.split())])


@pytest.mark.parametrize(
    ("order", "said"),
    [("gyr acc", "-,t,gx,gy,gz,ax,ay,az"), ("acc mag gyr", "-,t,ax,ay,az,-,-,-,gx,gy,gz"), ("gyr mag", None)],
)
def test_the_command_for_unknown_columns_works_at_once(order, said, tmp_path):
    (tmp_path / "drive.txt").write_text(text(driven(order)))
    with pytest.raises(RecordingError) as refused:
        mpucal.load(tmp_path / "drive.txt")
    if said is None:
        assert "holds no three columns as long as gravity" in str(refused.value)
        return
    assert refused.value.options == f"--columns {said} --units acc=m/s^2"
    read = mpucal.load(tmp_path / "drive.txt", columns=said, units="acc=m/s^2")
    assert "times in s, accelerations in m/s^2 and rates" in read.taken


def test_the_range_of_counts_is_not_misled_by_large_biases(even_walk, tmp_path):
    """Read a sensor whose |a| varies with its orientation, by biases of half of 1 g."""
    biased = replace(even_walk, acc=even_walk.acc + 0.45 * G * np.array([1.0, -0.6, 0.8]))
    size = np.linalg.norm(biased.acc, axis=1)
    assert np.ptp(np.percentile(size, [25, 75])) > 0.25 * np.median(size)
    (tmp_path / "walk.csv").write_text("ax,ay,az,gx,gy,gz\n" + text(counts(biased, 16), ","))
    assert "accelerations in counts of ±16 g (by |a|)" in mpucal.load(tmp_path / "walk.csv", rate=HZ).taken
