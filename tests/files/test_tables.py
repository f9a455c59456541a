"""Tables of text as programs and people write them: each form is a row of data, and gives the walk's samples back."""

import contextlib
import csv
import shutil
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import mpucal
from mpucal.data import STANDARD_GRAVITY_MPS2 as G
from mpucal.errors import RecordingError, UsageError
from mpucal.files import load, open_rows, open_writer
from mpucal.files.hints import Hints, parse_columns, parse_units
from mpucal.files.rows import Rows
from mpucal.files.tables.units import QUANTITIES

CAPTURE = Path(__file__).parents[2] / "fixtures" / "sessions" / "enter.mcap"
COUNTS = np.r_[[32768 / (4 * G)] * 3, [32750 / np.radians(500)] * 3]
STAMPS = np.datetime64("2025-10-04T16:35:12")


def counts(walk):
    """Return the samples in counts of ±4 g and ±500 deg/s, (n, 6)."""
    return np.rint(np.column_stack([walk.acc, walk.gyr]) * COUNTS).astype(int)


def dates(walk):
    return STAMPS + np.rint(walk.t * 1e6).astype("m8[us]")


def minutes(walk):
    """Return times as a spreadsheet writes them that takes one of them for a date."""
    at = [f"{int(t) // 60 + 34}:{t % 60:05.2f}" for t in walk.t.tolist()]
    at[300:301] = ["6/25/2022 14:05"] * (len(at) > 300)
    return at


# word of a form -> its columns of the walk, (n,) or (n, k)
COLUMNS = {
    "i": lambda w, ns: np.arange(len(w)),
    "t": lambda w, ns: w.t,
    "later": lambda w, ns: w.t + 390884.272,
    "ms": lambda w, ns: w.t * 1000,
    "us": lambda w, ns: w.t * 1e6,
    "ns": lambda w, ns: ns,
    "sec": lambda w, ns: ns // 10**9,
    "nanosec": lambda w, ns: ns % 10**9,
    "ticks": lambda w, ns: 10259826 + np.rint(w.t * 1e4).astype(int),
    "date": lambda w, ns: dates(w).astype(str),
    "utc": lambda w, ns: [f"{date}Z" for date in dates(w).astype(str)],
    "clock": lambda w, ns: [f"{date}".partition("T")[2][:8] for date in dates(w)],
    "clock.": lambda w, ns: [f"{date}".partition("T")[2] for date in dates(w)],
    "clock,": lambda w, ns: [f"{date}".partition("T")[2].replace(".", ",") for date in dates(w)],
    "am": lambda w, ns: [f"{date.item():%m/%d/%Y %I:%M:%S.%f %p}" for date in dates(w)],
    "german": lambda w, ns: [f"{date.item():%d.%m.%Y %H:%M:%S,%f}" for date in dates(w)],
    "matlab": lambda w, ns: [f"{date.item():%d-%b-%Y %H:%M:%S.%f}" for date in dates(w)],
    "points": lambda w, ns: [f"{date.item():%H.%M.%S.%f}" for date in dates(w)],
    "colon": lambda w, ns: [f"{date.item():%H:%M:%S:%f}" for date in dates(w)],
    "zone": lambda w, ns: [f"{date.item():%Y-%m-%d %H:%M:%S.%f} UTC" for date in dates(w)],
    "days": lambda w, ns: [f"0 days 00:00:{t:09.6f}" for t in w.t],
    "tick": lambda w, ns: 421 + np.rint(w.t * 1000).astype(int),
    "epoch": lambda w, ns: ns // 10**6,
    "micros": lambda w, ns: dates(w).astype(int) % 10**6,
    "minutes": lambda w, ns: minutes(w),
    "serial": lambda w, ns: 45413.5 + w.t / 86400,
    "min": lambda w, ns: w.t / 60,
    "h": lambda w, ns: 0.25 + w.t / 3600,
    "dashes": lambda w, ns: [f"{date.item():%Y-%-m-%-d--%H-%M-%S-%f}"[:-3] for date in dates(w)],
    "unpadded": lambda w, ns: [f"12:{n // 600:02}:{n // 10 % 60:02}.{n % 10 * 100 + 50}" for n in range(len(w))],
    "overflow": lambda w, ns: (2**32 - 3_000_000 + np.rint(w.t * 1e6).astype(np.int64)) % 2**32,
    "digits": lambda w, ns: [f"{date.item():%Y%m%d%H%M%S%f}"[:-3] for date in dates(w)],
    "hhmmss": lambda w, ns: [f"{date.item():%H%M%S.%f}" for date in dates(w) + 45_000_000],
    "hhmmssmmm": lambda w, ns: [f"{date.item():%H%M%S%f}"[:-3] for date in dates(w) + 45_000_000],
    "a": lambda w, ns: w.acc,
    "zyx": lambda w, ns: w.acc[:, ::-1],
    "g": lambda w, ns: w.acc / G,
    "mg": lambda w, ns: w.acc / G * 1000,
    "-g": lambda w, ns: -w.acc / G,
    "-gzyx": lambda w, ns: -w.acc[:, ::-1] / G,
    "w": lambda w, ns: w.gyr,
    "wzyx": lambda w, ns: w.gyr[:, ::-1],
    "dps": lambda w, ns: np.degrees(w.gyr),
    "mrad": lambda w, ns: w.gyr * 1000,
    "dph": lambda w, ns: np.degrees(w.gyr) * 3600,
    "field": lambda w, ns: 0.01 * w.acc,
    "jerk": lambda w, ns: 0.3 * w.gyr,
    "000": lambda w, ns: 0.0 * w.acc,
    "counts": lambda w, ns: counts(w),
    "hex": lambda w, ns: [[f"0x{of % 65536:04X}" for of in row] for row in counts(w).tolist()],
    "20_bits": lambda w, ns: np.rint(np.column_stack([w.acc, w.gyr]) * COUNTS * 16).astype(int),
    "1024": lambda w, ns: np.rint(w.acc * 1024 / G).astype(int),
    "rates": lambda w, ns: counts(w)[:, 3:],
    "bno055": lambda w, ns: np.rint(np.column_stack([w.acc * 100, np.degrees(w.gyr) * 16])).astype(int),
    "unsigned": lambda w, ns: counts(w) % 65536,
    "upward": lambda w, ns: counts(w) + 32768,
    "24_bits": lambda w, ns: np.rint(np.column_stack([w.acc, w.gyr]) * COUNTS * 256).astype(int),
    "unsigned_20": lambda w, ns: counts(w) * 16 % 2**20,
    "upward_12": lambda w, ns: np.rint(counts(w) / 16).astype(int) + 2048,
}


def in_unit(word, walk):
    """Return a sensor's samples in the unit of a word such as gyr:rpm; any other word for each sample."""
    of, _, unit = word.partition(":")
    return {"acc": walk.acc, "gyr": walk.gyr}[of] / QUANTITIES[of][unit] if unit else [word] * len(walk)


def lines(line, spec, walk, ns):
    """Return lines with the columns of `spec`, whose other words all lines repeat.

    Parameters
    ----------
    line : a separator, or a line with {} for each column.
    """
    cells = []
    for word in spec.split():
        made = np.asarray(COLUMNS[word](walk, ns) if word in COLUMNS else in_unit(word, walk))
        cells += [column.tolist() for column in (made.T if made.ndim == 2 else (made,))]
    line = line if "{" in line else line.join(["{}"] * len(cells)) + "\n"
    return "".join(line.format(*row) for row in zip(*cells, strict=True))


@dataclass(frozen=True)
class Form:
    """A form of a table.

    Attributes
    ----------
    head : the text above. line, spec : see lines. file : its name. says : text of the recording's `taken`.
    hints : words of mpucal.load. atol : of accelerations and rates. edit : of the whole text.
    samples : of the walk that it needs, to be told from others.
    """

    head: str
    spec: str
    line: str = ","
    file: str = "walk.csv"
    says: str = "times in"
    hints: dict = None
    atol: float = 1e-9
    edit: tuple = ()
    samples: int = 500

    def text(self, walk, ns):
        """Return the whole text."""
        text = self.head + lines(self.line, self.spec, walk, ns)
        return text.replace(*self.edit) if self.edit else text

    def write(self, path, walk, ns):
        """Write it."""
        path.write_text(self.text(walk, ns), encoding="utf-8")


AT_100_HZ = {"rate": 100.0}
IN_COUNTS = 1.01 / COUNTS[0]
AXES = "ax,ay,az,gx,gy,gz\n"
ANDROSENSOR = (
    "ACCELEROMETER X (m/s²);ACCELEROMETER Y (m/s²);ACCELEROMETER Z (m/s²);GRAVITY X (m/s²);LINEAR ACCELERATION X (m/s²)"
    ";LINEAR ACCELERATION Y (m/s²);LINEAR ACCELERATION Z (m/s²);GYROSCOPE X (rad/s);GYROSCOPE Y (rad/s)"
    ";GYROSCOPE Z (rad/s);Time since start in ms \n"
)
A_LOG = 300 * "ESP-ROM:esp32c3-api1-20210207\r\n" + "self_test accel=(17020,-1262) baseline_gyro=(645,315,-309)\r\n"
MT_MANAGER = "// General information:\n//  MT Manager version: 2022.0.0\n// Coordinate system: ENU\n"
ECHO = (
    "header:\n  stamp:\n    sec: {}\n    nanosec: {}\n  frame_id: imu\norientation:\n  x: 0.0\n  w: 1.0\n"
    "angular_velocity:\n  x: {}\n  y: {}\n  z: {}\nangular_velocity_covariance: [0.0, 0.0]\n"
    "linear_acceleration:\n  x: {}\n  y: {}\n  z: {}\n---\n"
)
OVER_LINES = '"Date\n(YY:MM:DD)","Time\n(HH:MM:SS)","Time\n(µs)",' + ",".join(
    f'"{of}{axis}\n({unit})"' for of, unit in (("A", "m/s^2"), ("G", "rad/s")) for axis in "xyz"
)
SKETCH = "millis,AccX,AccY,AccZ,GyroX,GyroY,GyroZ\n"
SENSOR_LOGGER = "seconds_elapsed," + ",".join(
    f"{of}_{axis}" for of in ("accelerometer", "totalAcceleration", "gyroscope") for axis in "zyx"
)
IN_ORDER, IN_UNITS = "t,ax,ay,az,gx,gy,gz", {"units": "t=ms,acc=g,gyr=deg/s"}
UNITS = ("cm/s^2", "rad/s"), ("mm/s^2", "mdeg/s"), ("ft/s^2", "mrad/s"), ("ug", "udeg/s"), ("g", "deg/h"), ("mg", "rpm")
BESIDE_WORDS = "device,when,AccX(g),AccY(g),AccZ(g),wx,wy,wz\n"
BY_GRAVITY = "its columns were guessed from how gravity turns: --columns "
FORMS = {
    "EuRoC": Form(
        "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1]"
        ",a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n",
        "ns w a",
    ),
    "Kalibr": Form("timestamp,omega_x,omega_y,omega_z,alpha_x,alpha_y,alpha_z\n", "ns w a"),
    "rostopic echo -p": Form(
        "%time,field.header.stamp,field.orientation.x,field.angular_velocity.x,field.angular_velocity.y"
        ",field.angular_velocity.z,field.linear_acceleration.x,field.linear_acceleration.y,field.linear_acceleration.z\n",
        "0 ns 0 w a",
    ),
    "ulog2csv": Form(
        "timestamp,gyro_rad[0],gyro_rad[1],gyro_rad[2],gyro_integral_dt"
        ",accelerometer_m_s2[0],accelerometer_m_s2[1],accelerometer_m_s2[2]\n",
        "us w 5000 a",
    ),
    "AndroSensor": Form(ANDROSENSOR.replace(";", ","), "a 0 000 w ms"),
    "AndroSensor, `;` and decimal commas": Form(
        ANDROSENSOR, "a 0 000 w ms", ";", edit=(".", ","), says="separated by semicolons"
    ),
    "Physics Toolbox": Form("time,gFx,gFy,gFz,ax,ay,az,wx,wy,wz\n", "t g jerk w"),
    "SensorLog": Form(
        "accelerometerTimestamp_sinceReboot(s),accelerometerAccelerationX(G),accelerometerAccelerationY(G)"
        ",accelerometerAccelerationZ(G),gyroTimestamp_sinceReboot(s),gyroRotationX(rad/s),gyroRotationY(rad/s)"
        ",gyroRotationZ(rad/s),motionUserAccelerationX(G),motionUserAccelerationY(G),motionUserAccelerationZ(G)\n",
        "t -g t w 000",
        says="the opposite sign, as on iOS",
    ),
    "a sketch in g and deg/s": Form(f"sep=,\nMPU6050 found!\n\n{SKETCH}", "ms g dps"),
    "units in names": Form("time_us,acc_x_mg,acc_y_mg,acc_z_mg,gyro_x_dps,gyro_y_dps,gyro_z_dps\n", "us mg dps"),
    "MARS logger": Form(
        "Timestamp[nanosec], gx[rad/s], gy[rad/s], gz[rad/s], ax[m/s^2], ay[m/s^2], az[m/s^2]\n", "ns w a"
    ),
    "WitMotion": Form(
        "Time(s)\tax(g)\tay(g)\taz(g)\twx(deg/s)\twy(deg/s)\twz(deg/s)\tT(°)\n", "date g dps 25", "\t", says="by tabs"
    ),
    "axes first": Form("t\txacc\tyacc\tzacc\txgyro\tygyro\tzgyro\n", "t a w", "\t", "walk.tsv"),
    "poses in TUM's style": Form("# time tx ty tz wx wy wz mx my mz\n", "later a w field", " ", "poses.txt"),
    "two lines of names": Form(
        "Time;Reference;;;;IMU Acceleration;;;IMU Gyroscope;;\ns;W;X;Y;Z;X;Y;Z;X;Y;Z\n", "t .5 .5 .5 .5 a w", ";"
    ),
    "units below the names": Form(
        "time\tS_ax_CAL\tS_ay_CAL\tS_az_CAL\tS_gx_CAL\tS_gy_CAL\tS_gz_CAL\n"
        "ms\tm/(s^2)\tm/(s^2)\tm/(s^2)\trad/s\trad/s\trad/s\n",
        *("ms a w", "\t"),
        hints={"columns": "t=time," + ",".join(f"{name}=S_{name}_CAL" for name in AXES.strip().split(","))},
    ),
    "a log of a board": Form(
        *(A_LOG, "counts", "RAW 0x68: accel=({}, {}, {}) temp_raw=4000 gyro=({}, {}, {})\r\nadvanced fifo_end\r\n"),
        *("board.log", "counts of ±4 g (by |a|)", AT_100_HZ, IN_COUNTS),
    ),
    "times of day in digits": Form(f"time,{AXES}", "hhmmss a w"),
    "times of day with points": Form(f"time,{AXES}", "points a w"),
    "times of day in whole digits": Form(f"time,{AXES}", "hhmmssmmm a w"),
    "times of day in digits under our own names": Form(f"t,{AXES}", "hhmmss a w", says="times in s"),
    "a BNO055": Form(f"time,{AXES}", "ms bno055", says="cm/s^2 and rates in deg/s/16", atol=6e-3),
    "counts beside what was made of them": Form(
        "sample,time_s,ax_raw,ay_raw,az_raw,gx_raw,gy_raw,gz_raw,ax_m_s2,ay_m_s2,az_m_s2,gx_deg_h,gy_deg_h,gz_deg_h\n",
        *("i t counts a dph", ","),
        says="accelerations in m/s^2 and rates in deg/h",
    ),
    "MT Manager": Form(
        f"{MT_MANAGER}PacketCounter\tSampleTimeFine\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z\tRoll\n",
        *("i ticks a w 1.0", "\t", "MT Manager.txt"),
    ),
    "zeros and a second header": Form(
        "timestamp_us," + AXES + "\0" * 400 + "timestamp_us," + AXES, "us counts", atol=IN_COUNTS, says="counts"
    ),
    "counts without a sign": Form("", "ms unsigned 3 0 4", "\t", "walk.txt", says="counts", atol=IN_COUNTS),
    "counts from the lowest on": Form("", "t upward", " ", "walk.txt", says="counts", atol=IN_COUNTS),
    "counts of 20 bits without a sign": Form(f"ms,{AXES}", "ms unsigned_20", says="±0.25 g", atol=IN_COUNTS),
    "counts of 12 bits from the lowest on": Form(
        f"ms,{AXES}", "ms upward_12", says="±64 g", atol=9 * IN_COUNTS, samples=1000
    ),
    "a sketch's counts": Form(AXES, "counts", hints=AT_100_HZ, atol=IN_COUNTS, says="±500 deg/s (by how gravity"),
    "a rocket's": Form(
        "state,timestamp_seconds,temperature_celsius,raw_acceleration_x_gs,raw_acceleration_y_gs,raw_acceleration_z_gs"
        ",raw_angular_rate_x_deg_per_s,raw_angular_rate_y_deg_per_s,raw_angular_rate_z_deg_per_s\n",
        "S t 26.3 g dps",
    ),
    "RaceBox": Form(
        "Record,Time,Latitude,Altitude,GForceX,GForceY,GForceZ,Lap,GyroX,GyroY,GyroZ\n", "i t 53.3 133.0 g 0 dps"
    ),
    "VectorNav": Form(
        "",
        "a w",
        "$VNIMU,+00.1,+00.2,+00.3" + ",{:+.9f}" * 6 + ",+26.8,+096.5*67\n",
        says="rates in rad/s.",
        hints=AT_100_HZ,
    ),
    "VectorNav's attitudes": Form(
        *("", "a w", "$VNYMR,-165.9,-037.2,+001.2,+0.28,+0.07,+0.74" + ",{:+.9f}" * 6 + "*69\n"),
        says="rates in rad/s.",
        hints=AT_100_HZ,
    ),
    "axes of two words": Form(
        *("", "w a"),
        "[IMU] Orientation: (0, 0, 0, 1), Angular Velocity: ({}, {}, {}), Linear Acceleration: ({}, {}, {})\n",
        says="rates in rad/s.",
        hints=AT_100_HZ,
    ),
    "MPU6050_raw": Form(
        *("Initializing I2C devices...\r\n", "counts", "a/g:\t{}\t{}\t{}\t{}\t{}\t{}\r\n", "walk.txt", "±4 g"),
        *({"rate": 100.0, "accel_range": 4.0, "gyro_range": 500.0}, IN_COUNTS),
    ),
    "axes by words": Form(
        *("", "date w a"),
        "{},EULER(deg): R=1.7,GYRO: X={},Y={},Z={},ACCEL: X={},Y={},Z={},GPS: FIX,SAT=4\n",
        edit=("T", " "),
    ),
    "names over lines": Form(f"{OVER_LINES}\n", "2021-09-22 clock micros a w"),
    "minutes of a spreadsheet": Form("accX,accY,accZ,gyroX,gyroY,gyroZ,timestamp,Activity\n", "a w minutes 1"),
    "a bag in text": Form(
        "bagTimestamp,frame_id,orientation,xav,yav,zav,cov,xla,yla,zla\n",
        *("t w a", '{},base,"[1.0, 0.0]",{},{},{},0.25,{},{},{}\n'),
    ),
    "lines of JSON": Form(
        *("", "t a w"), '{{"mac_timestamp": {}, "ax": {}, "ay": {}, "az": {}, "gx": {}, "gy": {}, "gz": {}}}\n'
    ),
    "ros2 topic echo": Form("", "sec nanosec w a", ECHO),
    "a satellite's time beside an index": Form(
        "N,GPST,Ax,Ay,Az,Gx,Gy,Gz\n", "i later a w", edit=("390886.272", "390886.262")
    ),
    "Sensor Logger on iOS, one table": Form(
        f"{SENSOR_LOGGER},{','.join(f'accelerometerUncalibrated_{axis}' for axis in 'zyx')}\n",
        *("t field -gzyx wzyx -gzyx", ","),
        says="the opposite sign, as on iOS",
    ),
    "Sensor Logger without a sign": Form(
        f"{SENSOR_LOGGER}\n", "t field zyx wzyx", says="if an iPhone recorded them, it is the opposite one"
    ),
    "lines that name each number": Form(
        *("MPU6050 Found!\n", "a w t", "AccelX:{},AccelY:{},AccelZ:{}, GyroX:{},GyroY:{},GyroZ:{},t:{}\n", "walk.txt")
    ),
    "lines with = and |": Form(
        *("", "a w t", "AcX = {} | AcY = {} | AcZ = {} | Tmp = 25.31 | GyX = {} | GyY = {} | GyZ = {} | t = {}\n")
    ),
    "lines with units, seen on a serial monitor": Form(
        *("", "a w t"),
        "12:34:56.789 -> acc x: {} m/s^2 acc y: {} acc z: {} m/s^2 gyro x: {} rad/s gyro y: {} gyro z: {} t: {}\n",
    ),
    "a line for each sensor": Form(
        *("MPU6050 Found!\r\n", "a w"),
        "Acceleration X: {:.4f}, Y: {:.4f}, Z: {:.4f} m/s^2\r\n"
        "Rotation X: {:.5f}, Y: {:.5f}, Z: {:.5f} rad/s\r\nTemperature: 25.00 degC\r\n\r\n",
        hints=AT_100_HZ,
        says="a rate of 100 Hz",
        atol=1e-4,
    ),
    "a table on a serial monitor": Form(
        f"12:34:56.789 -> time,{AXES}", "t a w", "12:34:56.789 -> {},{},{},{},{},{},{}\n"
    ),
    "seconds and nanoseconds": Form(f"header.stamp.sec,header.stamp.nanosec,{AXES}", "sec nanosec a w"),
    "a time under an unknown name": Form(f"Line,Ticks,{AXES}", "i t a w", says="Ticks is taken for the time"),
    # dates and times of day beside columns whose names are unknown
    "dates under an unknown name": Form("Quando,pA,pB,pC,qA,qB,qC\n", "utc a w", says=f"{BY_GRAVITY}t,ax"),
    "times of day beside dates": Form("D,H,pA,pB,pC,qA,qB,qC\n", "2024-05-01 clock. a w", says=f"{BY_GRAVITY}-,t,ax"),
    "a spreadsheet's own names": Form(
        "Uhrzeit;Beschl. X;Beschl. Y;Beschl. Z;Drehrate X;Drehrate Y;Drehrate Z\n",
        *("clock, a dps", "{};" * 6 + "{}\n", "walk.csv", "--columns t,ax"),
    ),
    "days first": Form("Zeit;ax;ay;az;gx;gy;gz\n", "german a w", ";"),
    "hours until noon": Form("Stamp of the day,pA,pB,pC,qA,qB,qC\n", "am g dps", says="accelerations in g"),
    "MATLAB's dates": Form("Timestamp,X,Y,Z,X_1,Y_1,Z_1\n", "matlab a w"),
    "MATLAB's durations": Form(f"Time,{AXES}", "t a w", "{} sec,{},{},{},{},{},{}\n", says="times in s,"),
    "units in each cell": Form(f'"Time",{AXES}', "date a w", '"{}"' + ',"{} m/s²"' * 3 + ',"{} rad/s"' * 3 + "\n"),
    "an index of dates without a name": Form(f",{AXES}", "utc a w"),
    "milliseconds after a colon": Form(f"Time,{AXES}", "colon a w"),
    "pandas' durations": Form(f",{AXES}", "days a w"),
    "a zone in letters": Form("created_at,entry_id,f1,f2,f3,f4,f5,f6\n", "zone i a w", says=f"{BY_GRAVITY}t,-,ax"),
    "ros2 topic echo --csv": Form("", "sec nanosec imu_link 0.0 a w 0.0", says=f"{BY_GRAVITY}t,-,-,-,ax"),
    "journalctl": Form(
        *("", "clock. a w", "May 01 {} pi python3[812]: ax={} ay={} az={} gx={} gy={} gz={}\n", "walk.log")
    ),
    "a temperature T": Form(
        *("", "g dps 25.1", "Ax= {}\tAy= {}\tAz= {}\tGx= {}\tGy= {}\tGz= {}\tT= {}\n", "walk.txt", "a rate of 100 Hz"),
        AT_100_HZ,
    ),
    "a rate in a comment": Form(f"# fs = 100 Hz\n# {AXES}", "counts", says="a rate of 100 Hz", atol=IN_COUNTS),
    "a suffix that no format has": Form("LabVIEW\t\n\nX_Value\tax\tay\taz\tgx\tgy\tgz\n", "t a w", "\t", "walk.lvm"),
    # lines of a terminal, with its times before them
    "times of PlatformIO": Form(
        f"--- Terminal on /dev/ttyUSB0 | 115200 8-N-1\n12:34:56.789 > {AXES}",
        *("clock. a w", "{} > " + ",".join(["{}"] * 6) + "\n"),
    ),
    "times in brackets": Form("", "date a w", "[{}] {},{},{},{},{},{}\n", "walk.log", BY_GRAVITY, edit=("T", " ")),
    "Python's logging": Form(
        *("", "clock, a w", "2024-05-01 {} - INFO - {}, {}, {}, {}, {}, {}\n", "walk.log", BY_GRAVITY)
    ),
    "numbers of rows without a name": Form(f"time,{AXES}", "i t a w"),
    "numbers of rows at the end": Form(
        "time_stamp acc_x acc_y acc_z angular_x angular_y angular_z\n", "t a w i", " ", "walk.txt"
    ),
    "days": Form(f"Time,{AXES}", "serial a w", says="times in days"),
    "minutes by name": Form(f"Time (min),{AXES}", "min a w", says="times in min,"),
    "hours by name": Form(f"time [h],{AXES}", "h a w", says="times in h,"),
    "a date with dashes alone": Form(f"Time,{AXES}", "dashes a w", says="times in ns"),
    "Xsens MTi without a heading": Form(
        "PacketCounter,SampleTimeFine,Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z\n", "i ticks a w", says="times in 0.1ms"
    ),
    "a counter that overflows": Form(
        f"micros,{AXES}", "overflow a w", says="times in us, whose counter overflows once"
    ),
    "a date in digits": Form(f"Time,{AXES}", "digits a w", says="times in ns"),
    "Movella DOT": Form(
        "PacketCounter,SampleTimeFine,Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z\n", "i us a dps", says="times in us"
    ),
    "units in brackets below the names": Form(
        f"Time,{AXES}(s),(g),(g),(g),(deg/s),(deg/s),(deg/s)\n", "t g dps", says="accelerations in g"
    ),
    "a checksum": Form("", "ms a w", "$IMU,{},{},{},{},{},{},{}*5A\r\n", "walk.txt", BY_GRAVITY),
    "1024 for 1 g": Form(
        AXES, "1024 rates", hints=AT_100_HZ, says="±32 g (by |a|) and rates in counts", atol=5 * IN_COUNTS
    ),
    "counts of 20 bits": Form(f"time,{AXES}", "t 20_bits", says="accelerations in counts", atol=IN_COUNTS),
    "g beside counts": Form(f"time,{AXES}", "t g rates", says="in g and rates in counts of ±500", atol=IN_COUNTS),
    "lines of a receiver between": Form(
        f"time,{AXES[:-1]},lat\n", "t a w", "{},{},{},{},{},{},{},\n", edit=("\n0.05,", "\n0.045,,,,,,,48.1\n0.05,")
    ),
    "ArduPilot's log as text": Form(
        "FMT, 172, 60, IMU, QBffffff, TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ\nPARM, 1, AHRS, 2\n",
        *("us w a", "IMU, {}, 0, {}, {}, {}, {}, {}, {}\nGPS, 1, 2\n", "flight.log"),
    ),
    "mavlogdump": Form(
        *("", "clock. mg mrad"),
        "2024-05-01 {}: SCALED_IMU {{xacc : {}, yacc : {}, zacc : {}, xgyro : {}, ygyro : {}, zgyro : {}}}\n",
        *("walk.txt", "accelerations in mg and rates in mrad/s"),
    ),
    # lines that name some of the numbers, and make a sample together
    "numbers below a heading": Form(
        "", "a w", "Accelerometer:\n{} {} {}\nGyroscope:\n{} {} {}\n", "walk.txt", "a rate", AT_100_HZ
    ),
    "axes without marks": Form(
        "", "a dps", "Accel   x {}  y {}   z {}\nGyro    x {}  y {}  z {}\n", "walk.txt", "a rate", AT_100_HZ
    ),
    "ESP-IDF": Form(
        *("I (312) cpu_start: Starting scheduler on PRO CPU.\n", "tick g tick dps"),
        "I ({}) mpu6050: acce_x:{}, acce_y:{}, acce_z:{}\n"
        "\033[0;32mI ({}) mpu6050: gyro_x:{}, gyro_y:{}, gyro_z:{}\033[0m\n",
        "walk.log",
        "times in ms, accelerations in g and rates in deg/s",
    ),
    "a kernel's log": Form(
        *("", "t counts", "[{:12.6f}] RAW 0x68: accel=({}, {}, {}) temp_raw=-521 gyro=({}, {}, {})\n"),
        *("boot.log", "times in s, accelerations in counts of ±4 g", None, IN_COUNTS),
    ),
    "counts in hexadecimal digits": Form(f"t,{AXES}", "t hex", says="accelerations in counts of ±4 g", atol=IN_COUNTS),
    "counts of 24 bits": Form(f"t,{AXES}", "t 24_bits", says="accelerations in counts of ", atol=IN_COUNTS),
    "Teleplot": Form(
        "", "epoch a w", ">ax:{0}:{1}\n>ay:{0}:{2}\n>az:{0}:{3}\n>gx:{0}:{4}\n>gy:{0}:{5}\n>gz:{0}:{6}\n", "walk.log"
    ),
    "MPU6050_light": Form(
        *("", "g dps"),
        "TEMPERATURE: 25.31\nACCELERO  X: {}\tY: {}\tZ: {}\n"
        "GYRO      X: {}\tY: {}\tZ: {}\nACC ANGLE X: 1.2\tY: 2.1\n===\n",
        *("walk.txt", "accelerations in g and rates in deg/s", AT_100_HZ),
    ),
    "objects of JSON without lines": Form(
        *("", "t a w"),
        '{{"accelTime":{},"accelX":{},"accelY":{},"accelZ":{},"gyroX":{},"gyroY":{},"gyroZ":{}}}\n',
        *("walk.txt", "times in s", None, 1e-9, ("\n", "")),
    ),
    "dictionaries": Form(
        *("", "a dps", "accel: {{'x': {}, 'y': {}, 'z': {}}}\ngyro: {{'x': {}, 'y': {}, 'z': {}}}\n", "walk.txt"),
        *("rates in deg/s", AT_100_HZ),
    ),
    "InfluxDB": Form("", "a w ns", "imu,device=esp32 ax={},ay={},az={},gx={},gy={},gz={} {}\n", "walk.txt"),
    "tuples": Form("", "g dps", "({}, {}, {}) ({}, {}, {})\n", "walk.txt", BY_GRAVITY, AT_100_HZ),
    "a rate above the names": Form(
        f"# Config: data_rate = 100.0 Hz, filter = 488 Hz, acc_range = 4 g\nLogging Type,1\nWaiting time,3\n{AXES}",
        *("counts", ",", "walk.csv", "a rate of 100 Hz, accelerations in counts of ±4 g (by |a|)", None, IN_COUNTS),
    ),
    "a sampling rate in brackets": Form(f"Sample rate (Hz): 100\n{AXES}", "a w", says="a rate of 100 Hz"),
    "Fs": Form(f"Fs,100\n{AXES}", "a w", says="a rate of 100 Hz"),
    "an output rate": Form(f"OutputRate:,100Hz,,,\n{AXES}", "a w", says="a rate of 100 Hz"),
    # names in other languages, of turns, with a counter's word, and what a program says of each column below them
    "rates called after turns": Form("time,acc_x,acc_y,acc_z,gyro_roll,gyro_pitch,gyro_yaw\n", "t a dps"),
    "names in Spanish": Form("time,acel_x,acel_y,acel_z,giro_x,giro_y,giro_z\n", "t a w"),
    "names in German": Form(
        f"time,{','.join(f'{of} {axis}' for of in ('Beschleunigung', 'Drehrate') for axis in 'XYZ')}\n", "t a w"
    ),
    "stamps of frames": Form(f"framestamp,{AXES}", "t a w"),
    "times of samples": Form(f"sample_at,{AXES}", "t a w"),
    "units in all cells": Form(f"t,{AXES}", "t a w", "{} s" + ",{} m/s^2" * 3 + ",{} rad/s" * 3 + "\n"),
    "Shimmer": Form(
        f"Timestamp,{AXES}CAL,CAL,CAL,CAL,CAL,CAL,CAL\nms,m/(s^2),m/(s^2),m/(s^2),deg/s,deg/s,deg/s\n", "ms a dps"
    ),
    "exponents of Fortran": Form(
        "time acc_x acc_y acc_z yaw_rate pitch_rate roll_rate x_vel\n",
        *("t a wzyx t", " ".join(["{:.12E}"] * 8) + "\n", "walk.txt"),
        edit=("E", "D"),
    ),
    # without names, or with names that say nothing: guessed, or called by the user
    "names of letters": Form("a,b,c,d,e,f,g\n", "ms g dps", says=f"{BY_GRAVITY}{IN_ORDER}"),
    "no names": Form("", "ms g dps", says=f"{BY_GRAVITY}{IN_ORDER}"),
    "no names, called in their order": Form("", "ms g dps", hints={"columns": IN_ORDER, **IN_UNITS}),
    "names of letters, called in their order": Form(
        "a,b,c,d,e,f,g\n", "ms g dps", hints={"columns": IN_ORDER, **IN_UNITS}
    ),
    "names and places": Form(
        "a,b,c,d,e,f,g\n", "ms g dps", hints={"columns": "t=a,ax=b,ay=c,az=d,gx=5,gy=6,gz=7", **IN_UNITS}
    ),
    "names beside words": Form(
        BESIDE_WORDS, "WT901 t g w", hints={"columns": "t=when,ax=AccX(g),ay=AccY(g),az=AccZ,gx=wx,gy=wy,gz=wz"}
    ),
    "an order beside words": Form(BESIDE_WORDS, "WT901 t g w", hints={"columns": f"-,{IN_ORDER}"}),
    # units beside the names of sensors in each line, of which cm/s^2 are nearly mg, and at the ends of columns' names
    **{
        f"{acc} and {gyr} beside names": Form(
            *("", f"ms acc:{acc} gyr:{gyr}", f"ms={{}} Accel[{acc}]: {{}} {{}} {{}} | Gyro[{gyr}]: {{}} {{}} {{}}\n"),
            *("walk.txt", f"accelerations in {acc} and rates in {gyr}"),
        )
        for acc, gyr in UNITS
    },
    **{
        f"names that end with {a} and {g}": Form(
            f"ms,ax_{a},ay_{a},az_{a},gx_{g},gy_{g},gz_{g}\n",
            f"ms acc:{acc} gyr:{gyr}",
            says=f"accelerations in {acc} and rates in {gyr}",
        )
        for a, acc, g, gyr in (
            ("ug", "ug", "udps", "udeg/s"),
            ("ft_s2", "ft/s^2", "rpm", "rpm"),
            ("cm_s2", "cm/s^2", "dps", "deg/s"),
            ("mm_s2", "mm/s^2", "rad_s", "rad/s"),
        )
    },
}


@pytest.mark.parametrize("name", FORMS)
def test_each_form_gives_the_samples_that_were_written(name, walk, walk_ns, tmp_path):
    form = FORMS[name]
    walk = walk.part(0, form.samples)
    form.write(tmp_path / form.file, walk, walk_ns[: len(walk)])
    read = mpucal.load(tmp_path / form.file, **form.hints or {})
    np.testing.assert_allclose(read.t - read.t[0], walk.t, atol=2e-3)
    kept = ~(read.acc_clipped | read.gyr_clipped)
    np.testing.assert_allclose(read.acc[kept], walk.acc[kept], atol=form.atol)
    np.testing.assert_allclose(read.gyr[kept], walk.gyr[kept], atol=form.atol)
    assert form.says in read.taken


@pytest.mark.parametrize(
    ("encoding", "end"), [("utf-16", "\n"), ("utf-8-sig", "\r\n"), ("utf-8", "\r"), ("cp1252", "\n")]
)
def test_text_as_other_systems_write_it(encoding, end, walk, walk_ns, assert_same, tmp_path):
    text = FORMS["AndroSensor"].text(walk, walk_ns)
    (tmp_path / "walk.csv").write_text(text, encoding=encoding, newline=end)
    assert_same(load(tmp_path / "walk.csv"), walk, 1e-9, 1e-9, 1e-9)


@pytest.fixture
def read(walk, walk_ns, tmp_path):
    """Return a function that writes a table (see Form) and loads it."""

    def call(head, spec, line=",", of=walk, file="walk.csv", edit=(), **hints):
        Form(head, spec, line, edit=edit).write(tmp_path / file, of, walk_ns[: len(of)])
        return mpucal.load(tmp_path / file, **hints)

    return call


def refused(path):
    """Return the error with which a file is refused."""
    with pytest.raises(RecordingError) as raised:
        mpucal.load(path)
    return raised.value


@pytest.mark.parametrize(("spec", "utc_ns"), [("date", None), ("utc", 1759595712 * 10**9)])
def test_a_date_without_a_zone_is_no_time_of_day(spec, utc_ns, read, walk, assert_same):
    found = read(f"time,{AXES}", f"{spec} a w")
    assert_same(found, walk, 1e-9, 1e-9, 1e-6)
    assert found.utc_ns == utc_ns


@pytest.mark.parametrize(
    ("head", "spec", "units", "says"),
    [
        ("time [s],ax [m s^-2],ay [m s^-2],az [m s^-2],gx,gy,gz\n", "t g w", "acc=g", r"in m/s\^2, but .* suggests g"),
        ("time [s],ax,ay,az,omega_x,omega_y,omega_z\n", "t a dps", "gyr=deg/s", "turning of gravity suggests deg/s"),
        (f"time [s],{AXES}", "ms a w", "t=ms", r"t is said to be in s, but the step of .* suggests ms"),
    ],
)
def test_doubtful_units_are_refused_and_can_be_given(head, spec, units, says, read, walk, assert_same):
    with pytest.raises(RecordingError, match=says) as refused:
        read(head, spec)
    assert refused.value.options == f"--units {units}"
    assert_same(read(head, spec, units=units), walk, 1e-9, 1e-9, 1e-9)


def test_columns_that_physics_does_not_confirm_are_not_guessed(read, walk):
    turned_otherwise = replace(walk, gyr=np.roll(walk.gyr, 300, axis=0))
    with pytest.raises(RecordingError, match="name its columns in their order"):
        read("", "t a w", " ", turned_otherwise)
    with pytest.raises(RecordingError, match="there is no column h for t: name one of a, b, c, d, e, f, g"):
        read("a,b,c,d,e,f,g\n", "t a w", columns="t=h,ax=b,ay=c,az=d,gx=e,gy=f,gz=g")


def test_unread_columns_of_a_second_imu_are_reported(read, walk, assert_same):
    second = ",".join(f"imu2_{sensor}{axis}" for sensor in ("acc", "gyro") for axis in "xyz")
    found = read(f"time,{AXES.strip()},{second}\n", "t a w field w")
    assert_same(found, walk, 1e-9, 1e-9, 1e-9)
    assert "columns of another IMU were not read (--sensor or --columns chooses): imu2_accx, imu2_accy" in found.taken


@pytest.mark.parametrize(
    ("parse", "texts"),
    [
        (parse_columns, ["t=a,t=b", "velocity=a", "t,ax,ax", "ax="]),
        (parse_units, ["acc=rad/s", "speed=m/s", "g", "acc="]),
    ],
)
def test_hints_that_cannot_be_understood_are_refused(parse, texts):
    for text in texts:
        with pytest.raises(ValueError, match="is not a"):
            parse(text)


@pytest.mark.parametrize("name", ["walk.tlog", "session", "session/capture.mcap"])
def test_hints_are_refused_for_files_that_need_none(tmp_path, name):
    (tmp_path / "walk.tlog").touch()
    (tmp_path / "session").mkdir()
    shutil.copy(CAPTURE, tmp_path / "session" / "capture.mcap")
    with pytest.raises(UsageError, match="needs no options"):
        load(tmp_path / name, Hints(rate_hz=100))


def test_counts_need_a_rate_and_their_ranges_must_fit(read, walk):
    alone = read(AXES, "counts")
    assert "a rate of 100 Hz, accelerations in counts of ±4 g (by |a|) and rates left out" in alone.taken
    assert "nothing shows their times (--rate HZ)" in alone.taken
    assert np.isnan(alone.gyr).all()
    given = read(AXES, "counts", rate=100, accel_range=4, gyro_range=500)
    assert (given.sensor.accel_range_g, given.sensor.gyro_range_dps) == (4, 500)
    with pytest.raises(RecordingError, match="which is not gravity"):
        read(AXES, "counts", rate=100, accel_range=2, gyro_range=500)
    with pytest.raises(RecordingError, match=r"gravity turns .* as fast"):
        read(AXES, "counts", rate=100, accel_range=4, gyro_range=2000)


@pytest.mark.parametrize(
    ("head", "before", "of"),
    [
        ("time,sensor,accuracy,x,y,z\n", "{}", ("ACCELEROMETER,3", "GYROSCOPE,3", "LINEAR_ACCELERATION,3")),
        ("", "{}", ("acc", "gyr", "user acc")),
        ("# Version: 3\n# UncalAccel,utcTimeMillis,x,y,z\n", "", ("UncalAccel,{}", "UncalGyro,{}", "LinearAccel,{}")),
    ],
    ids=["named", "without names", "the sensor first"],
)
def test_lines_that_name_their_sensor(head, before, of, walk, assert_same, tmp_path):
    """Read a line for each sensor, beside lines of a sensor without gravity."""
    text = head
    for ms, acc, gyr in zip(np.rint(walk.t * 1000).astype(int), walk.acc, walk.gyr, strict=True):
        for word, values in zip(of, (acc, gyr, gyr), strict=True):
            text += ",".join(filter(None, [before.format(ms), word.format(ms), *map(repr, values.tolist())])) + "\n"
    (tmp_path / "log.txt").write_text(text)
    assert_same(mpucal.load(tmp_path / "log.txt"), walk, 1e-9, 1e-9, 1e-9)


def test_lines_that_name_their_axis(walk, assert_same, tmp_path):
    """Read a table with a line for each number, as InfluxDB exports it, also where two samples have one time."""
    ms = np.rint(walk.t * 1000).astype(int)
    ms[7] = ms[6]
    text = "#datatype,long,dateTime:RFC3339,double,string\n#default,,,,\n,table,_time,_value,_field,host\n"
    for k, (name, values) in enumerate(
        zip(AXES.strip().split(","), np.column_stack([walk.acc, walk.gyr]).T, strict=True)
    ):
        lines_of = zip(ms.tolist(), values.tolist(), strict=True)
        text += "".join(
            f",{k},2024-05-01T12:00:{at // 1000:02}.{at % 1000:03}Z,{value!r},{name},pi\n" for at, value in lines_of
        )
    (tmp_path / "export.csv").write_text(text)
    found = mpucal.load(tmp_path / "export.csv")
    assert_same(found, walk, 1e-9, 1e-9, 0.011)
    assert "its lines of one time were joined" in found.taken


def test_counts_of_an_analog_accelerometer_have_an_offset(read, walk):
    whole = replace(walk, acc=np.rint(512 + 102 / G * walk.acc))
    with pytest.raises(RecordingError, match=r"turn about 5[\d.]+, 5[\d.]+, 5[\d.]+ in place of zero: subtract"):
        read("ms,ax,ay,az\n", "ms a", of=whole)


def test_noise_of_a_rest_and_few_orientations_have_no_offset(walk, table):
    """Fit no sphere to them, as any few points lie on one."""
    noise = np.random.default_rng(1).uniform(-0.1, 0.1, size=(len(walk), 3))
    faces = np.repeat(G * np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1]]), 100, axis=0)
    for name, acc in (("rest", noise + np.array([0, 0, G])), ("faces", faces + noise[: len(faces)])):
        made = table("t,ax,ay,az", np.arange(len(acc)) / 100 + 0.005, acc, file=f"{name}.csv")
        np.testing.assert_allclose(mpucal.load(made).acc, acc)


@pytest.mark.parametrize("centre", [[1.65, 1.65, 1.65], [0.0, 1.2, 0.6]])
def test_a_shifted_zero_is_reported_at_any_place(centre, walk, table):
    """Report it for volts, and for a zero that is only 1.3 g away."""
    acc = walk.acc / G * (0.3 if centre[0] else 1.0) + np.array(centre)
    for header in ("time,acc_x,acc_y,acc_z,gyr_x,gyr_y,gyr_z", "t,ax,ay,az,gx,gy,gz"):
        path = table(header, walk.t, acc, walk.gyr)
        with pytest.raises(RecordingError, match="in place of zero"):
            mpucal.load(path)
        assert len(mpucal.load(path, units="acc=g")) == len(walk)


def test_lengths_that_vary_about_any_point_have_no_offset(table):
    """Report no shifted zero for an aeroplane that pulls up and rolls, wherever its sphere's centre is."""
    k = np.arange(6000)
    slow, faster, pull = np.sin(k / 300), np.sin(k / 170), 1.0 + 0.35 * np.abs(np.sin(k / 250))
    shaken = np.random.default_rng(3).normal(0.0, 0.4, (6000, 3))
    acc = G * np.column_stack([0.25 * slow, 0.15 * faster, -pull]) + shaken
    np.testing.assert_allclose(mpucal.load(table("t,acc_x,acc_y,acc_z", k / 100 + 0.005, acc)).acc, acc)


def test_the_numbers_of_frames_are_no_rates(table):
    """Refuse positions of a robot beside the numbers of the frames, as a camera tracks it, though they turn alike."""
    n = 1000
    angle = 5e-5 * np.arange(n) ** 2
    places = np.column_stack([0.3 * np.sin(angle / 9), np.sin(angle), np.cos(angle)]) * G
    path = table("frame,u,v,x1,y1,z1", np.arange(n) * 3, np.sin(angle), np.cos(angle), places)
    with pytest.raises(RecordingError, match="holds no three columns as long as gravity"):
        mpucal.load(path)


def test_shocks_near_some_sphere_have_no_offset(table):
    """Refuse readings that scatter too much, and report no shifted zero."""
    directions = np.random.default_rng(4).normal(size=(1000, 3))
    acc = 35.0 * directions / np.linalg.norm(directions, axis=1)[:, None] + np.array([26, 7, 32])
    path = table("# t,ax,ay,az", np.arange(1000) / 100, acc)
    assert "in place of zero" not in str(refused(path))


@pytest.mark.parametrize("order", [[0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5], [0, 1, 2, 3, 4, 5] * 2])
def test_two_sensors_under_one_name(order, walk, assert_same, table):
    """Read the first of both, as of pandas' columns of two levels."""
    one, other = (np.column_stack([of * walk.acc, walk.gyr]) for of in (1.0, -1.0))
    names = [AXES.strip().split(",")[at] for at in order]
    first = [names.index(name) == at for at, name in enumerate(names)]
    columns = [(one if is_first else other)[:, at] for is_first, at in zip(first, order, strict=True)]
    sides = ["left" if is_first else "right" for is_first in first]
    header = f"sensor,{','.join(sides)}\naxis,{','.join(names)}"
    assert_same(mpucal.load(table(header, walk.t, *columns)), walk)


def test_a_magnetic_field_is_not_guessed_to_be_gravity(walk, table):
    refused(table("time,pA,pB,pC,MagX,MagY,MagZ", walk.t, walk.gyr, 0.6 / G * walk.acc))


def test_a_magnetic_field_as_long_as_gravity_is_not_guessed_to_be_it(walk, tmp_path):
    """Read a shaken board, where the rates fit the turning of the field in gauss better than that of gravity."""
    rng = np.random.default_rng(11)
    shaken, field = walk.acc / G + rng.normal(0.0, 0.3, walk.acc.shape), 0.55 * walk.acc / G
    made = np.column_stack([walk.t, shaken, np.degrees(walk.gyr), field])
    np.savetxt(tmp_path / "walk.txt", made)
    assert mpucal.load(tmp_path / "walk.txt").taken.endswith(f"{BY_GRAVITY}t,ax,ay,az,gx,gy,gz.")


def test_a_field_of_unit_length_is_no_gravity_beside_one_in_si(walk, table):
    """Suggest a vehicle's accelerations, though its rates fit the turning of the unit vector beside them better."""
    rng = np.random.default_rng(15)
    driven = rng.normal([0.1, -0.2, G], 2.0, walk.acc.shape)
    direction = walk.acc / np.linalg.norm(walk.acc, axis=1, keepdims=True)
    path = table("", walk.t, walk.gyr, driven, direction)
    assert refused(path).options == "--columns t,gx,gy,gz,ax,ay,az"
    np.testing.assert_allclose(mpucal.load(path, columns="t,gx,gy,gz,ax,ay,az").acc, driven)


def test_the_columns_that_turn_are_suggested_as_accelerations(walk, table):
    """Suggest them after rates with a bias of 500 deg/s, which are as constant in length as gravity."""
    rates = np.degrees(walk.gyr) * 16.4 + [-8000, 8000, 8400]
    path = table("", 32768 + np.rint(np.column_stack([rates, walk.acc * 670])))
    assert refused(path).options == "--columns gx,gy,gz,ax,ay,az"


def test_constant_columns_before_each_sensor_are_no_axes(walk, table):
    """Do not suggest the constant sensor numbers of an app as an axis, although the board hardly turned."""
    n = len(walk)
    field, fives = np.random.default_rng(3).normal([20, -30, 9], 0.3, (n, 3)), np.full(n, 5)
    path = table("", walk.t, np.full(n, 3), walk.acc[:, ::-1], np.full(n, 4), 0.001 * field, fives, field)
    assert refused(path).options == "--columns t,-,ax,ay,az,-,gx,gy,gz"


def test_large_whole_numbers_that_hardly_change_are_no_gravity(table):
    """Do not take a pressure or a place on the earth for an accelerometer, as a power of two is near any number."""
    rng = np.random.default_rng(12)
    made = [rng.integers(10, 40, 400), rng.integers(10, 40, 400), 2**18 + rng.integers(0, 2000, 400)]
    others = [*(rng.integers(-99, 99, 400) for _ in range(3))]
    with pytest.raises(RecordingError, match="holds no columns that are known"):
        mpucal.load(table("dop,hdop,alt,p,q,r", *made, *others))


def test_rates_of_known_names_stay_beside_guessed_accelerations(table):
    still = np.array([0.1, 0.2, G]) + np.random.default_rng(13).normal(0.0, 0.02, (400, 3))
    rates = 0.02 + np.random.default_rng(14).normal(0.0, 0.01, (400, 3))
    found = mpucal.load(table("Time,f_x,f_y,f_z,w_x,w_y,w_z", np.arange(400) / 50, still, rates), units="gyr=rad/s")
    np.testing.assert_allclose(found.acc, still)
    np.testing.assert_allclose(found.gyr, rates)


def test_accelerometer_and_gyroscope_are_of_one_sensor_where_names_repeat(walk, assert_same, table):
    """Read the gyroscope beside the accelerometer that shows gravity, and mix no axes of equal names."""
    names = AXES.strip().split(",")
    header = f"sensor,{','.join(['left'] * 6 + ['right'] * 6)}\naxis,{','.join(names * 2)}"
    assert_same(mpucal.load(table(header, walk.t, 0.01 * walk.acc, -walk.gyr, walk.acc, walk.gyr)), walk)
    header = f"sensor,{','.join(['left'] + ['right'] * 6)}\naxis,{','.join([names[0], *names])}"
    with contextlib.suppress(RecordingError):
        mixed = mpucal.load(table(header, walk.t, -walk.acc[:, 0], walk.acc, walk.gyr))
        np.testing.assert_allclose(mixed.acc, walk.acc)


@pytest.mark.parametrize("above", range(0, 130, 13))
def test_a_line_that_the_beginning_cuts_does_not_show_the_separator(above, walk, tmp_path):
    """Read lines of a serial monitor, wherever in one of them the part ends that shows how they are separated."""
    rows = np.column_stack([walk.t, walk.acc, walk.gyr])
    lines = "".join(f"12:34:56.789 -> {','.join(map(repr, row))}\n" for row in rows.tolist())
    (tmp_path / "walk.txt").write_text(f"{'#' * above}\n12:34:56.789 -> time,{AXES}{lines}")
    assert "times in s" in mpucal.load(tmp_path / "walk.txt").taken


def test_numbers_of_packets_are_no_times(walk, table):
    path = table(f"Packet number,{AXES.strip()}", 2 * np.arange(len(walk)), walk.acc, walk.gyr)
    found = mpucal.load(path, units="gyr=rad/s")
    assert "this sample rate is that at which its rates turn gravity" in found.taken


def test_an_order_is_suggested_in_which_accelerations_keep_their_length(walk, table):
    rates = np.random.default_rng(2).normal(size=(len(walk), 3)) ** 3
    path = table("", np.rint(np.column_stack([300 * rates, 4096 / G * walk.acc])))
    assert refused(path).options == "--columns gx,gy,gz,ax,ay,az"


def test_counts_beside_an_index_have_no_rate(read, walk):
    """Do not take an index for milliseconds, since some range of counts would always fit it."""
    found = read("", "i 10.0 counts")
    assert np.isnan(found.gyr).all()
    assert "this sample rate is assumed" in found.taken


def test_counts_at_the_end_of_the_range_are_clipped(walk, table):
    made = counts(walk)
    made[7, 1], made[9, 5] = 32767, -32768
    found = mpucal.load(table(AXES.strip(), made), rate=100, accel_range=4, gyro_range=500)
    assert np.flatnonzero(found.acc_clipped).tolist() == [7]
    assert np.flatnonzero(found.gyr_clipped).tolist() == [9]


def test_the_range_of_counts_is_not_misled_by_large_biases(read, walk):
    """Read a sensor whose |a| varies with its orientation, by biases of half of 1 g."""
    biased = replace(walk, acc=(walk.acc + 0.45 * G * np.array([1.0, -0.6, 0.8])) / 4)
    size = np.linalg.norm(biased.acc, axis=1)
    assert np.ptp(np.percentile(size, [25, 75])) > 0.25 * np.median(size)
    assert "accelerations in counts of ±16 g (by |a|)" in read(AXES, "counts", of=biased, rate=100).taken


def test_a_rate_is_found_by_how_gravity_turns_and_must_fit(read, walk):
    found = read(AXES, "a dps")
    assert found.rate_hz == pytest.approx(100.0, rel=0.2)
    assert "this sample rate is that at which its rates turn gravity" in found.taken
    for units in ("", "acc=m/s^2"):
        with pytest.raises(RecordingError, match=r"gravity turns [\d.]+ times as fast .* for the times --rate \d"):
            read(AXES, "a w", rate=25, units=units)
    opposite = read(f"time,{AXES}", "t a w", of=replace(walk, gyr=-walk.gyr))
    assert "gravity turns the other way" in opposite.taken


def test_numbers_of_samples_are_no_seconds_under_our_own_names_either(read, walk):
    found = read(f"t,{AXES}", "i a w")
    assert found.rate_hz == pytest.approx(100.0, rel=0.2)
    assert "this sample rate is that at which its rates turn gravity" in found.taken
    still = replace(walk, acc=np.tile([0.0, 0.0, G], (len(walk), 1)), gyr=0.01 * walk.gyr)
    # nothing shows another rate than that of the times
    assert read(f"t,{AXES}", "i a w", of=still).rate_hz == pytest.approx(1.0)


def test_three_parts_of_an_attitude_are_no_accelerometer(read, walk):
    with pytest.raises(RecordingError, match="so gravity is not in it"):
        read("time,acc_x,acc_y,acc_z,q_w,q_x,q_y,q_z\n", "t jerk g 0.1")


def test_missing_or_hidden_gravity_is_reported(read, walk):
    none = replace(walk, acc=np.random.default_rng(1).normal(0, 0.3, walk.acc.shape))
    with pytest.raises(RecordingError, match="gravity is not in it"):
        read(f"time,{AXES}", "t a w", of=none)
    with pytest.raises(RecordingError, match=r"without gravity \(FreeAcc_X, FreeAcc_Y, FreeAcc_Z\)"):
        read("SampleTimeFine,Euler_X,Euler_Y,Euler_Z,FreeAcc_X,FreeAcc_Y,FreeAcc_Z\n", "ticks w a", of=none)
    # a phone's estimate of gravity is no accelerometer's
    head = ",".join(f"{of}{axis}" for of in ("UserAcceleration", "Gravity", "RotationRate") for axis in "XYZ")
    with pytest.raises(RecordingError, match=r"without gravity \(UserAccelerationX"):
        read(f"time,{head}\n", "t jerk g w")
    shaken = replace(walk, acc=walk.acc * np.random.default_rng(4).uniform(0.2, 3, (len(walk), 1)))
    with pytest.raises(RecordingError, match="would be gravity in g") as refused:
        read(AXES, "g dps", of=shaken)
    assert refused.value.options == "--units acc=g"
    with pytest.raises(RecordingError, match="the unit of acc is not known"):
        read(f"time,{AXES}", "t a w", of=replace(walk, acc=np.round(walk.acc * 512 / G)), units="gyr=rad/s,t=s")


@pytest.mark.parametrize(
    ("file", "head"), [("2021-acceldata.txt", ""), ("acc.csv", ""), ("a.csv", "X (g),Y (g),Z (g)\n")]
)
def test_three_columns_are_an_accelerometers_by_the_files_name_or_their_unit(file, head, read, walk):
    found = read(head, "g", file=file)
    np.testing.assert_allclose(found.acc, walk.acc)
    assert np.isnan(found.gyr).all()


def test_three_columns_of_an_unknown_sensor_name_the_command(read, walk):
    with pytest.raises(RecordingError, match="holds no columns that are known") as error:
        read("", "a", file="field.txt")
    found = read("", "a", file="field.txt", columns=error.value.options.split()[1])
    np.testing.assert_allclose(found.acc, walk.acc)


def driven(order, acc_at_rest, spread):
    """Return an index, times, and sensors in that order, of a car or a runner, without names."""
    rng, n = np.random.default_rng(8), np.arange(900)
    sensors = {
        "acc": np.array(acc_at_rest) + rng.normal(0.0, spread, (900, 3)),
        "gyr": rng.normal(0.0, 0.1, (900, 3)),
        "mag": np.array([20.0, -4.0, 40.0]) + rng.normal(0.0, 1.0, (900, 3)),
        "label": np.zeros(900),
    }
    # seldom turned, through a field that varies more
    sensors["slow"] = np.rint(sensors["gyr"] * 4.0) + (n[:, None] > 20) * [0.0, 0.5, 1.0]
    sensors["mag"] *= np.where(n > 600, 8.0, 1.0)[:, None] if "slow" in order else 1.0
    return np.column_stack([14953 + n, 4908.696 + n / 100, *(sensors[of] for of in order.split())])


@pytest.mark.parametrize(
    ("order", "said"),
    [
        ("gyr acc", "-,t,gx,gy,gz,ax,ay,az"),
        ("acc mag gyr", "-,t,ax,ay,az,-,-,-,gx,gy,gz"),
        ("label acc gyr", "-,t,-,ax,ay,az,gx,gy,gz"),
        ("acc slow mag", "-,t,ax,ay,az,gx,gy,gz"),
        ("gyr mag", None),
    ],
)
def test_the_command_for_unknown_columns_works_at_once(order, said, tmp_path):
    np.savetxt(tmp_path / "drive.txt", driven(order, [0.0, 0.0, G], 6.0))
    error = refused(tmp_path / "drive.txt")
    if said is None:
        assert "holds no three columns as long as gravity" in str(error)
        return
    assert error.options == f"--columns {said} --units acc=m/s^2"
    found = mpucal.load(tmp_path / "drive.txt", columns=said, units="acc=m/s^2")
    assert "times in s, accelerations in m/s^2 and rates" in found.taken


def test_a_label_before_accelerations_along_z_is_left_out(tmp_path):
    """Do not suggest z and two rates, which are as long as gravity, in place of all three axes."""
    rows = driven("label acc gyr", [0.0, 0.0, G], [6.0, 6.0, 0.5])[:, 1:]
    np.savetxt(tmp_path / "drive.txt", rows)
    assert refused(tmp_path / "drive.txt").options.startswith("--columns t,-,ax,ay,az,gx,gy,gz")


def test_counts_of_a_runner_have_their_range_by_their_mean(tmp_path):
    rows = driven("acc gyr", [0.0, 4000.0, 7150.0], 6000.0)[:, 1:]
    rows[:, 4:] *= 9000
    rows[:, 0] = 100 + 20 * np.arange(900)
    np.savetxt(tmp_path / "running.csv", np.rint(rows.clip(-32768, 32767)), "%d", ",")
    assert refused(tmp_path / "running.csv").options == "--columns t,ax,ay,az,gx,gy,gz"
    found = mpucal.load(tmp_path / "running.csv", columns="t,ax,ay,az,gx,gy,gz")
    assert "times in ms, accelerations in counts of ±4 g (by |a|)" in found.taken


def shaken(shaking_mps2):
    """Return accelerations and rates of a board that is shaken, or lies still, and hardly turns."""
    rng = np.random.default_rng(3)
    rates = np.radians(rng.normal((0.3, -0.5, 0.2), 0.05, (900, 3)))
    rates[300:] += rng.normal(0.0, 0.2, (600, 3))
    return np.array([0.1, -0.2, G]) + rng.normal(0, shaking_mps2, (900, 3)), rates


@pytest.mark.parametrize(("unit", "si"), [("rad/s", 1.0), ("deg/s", np.radians(1)), (None, 0.3)])
def test_the_unit_of_rates_that_turn_nothing_is_one_of_a_gyroscope(unit, si, table):
    acc, rates = shaken(0.5)
    rates = rates if unit else np.random.default_rng(3).normal(0, 0.3, rates.shape) * si
    path = table("time,accX,accY,accZ,gyroX,gyroY,gyroZ", np.arange(900) / 100, acc, rates / si)
    found = mpucal.load(path)
    if unit is None:
        assert "rates left out, because nothing shows their unit (--units gyr=UNIT)" in found.taken
        assert np.isfinite(mpucal.load(path, units="gyr=deg/s").gyr).all()
        return
    assert f"rates in {unit} (by their noise and bias, as gravity hardly turns)" in found.taken
    np.testing.assert_allclose(found.gyr, rates)


def test_units_beside_the_sensors_names_of_each_line(tmp_path):
    """Read the units that a sketch prints on each line, where no turn shows them."""
    rows = np.random.default_rng(2).normal(0.0, 0.001, (300, 6))
    rows[:, 2] += 9.81
    line = "12:00:{:06.3f} I (5) Accel[m/s2]: {:9.4f} {:9.4f} {:9.4f}  |  Gyro[dps]: {:9.4f} {:9.4f} {:9.4f}\n"
    (tmp_path / "log.txt").write_text("".join(line.format(k / 10, *row) for k, row in enumerate(rows.tolist())))
    found = mpucal.load(tmp_path / "log.txt")
    assert found.taken.split("accelerations ")[1].startswith("in m/s^2 and rates in deg/s.")
    np.testing.assert_allclose(np.column_stack([found.acc, np.degrees(found.gyr)]), rows, atol=6e-5)


def test_a_board_that_never_turned_has_an_accelerometer_all_the_same(tmp_path):
    rng = np.random.default_rng(7)
    acc, rates = np.array([9.85, 0.1, -0.3]) + rng.normal(0, 0.05, (900, 3)), rng.normal(0, 0.004, (900, 3))
    np.savetxt(tmp_path / "x_up.txt", np.column_stack([254500 + np.arange(900) / 100, rates, acc]))
    found = mpucal.load(tmp_path / "x_up.txt")
    assert "its columns were guessed from the length of gravity: --columns t,-,-,-,ax,ay,az" in found.taken
    np.testing.assert_allclose(found.acc, acc)
    assert np.isnan(found.gyr).all()


def test_a_sample_beyond_all_sensors_is_left_out(walk, table):
    """Leave out one whose bits a bus mixed up; refuse a file in which many are so."""

    def spoilt(numbers):
        gyr = walk.gyr.copy()
        gyr[numbers, 1] = -1e26
        return table(f"time,{AXES.strip()}", walk.t, walk.acc, gyr)

    np.testing.assert_allclose(mpucal.load(spoilt(7)).acc, np.delete(walk.acc, 7, axis=0))
    many = spoilt(range(100))
    with pytest.raises(RecordingError, match="the rates of sample 0 are not a sensor's"):
        mpucal.load(many)


def test_lines_that_repeat_a_sample_are_left_out(read, walk, walk_ns, assert_same, tmp_path):
    repeated = "".join(f"{line}\n" * 5 for line in lines(" ", "a", walk, walk_ns).splitlines())
    (tmp_path / "acc.txt").write_text(repeated)
    found = mpucal.load(tmp_path / "acc.txt")
    np.testing.assert_allclose(found.acc, walk.acc)
    np.testing.assert_allclose(found.t, walk.t * 5, atol=1e-9)
    assert not found.gap.any()
    assert f"{4 * len(walk)} repeated samples were left out" in found.taken
    some = lines(",", "ns a w", walk, walk_ns).splitlines(keepends=True)
    (tmp_path / "walk.csv").write_text(
        f"time,{AXES}" + "".join(line * (1 + (i % 7 == 0)) for i, line in enumerate(some))
    )
    found = mpucal.load(tmp_path / "walk.csv")
    assert_same(found, walk)
    assert f"{-(-len(walk) // 7)} repeated samples were left out" in found.taken


def test_rates_that_stay_the_same_within_a_burst_repeat_no_sample(walk, table):
    """Keep rates beside the accelerations of their line, where the lines of a burst have one time and rates of 0."""
    gyr = np.where(np.abs(walk.gyr) < 0.5, 0.0, walk.gyr)
    found = mpucal.load(table(f"time,{AXES.strip()}", walk.t // 0.08 * 0.08, walk.acc, gyr))
    assert "interpolated" not in found.taken
    np.testing.assert_allclose(found.gyr, gyr)


@pytest.mark.parametrize("odd", ["", "nan", "inf"])
def test_lines_that_lack_a_number_are_left_out_and_counted(odd, walk, walk_ns, tmp_path):
    some = lines(",", "a w", walk, walk_ns).splitlines()
    some[100] = f"{odd},{some[100].partition(',')[2]}"
    timed = [f"{t!r},{line}" for t, line in zip(walk.t.tolist(), some, strict=True)]
    (tmp_path / "a.csv").write_text("\n".join([f"time,{AXES.strip()}", *timed, "99.0,1.0,2.0"]))
    found = mpucal.load(tmp_path / "a.csv")
    np.testing.assert_allclose(found.acc, np.delete(walk.acc, 100, axis=0), atol=1e-9)
    assert "1 lines that lack a number" in found.taken, "the line that was torn at the end"
    assert "1 samples that lack a number were left out" in found.taken
    (tmp_path / "b.csv").write_text("\n".join([AXES.strip(), *some, "1.0,2.0"]))
    found = mpucal.load(tmp_path / "b.csv", rate=100)
    assert found.t[100] - found.t[99] == pytest.approx(0.02), "its time passed all the same"


@pytest.mark.parametrize("timed", [True, False])
def test_labelled_lines_that_lack_a_number_are_counted(timed, walk, walk_ns, tmp_path):
    """Count the samples left out, whose time passes all the same; where several in a row are missing, is a gap."""
    line = FORMS["lines that name each number"].line
    line = line if timed else line.replace(",t:{}", "")
    some = lines(line, "a w t" if timed else "a w", walk, walk_ns).splitlines()
    # one has not a number, three are torn, below a line that measures nothing
    some[60], some[80:83] = line.format("nan", *range(6)).strip(), [torn[:30] for torn in some[80:83]]
    (tmp_path / "walk.txt").write_text("\n".join([*some[:40], "Temperature: 25.1 degC", *some[40:]]))
    found = mpucal.load(tmp_path / "walk.txt", rate=None if timed else 100)
    assert f"4 {'lines' if timed else 'samples'} that lack a number were left out" in found.taken
    assert np.flatnonzero(found.gap).tolist() == [79]
    np.testing.assert_allclose(found.t - found.t[0], np.delete(walk.t, [60, 80, 81, 82]), atol=1e-9)


def test_many_bad_lines_are_named(walk, walk_ns, tmp_path):
    some = FORMS["Kalibr"].text(walk, walk_ns).splitlines()
    some[40:60] = [line.replace(",", ",x", 1) for line in some[40:60]]
    (tmp_path / "walk.csv").write_text("\n".join(some))
    with pytest.raises(RecordingError, match=r"line 41: omega_x is 'x.*', which is not a number"):
        load(tmp_path / "walk.csv")


@pytest.mark.parametrize("text", ["a" * 30_000, "a_" * 15_000, "ab " * 10_000, "ax:" * 10_000, "ax:1 " * 6_000])
def test_a_long_line_of_letters_is_no_table(text, tmp_path):
    """Refuse it at once: the time that a pattern takes must not grow with the square of a line's length."""
    (tmp_path / "walk.txt").write_text(text)
    with pytest.raises(RecordingError, match="names no columns of an accelerometer"):
        load(tmp_path / "walk.txt")


def test_lines_that_hold_one_sensor_each(walk, walk_ns, tmp_path):
    """Read what a logger writes that has one line for each event."""
    later = replace(walk, t=walk.t + 0.002)
    of_acc = lines("{},{},{},{},,,\n", "t a", walk, walk_ns).splitlines()
    of_gyr = lines("{},,,,{},{},{}\n", "t w", later, walk_ns).splitlines()
    both = [line for pair in zip(of_acc, of_gyr, strict=True) for line in pair]
    (tmp_path / "walk.csv").write_text("\n".join(["time,ax,ay,az,wx,wy,wz", *both, ""]))
    found = load(tmp_path / "walk.csv")
    np.testing.assert_allclose(found.acc, walk.acc[1:], atol=1e-9)
    assert "+2.00 ms after" in found.taken


@pytest.mark.parametrize("name", ["time", "t"])
def test_times_that_restart_are_an_interruption(name, walk, walk_ns, tmp_path):
    """Tell a restarted sketch from a clock that is set back a little, in our own tables and in others."""
    half, path = len(walk) // 2, tmp_path / "walk.csv"
    t = np.where(np.arange(len(walk)) < half, walk.t, walk.t - walk.t[half])
    t[half + 200] -= 0.02
    path.write_text(f"{name},{AXES}" + lines(",", "t a w", replace(walk, t=t), walk_ns))
    found = mpucal.load(path, units="acc=m/s^2,gyr=rad/s" if name == "time" else "")
    assert ("its times restart once" if name == "t" else "times in s, which restart once,") in found.taken
    np.testing.assert_array_equal(found.acc, walk.acc)
    assert np.flatnonzero(found.gap).tolist() == [half]
    assert np.diff(found.t)[half - 1] == pytest.approx(15.0, abs=0.02)
    assert found.interrupted == (found.t[half - 1],)
    with open_writer(tmp_path / "walk.npz", Rows.of(found), "") as write:
        write(found)
    assert mpucal.load(tmp_path / "walk.npz").interrupted == found.interrupted


def test_more_columns_than_a_table_without_names_has_are_refused(walk, table):
    """Name the last column that there is."""
    with pytest.raises(RecordingError, match="there is no column 8 for gz: name one of its 7 columns by their number"):
        mpucal.load(table("", walk.t, walk.acc, walk.gyr), columns="t,-,ax,ay,az,gx,gy,gz")


@pytest.mark.parametrize("name", ["t", "time"])
def test_lines_of_which_the_newest_is_the_first(name, walk, walk_ns, tmp_path, assert_same):
    """Read them from the last to the first, also a run at a time, in our own names and in another program's."""
    path = tmp_path / "walk.csv"
    path.write_text(f"{name},{AXES}" + "\n".join(lines(",", "t a w", walk, walk_ns).splitlines()[::-1]) + "\n")
    for found in (mpucal.load(path), open_rows(path).recording()):
        assert_same(found, walk)
        assert "the newest first" in found.taken


@pytest.mark.parametrize(("name", "per_s", "even"), [("dt", 1, True), ("dt", 1e3, False), ("delta_us", 1e6, False)])
def test_steps_between_samples_are_summed(name, per_s, even, walk, table):
    """Read a column of times since the sample before, by its name; the first time may be 0."""
    dt = np.random.default_rng(18).uniform(0.008, 0.012, len(walk))
    dt = np.full(len(walk), 0.01) if even else dt / dt.mean() / 100
    found = mpucal.load(table(f"{name},{AXES.strip()}", per_s * dt * (np.arange(len(dt)) > 0), walk.acc, walk.gyr))
    assert "summed from the steps between samples" in found.taken
    np.testing.assert_allclose(found.t - found.t[0], np.cumsum(dt) - dt[0], atol=1e-6 if even else 0.05)
    np.testing.assert_array_equal(found.acc, walk.acc)


@pytest.mark.parametrize(
    ("names", "columns"),
    [
        ("millis,t", lambda n: [10.0 * np.arange(n), 36.0 - 0.001 * (np.arange(n) // 10)]),
        ("time_left,time", lambda n: [0.01 * np.arange(n)[::-1], 0.01 * np.arange(n)]),
        ("dt", lambda n: [0.01 * np.arange(n)]),
        ("millis,flag", lambda n: [10.0 * np.arange(n), np.where(np.arange(n) % 9, 0.0, 3.4028235e38)]),
    ],
    ids=["a temperature that falls", "a countdown", "times called steps", "the largest float"],
)
def test_a_column_beside_the_times_does_not_change_them(names, columns, walk, table):
    found = mpucal.load(table(f"{names},{AXES.strip()}", *columns(len(walk)), walk.acc, walk.gyr))
    np.testing.assert_allclose(np.diff(found.t), 0.01, atol=1e-6)
    np.testing.assert_array_equal(found.acc, walk.acc)


def test_times_that_are_not_read_are_named(walk, table):
    """Say that times which fit no unit are not read; the turning of gravity gives the rate."""
    t = np.arange(len(walk)) % 7
    found = mpucal.load(table(f"t,{AXES.strip()}", t, walk.acc, walk.gyr))
    assert "its column t was not read as the time" in found.taken


def test_our_own_times_that_came_late_lie_between_their_neighbours(walk, walk_ns, tmp_path):
    """Read our own table a run at a time, as `mpucal apply` does, with the same times."""
    t = walk.t.copy()
    t[[100, 900]] -= 0.02
    path = tmp_path / "walk.csv"
    path.write_text(f"t,{AXES}" + lines(",", "t a w", replace(walk, t=t), walk_ns))
    for found in (mpucal.load(path), open_rows(path).recording()):
        np.testing.assert_allclose(found.t, walk.t, rtol=0, atol=1e-9)
        assert not found.gap.any()


@pytest.mark.parametrize(
    "names", ["roll,pitch,yaw", "Euler_x,Euler_y,Euler_z", "AngX,AngY,AngZ", "heading,angle1,angle2"]
)
def test_angles_are_not_suggested_as_accelerations(names, walk, table):
    """Name no order of columns that holds angles, even if they are as long as gravity."""
    angles = np.column_stack([np.sin(walk.t), np.cos(walk.t), 0.1 * np.sin(3 * walk.t)]) * 9.81
    assert not refused(table(f"time,{names}", walk.t, angles)).options


def test_times_behind_the_columns_of_a_file_called_after_a_sensor(read, walk):
    found = read("", "a t", line=" ", file="accel_data.csv")
    np.testing.assert_allclose(found.acc, walk.acc, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.t, walk.t, rtol=0, atol=1e-9)


def test_times_that_begin_anew_are_no_part_of_a_sensor(walk, tmp_path):
    """Suggest an order of columns in which they are the time; name damaged lines."""
    t = 1.7e18 + 1e7 * (np.arange(len(walk)) % 800)
    rates = 5 * np.sin(0.1 * np.arange(len(walk)))[:, None] * [1, -1, 2]
    rows = np.column_stack([t, np.rint([30, 16, 546] + rates / 5), np.rint(rates)])
    path = tmp_path / "board.csv"
    np.savetxt(path, rows, "%.9e", ",")
    order = f"t,{AXES.strip()}"
    assert refused(path).options == f"--columns {order}"
    assert "restart once" in mpucal.load(path, columns=order).taken
    path.write_text(path.read_text().replace("e+18,", "e+18,torn", 30))
    with pytest.raises(RecordingError, match=r"line 1: column 2 is 'torn.*', which is not a number"):
        mpucal.load(path)


def test_times_of_day_that_go_back_are_no_counter_that_overflows(read, walk):
    """Refuse times whose fractions of a second lack their leading zeros, under any name."""
    order = {"columns": "t,ax,ay,az,gx,gy,gz"}
    for head, hints in ((f"time,{AXES}", {}), ("", order)):
        with pytest.raises(RecordingError, match="time does not increase at sample"):
            read(head, "unpadded a w", **hints)


def test_fractions_of_a_second_are_no_milliseconds(read, walk):
    found = read(f"time,{AXES}", "t a w", of=replace(walk, t=walk.t * 40, gyr=walk.gyr / 40))
    assert found.rate_hz == pytest.approx(2.5, rel=0.01)
    (reason,) = [r for r in mpucal.calibrate(found).quality["reasons"] if r["code"] == "units_suspect"]
    assert "0.4 s apart (2.5 Hz), too far to follow a turn" in reason["message"]


def test_times_of_day_show_their_unit_at_any_rate(walk, walk_ns, table):
    """Read times in ms since 1970 with steps of 0.3 s, which taken for us would be 3 kHz."""
    ms = (walk_ns[0] // 10**6) + 300 * np.arange(len(walk))
    found = mpucal.load(table(f"time,{AXES.strip()}", ms, walk.acc, walk.gyr / 30))
    np.testing.assert_allclose(found.t, 0.3 * np.arange(len(walk)))
    assert found.utc_ns == ms[0] * 10**6


def test_a_temperature_is_kept_everywhere(walk, table, tmp_path):
    warm = np.linspace(30.0, 32.0, len(walk))
    np.savez(tmp_path / "a.npz", t=walk.t, acc=walk.acc, gyr=walk.gyr, temperature=warm)
    for name, first, last in (("own", "t", "temperature_c"), ("other", "t", "Temp (°C)"), ("counts", "time", "temp")):
        column = warm if first == "t" else np.full(len(walk), 4000)
        table(f"{first},{AXES.strip()},{last}", walk.t, walk.acc, walk.gyr, column, file=f"{name}.csv")
    for name in ("a.npz", "own.csv", "other.csv"):
        assert mpucal.load(tmp_path / name).sensor.temperature_c == pytest.approx(31.0)
    assert mpucal.calibrate(tmp_path / "own.csv").sensor.temperature_c == pytest.approx(31.0)
    assert mpucal.load(tmp_path / "counts.csv").sensor.temperature_c is None
    named = Hints(columns=parse_columns(f"t=t,{','.join(f'{axis}={axis}' for axis in AXES.strip().split(','))}"))
    assert load(tmp_path / "other.csv", named).sensor.temperature_c == pytest.approx(31.0)


@pytest.fixture(scope="module")
def coarse(stored_calibration):
    """Every second sample of the stored session, and the calibration of these."""
    whole = stored_calibration[0]
    made = mpucal.Recording.from_arrays(*(of[::2] for of in (whole.t - whole.t[0], whole.acc, whole.gyr)))
    return made, mpucal.calibrate(made)


@pytest.mark.parametrize("name", ["counts without a sign", "a spreadsheet's own names", "late"])
def test_one_recording_in_rounded_and_late_forms_gives_one_calibration(name, coarse, tmp_path):
    """Round counts of 8192 for 1 g, round times to seconds, and take stamps that arrive 3 ms late on average."""
    made, calibration = coarse
    form = FORMS.get(name) or Form(f"time,{AXES}", "t a w", says="its times are arrival stamps")
    late = np.random.default_rng(19).exponential(0.003, len(made)) * (name == "late")
    form.write(tmp_path / form.file, replace(made, t=made.t + late), np.rint(made.t * 1e9).astype(np.int64) + 10**18)
    read = mpucal.load(tmp_path / form.file)
    assert form.says in read.taken
    found = mpucal.calibrate(read)
    np.testing.assert_allclose(found.D, calibration.D, rtol=0, atol=2e-3)
    np.testing.assert_allclose(found.b_a, calibration.b_a, rtol=0, atol=2e-2)
    assert found.verdict == calibration.verdict


def test_recordings_without_rates_serve_all_that_needs_no_rate(stored_calibration, table):
    """Calibrate statically, report and check a table of counts without a rate, of which `noise` asks for one."""
    from mpucal.report import render

    whole, calibration = stored_calibration
    path = table(AXES.strip(), counts(whole))
    found = mpucal.load(path)
    assert np.isnan(found.gyr).all()
    static = mpucal.calibrate(found)
    assert (static.verdict, static.fit["model"]) == ("usable", "static")
    assert 'id="accelerometer"' in render(static, found)
    assert mpucal.check(calibration, found).verdict == "still good"
    with pytest.raises(RecordingError, match=r"was read without rates: .*--rate HZ"):
        mpucal.noise(path)


@pytest.mark.parametrize("names", ["dvx,dvy,dvz,dthetax,dthetay,dthetaz", "delta_velocity[0],[1],[2]", ""])
@pytest.mark.parametrize("unit", ["rad", "deg"])
def test_increments_of_velocity_and_angle_are_rates_times_the_period(names, unit, walk, table, assert_same):
    """Read the increments of an integrating sensor, by their names or by the length of gravity."""
    if names.startswith("delta"):
        names = ",".join(f"delta_{of}[{axis}]" for of in ("velocity", "angle") for axis in range(3))
    angles = (np.degrees(walk.gyr) if unit == "deg" else walk.gyr) / 100
    path = table(names and f"time,{names}", walk.t, walk.acc / 100, angles)
    found = mpucal.load(path)
    assert_same(found, walk, 1e-9, 1e-9, 1e-9)
    assert "these are increments over a sample, times its rate" in found.taken


@pytest.mark.parametrize(
    ("stems", "intervals", "per_s"),
    [
        (("delta_velocity[{}]", "delta_angle[{}]"), "delta_velocity_dt,delta_angle_dt", 1e6),
        (("DelV{}", "DelA{}"), "DelvT,DelaT", 1),
    ],
)
def test_increments_over_times_of_their_own(stems, intervals, per_s, walk, table, assert_same):
    """Divide them by these, as PX4 and ArduPilot write them, and not by the period of the lines."""
    axes = "012" if per_s > 1 else "XYZ"
    names = ",".join(stem.format(axis) for stem in stems for axis in axes)
    dt = np.random.default_rng(17).integers(4000, 6000, len(walk)) * 1e-6
    columns = [walk.acc * dt[:, None], 2 * walk.gyr * dt[:, None], dt * per_s, 2 * dt * per_s]
    found = mpucal.load(table(f"time,{names},{intervals}", walk.t, *columns))
    assert_same(found, walk, 1e-9, 1e-9, 1e-9)
    assert "increments over a sample, by their own times" in found.taken


def test_increments_that_nothing_shows_are_read_as_the_user_says(walk, table, assert_same):
    """Suggest units that fit the length of gravity, where rates do not turn it, and the order of columns."""
    path = table(f"time,{AXES.strip()}", walk.t, walk.acc / 100, 0.0 * walk.gyr)
    error, units = refused(path), "acc=m/s/sample,gyr=rad/sample"
    assert "gravity is not in it" in str(error)
    assert error.options == f"--units {units}"
    found = mpucal.load(path, units=units)
    np.testing.assert_allclose(found.acc, walk.acc, atol=1e-9)
    noise = np.random.default_rng(16).normal(0.0, 1e-5, walk.gyr.shape)
    advice = "--columns t,gx,gy,gz,ax,ay,az --units acc=m/s/sample,gyr=rad/sample"
    assert refused(table("", walk.t, noise, walk.acc / 100)).options == advice


@pytest.mark.parametrize(("per_g", "odd"), [(4096, False), (4300, False), (5420, True), (3000, True)])
def test_counts_of_an_odd_scale_are_said_to_fit_no_range(per_g, odd, walk, table):
    counts = np.rint(walk.acc / G * per_g)
    found = mpucal.load(table(f"time,{AXES.strip()}", walk.t, counts, np.degrees(walk.gyr)))
    assert "in counts of ±8 g (" in found.taken
    assert ("which fits no usual range" in found.taken) == odd


@pytest.mark.parametrize("lists", ["of axes", "of samples"])
def test_lists_in_cells(lists, walk, tmp_path, assert_same):
    """Read lists of JSON: three numbers of a sensor in a cell, or as many samples in each."""
    if lists == "of axes":
        header, rows = "time,acc,gyro", zip(walk.t.tolist(), walk.acc.tolist(), walk.gyr.tolist(), strict=True)
    else:
        columns = np.column_stack([walk.t, walk.acc, walk.gyr]).T.reshape(7, -1, 50)
        header, rows = f"window,time,{AXES.strip()}", ([k, *columns[:, k].tolist()] for k in range(columns.shape[1]))
    with (tmp_path / "walk.csv").open("w", newline="") as file:
        csv.writer(file).writerows([header.split(","), *rows])
    assert_same(mpucal.load(tmp_path / "walk.csv"), walk, 1e-9, 1e-9, 1e-9)


def test_each_part_of_times_that_begin_anew_has_its_own_clock(walk, table):
    """Estimate the clock of each part by the arrival stamps of that part; one ran 5 % faster."""
    half, late = len(walk) // 2, np.random.default_rng(3).exponential(0.004, len(walk))
    period = np.repeat([0.01, 0.0095], half)
    t = np.concatenate([np.arange(half) * 0.01, np.arange(half) * 0.0095])
    stamps = np.maximum.accumulate((t + late).reshape(2, -1), 1).ravel()
    found = mpucal.load(table(f"time,{AXES.strip()}", stamps, walk.acc, walk.gyr))
    steps = np.diff(found.t)
    assert np.flatnonzero(found.gap).tolist() == [half]
    np.testing.assert_allclose(np.delete(steps, half - 1), np.delete(period[1:], half - 1), rtol=0.01)
    assert found.interrupted == (found.t[half - 1],)


def test_lists_beside_the_axes_are_no_samples(walk, tmp_path, assert_same):
    """Do not read the covariances that messages of a bag have in a table."""
    rows = ([*row, [-1.0] * 9, [0.01] * 9] for row in np.column_stack([walk.t, walk.acc, walk.gyr]).tolist())
    with (tmp_path / "imu.csv").open("w", newline="") as file:
        csv.writer(file).writerows([["time", *AXES.strip().split(","), "acc_covariance", "gyr_covariance"], *rows])
    assert_same(mpucal.load(tmp_path / "imu.csv"), walk, 1e-9, 1e-9, 1e-9)


def test_a_clock_that_stands_still_is_no_time_to_guess_by(walk, table):
    """Refuse a table whose only times never change, and whose numbers are no sensor's."""
    with pytest.raises(RecordingError, match="holds no"):
        mpucal.load(table("time,pa,pb,pc", 0.0 * walk.t, 1e-3 * walk.gyr))
