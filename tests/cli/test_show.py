"""`mpucal show` of calibrations, recordings and devices, and the summary of a calibration."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import click
import numpy as np
import pytest

from mpucal.cli import TYPED
from mpucal.cli.summary import command_again, formula, next_steps, summary
from mpucal.data import Sensor
from mpucal.result.calibration import Calibration

FAULTS = Path(__file__).parents[2] / "fixtures" / "faults"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"\x81\x82\x83\x84", "it is not text"),
        (b"a = 1\n", "it is not JSON: Expecting value"),
        (b"{}", '"format" is missing, not'),
    ],
)
def test_a_file_that_is_no_json_is_told_in_words(mpucal, content, said, tmp_path):
    (tmp_path / "notes.json").write_bytes(content)
    done = mpucal("show", tmp_path / "notes.json", code=3)
    assert f"holds no calibration ({said}" in done.err


def calibration(verdict="good", **changes):
    D = np.eye(3) + np.array([[0.02, 0.001, 0.0], [0.0, -0.01, 0.0], [0.0, np.radians(1.0), 0.0]])
    quality = {
        "verdict": verdict,
        "reasons": []
        if verdict == "good"
        else [{"code": "gyro_clipped", "message": "18 gyro samples stood at full scale"}],
        "magnitude_before": {"median": 9.9, "mean": 9.91, "std": 0.21},
        "magnitude_after": {"median": 9.8, "mean": 9.807, "std": None},
    }
    values = {
        "D": D,
        "b_a": np.array([0.0980665, -0.5, 0.0]),
        "D_std": np.full((3, 3), 2e-4),
        "b_a_std": np.array([0.00980665, 0.02, np.nan]),
        "quality": quality,
        "fit": {"model": "accel", "samples": 4000, "seconds": 40.0, "gravity": 9.80665},
    }
    return Calibration(**{**values, **changes})


@pytest.mark.parametrize(("saved", "name"), [("c.json", "C.JSON"), ("c.bin", "C.BIN"), ("c.json", "c"), ("c.bin", "d")])
def test_a_calibration_is_known_by_what_it_holds(mpucal, saved, name, tmp_path):
    calibration().save(tmp_path / saved)
    (tmp_path / saved).rename(tmp_path / name)
    assert f"{name}: a calibration of" in mpucal("show", tmp_path / name).out


def test_records_of_numbers_are_no_config_blob(mpucal, tmp_path):
    (tmp_path / "log.bin").write_bytes(bytes(range(256)) * 20)
    assert "nor of records of numbers" in mpucal("show", tmp_path / "log.bin").err


def row(text, name):
    return next(line for line in text.splitlines() if line.startswith(name))


def test_a_summary_is_in_the_units_of_people_and_fits_80_columns():
    text = summary(calibration())
    assert text.startswith("The calibration is good.")
    assert " ".join(row(text, "scale factor error, %").split()[4:]) == "+2.000 ± 0.020 -1.000 ± 0.020 +0.000 ± 0.020"
    assert row(text, "bias, mg").split()[2:] == ["+10.0", "±", "1.0", "-51.0", "±", "2.0", "+0.000", "±", "?"]
    assert row(text, "misalignment to y, deg").split()[-3:] == ["+1.000", "±", "0.011"]
    assert max(map(len, text.splitlines())) < 80


def test_the_formula_calibrates():
    c = calibration()
    lines = formula(c).splitlines()[1:]
    y = dict(zip("xyz", (1.0, 2.0, 3.0), strict=True))
    matrix = [[float(value) for value in line[line.index("[") + 1 : line.index("]")].split()] for line in lines]
    shifted = []
    for axis, line in zip("xyz", lines, strict=True):
        shifted.append(y[axis] + float(line.split(f"y_{axis}")[1]))
    assert np.array(matrix) @ shifted == pytest.approx(c.apply([1.0, 2.0, 3.0]), abs=1e-4)


BUS = "session --bus 1"
AGAIN = {
    "the same": (BUS, (), ""),
    "a folder": (f"{BUS} -o seven", (), f"{BUS} -o seven-2"),
    "rates": (BUS, ("gyro_clipped",), f"{BUS} --gyro-range 1000"),
    "a range given": ("session --gyro-range 500 --bus 1", ("gyro_clipped",), "session --gyro-range 1000 --bus 1"),
    "a range joined": ("session --gyro-range=500 --bus 1", ("gyro_clipped",), f"{BUS} --gyro-range 1000"),
    "the largest": (BUS, ("accel_clipped",), ""),
    "both": (f"{BUS} -o seven", ("accel_clipped", "gyro_clipped"), f"{BUS} -o seven-2 --gyro-range 1000"),
    "a replay": ("session --replay a.mcap", ("gyro_clipped",), "session --gyro-range 1000"),
    "a resumed one": ("session --resume seven", (), "session --serial /dev/ttyUSB0 --address 104 --micropython"),
    "a file": (
        "calibrate walk.csv --model hand -o seven",
        ("gyro_clipped",),
        "calibrate walk-2.csv --model hand -o seven-2",
    ),
}


@pytest.mark.parametrize(("typed", "codes", "again"), AGAIN.values(), ids=AGAIN.keys())
def test_the_command_for_another_measurement_is_never_the_same_one(tmp_path, monkeypatch, typed, codes, again):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "seven").mkdir()
    (tmp_path / "walk.csv").touch()
    quality = {"verdict": "refused", "reasons": [{"code": code, "message": "it was"} for code in codes]}
    sensor = Sensor("MPU-6050", 0x68, accel_range_g=16.0, gyro_range_dps=500.0)
    with click.Context(click.Command("mpucal")) as context:
        context.meta[TYPED] = typed.split()
        file = Path("walk.csv") if "walk.csv" in typed else None
        source = {"serial": "/dev/ttyUSB0", "address": 104, "micropython": ""} if "--resume" in typed else {}
        made = calibration(quality=quality, sensor=sensor)
        assert command_again(made, Path("seven"), file, source) == (f"mpucal {again}" if again else "")
        steps = next_steps(made, [Path("seven", "report.html")], file, source)
    assert steps.endswith(f"run\n  mpucal {again}" if again else "give the same command again.")
    assert ("in a new recording" in steps) == (file is not None)


def test_a_refused_part_of_a_session_is_to_be_continued(mpucal, tmp_path):
    (tmp_path / "board 7").mkdir()
    shutil.copy(FAULTS / "unplugged.mcap", tmp_path / "board 7" / "capture.mcap")
    refused = mpucal("calibrate", tmp_path / "board 7", code=5)
    assert refused.out.endswith(f"follow the remedy above, and run\n  mpucal session --resume '{tmp_path}/board 7'\n")


def test_one_changed_parameter_is_not_in_the_plural(mpucal, tmp_path):
    made = calibration(b_a_std=np.full(3, 0.01))
    for name, moved in (("then.json", [0.0, 0.0, 0.0]), ("now.json", [0.0, 0.0, 0.2])):
        replace(made, b_a=made.b_a + moved).save(tmp_path / name)
    assert "Different: 1 parameter of the" in mpucal("diff", tmp_path / "then.json", tmp_path / "now.json").out


def test_the_folder_of_a_session_is_its_calibration(mpucal, session):
    capture = session.folder / "capture.mcap"
    for command, *more in (("check", capture), ("diff", session.folder), ("export", "--to", "c-header")):
        by_file = mpucal(command, session.folder / "calibration.json", *more)
        by_folder = mpucal(command, session.folder, *more)
        assert by_folder.code == by_file.code == 0, by_folder.err
        assert by_folder.out == by_file.out != ""


def test_the_folder_of_a_calibration_without_a_recording_is_told_how_to_show_it(mpucal, tmp_path):
    folder = tmp_path / "of results"
    folder.mkdir()
    calibration().save(folder / "calibration.json")
    result = mpucal("show", folder, code=3)
    assert f"`mpucal show '{folder}/calibration.json'` shows the calibration in it" in result.err


def test_shows_a_calibration(mpucal, session):
    for name in ("calibration.json", "calibration.bin"):
        result = mpucal("show", session.folder / name, code=0)
        assert all(words in result.out for words in ("a calibration of", "bias, mg", "inv(D)"))
        assert ("The calibration is" in result.out) == name.endswith("json")


def test_shows_a_capture(mpucal, session):
    result = mpucal("show", session.folder, code=0)
    assert "MPU-6050, ±4 g, ±500 deg/s" in result.out
    assert "lies flat" in result.out
    facts = json.loads(mpucal("show", session.folder / "capture.mcap", "--json").out)
    assert facts["chip"] == "MPU-6050"
    assert facts["samples"] == pytest.approx(facts["seconds"] * facts["rate_hz"], rel=0.01)
    assert facts["flat_s"][1] - facts["flat_s"][0] > 5.0


def test_a_chip_is_shown(mpucal):
    for chip, place in (("mpu6050", "0x06"), ("mpu6500", "0x77")):
        shown = json.loads(mpucal("show", "--bus", f"sim:seed=3,chip={chip}", "--json").out)
        assert shown["chip"].lower().replace("-", "") == chip
        page = mpucal("show", "--bus", f"sim:seed=3,chip={chip}").out
        assert f"WHO_AM_I 0x{shown['who_am_i']:02x}" in page
        assert str(shown["accel_offsets"][place][0]) in page


def test_a_vehicles_parameters_are_shown(mpucal):
    shown = json.loads(mpucal("show", "--mavlink", "sim", "--json").out)
    assert shown["firmware"] == "ArduPilot"
    assert "INS_ACCOFFS_X" in shown["parameters"]
    assert "INS_ACCOFFS_X" in mpucal("show", "--mavlink", "sim").out


@pytest.mark.parametrize(("name", "holds"), [("CAL_ACC0_XOFF", "a correction in"), ("CAL_GYRO0_XOFF", "no correction")])
def test_a_correction_of_a_vehicles_accelerometers_is_named(name, holds, mpucal):
    assert f"{holds} " in mpucal("show", "--mavlink", f"sim:firmware=px4,{name}=0.01").out


def test_calibrations_at_three_temperatures_differ_and_are_merged(mpucal, session):
    made = Calibration.load(session.folder / "calibration.json")
    for number, name in enumerate(("cold", "warm", "hot")):
        sensor = replace(made.sensor, temperature_c=10.0 + 10.0 * number)
        fit = {**made.fit, "recording_digest": f"{number:064x}"}
        replace(made, sensor=sensor, b_a=made.b_a + 0.01 * number, fit=fit).save(f"{name}.json")
    different = mpucal("diff", "cold.json", "hot.json")
    assert (different.code, different.out[:10]) == (0, "Different:")
    assert json.loads(mpucal("diff", "cold.json", "hot.json", "--json").out)["same"] is False
    merged = mpucal("merge", "cold.json", "warm.json", "hot.json", "-o", "merged", code=0)
    assert "b_a changes by (+0.102, +0.102, +0.102) mg/°C" in merged.out
    assert Calibration.load("merged/calibration.json").b_a_slope == pytest.approx([1e-3] * 3, abs=1e-6)
    shown = mpucal("show", "merged/calibration.json").out
    assert "b_a changes by" in shown
