"""The page of a real result: its numbers against calibration.json, converted here once more, and its sentences."""

import html
import math
import re
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest

from mpucal.data import Sensor
from mpucal.report import render
from mpucal.report.track import Track
from mpucal.report.units import ParameterRow
from mpucal.result.calibration import Calibration

CELL = re.compile(r"([-+]?[\d.]+) ±\u00a0([\d.]+)")
MG = 9.80665e-3
REASON = {"code": "few_orientations", "message": "only 5 orientations were seen: show it more sides."}


def element(page, name):
    """Return what is in the element with an id; its tag occurs in it only once."""
    return re.search(rf'<(\w+) [^>]*id="{name}"[^>]*>(.*?)</\1>', page, re.DOTALL)[2]


def table(page, name):
    rows = {}
    for row in re.findall(r"<tr>(.*?)</tr>", element(page, name), re.DOTALL):
        cells = [html.unescape(cell) for cell in re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row)]
        rows[cells[0]] = cells[1:]
    return rows


def agree(cells, values, stds):
    """Each cell is its value and deviation, as far as their digits go."""
    for cell, value, std in zip(cells, values, stds, strict=True):
        shown, deviation = CELL.fullmatch(cell).groups()
        digit = 10.0 ** -len(shown.partition(".")[2])
        assert abs(float(shown) - value) <= 0.51 * digit
        assert abs(float(deviation) - std) <= 0.51 * digit
        assert digit <= 0.11 * std


@pytest.fixture(scope="module")
def numbers(result):
    """Return the arrays of calibration.json by name."""
    parts = {**result.document["gyroscope"], **result.document["accelerometer"]}
    return {name: np.array(value) for name, value in parts.items() if name != "formula"}


def test_the_error_model(result, numbers):
    rows, D, D_std = table(result.html, "accelerometer"), numbers["D"], numbers["D_std"]
    agree(rows["scale factor error, %"][:3], 100 * (np.diag(D) - 1), 100 * np.diag(D_std))
    agree(rows["bias, mg"][:3], numbers["b_a"] / MG, numbers["b_a_std"] / MG)
    for j in range(3):
        cells = rows[f"misalignment to {'xyz'[j]}, deg"]
        assert cells[j] == ""
        for i in {0, 1, 2} - {j}:
            angle = math.degrees(math.atan(D[i, j] / D[i, i]))
            std = math.hypot(D[i, i] * D_std[i, j], D_std[i, i] * D[i, j]) / math.hypot(D[i, i], D[i, j]) ** 2
            agree(cells[i : i + 1], [angle], [math.degrees(std)])
    rows = table(result.html, "gyroscope")
    agree(
        rows["scale factor error, %"], 100 * (np.diag(np.linalg.inv(numbers["K"])) - 1), 100 * np.diag(numbers["K_std"])
    )
    agree(rows["bias, deg/s"], np.degrees(numbers["b_omega"]), np.degrees(numbers["b_omega_std"]))


def test_the_matrices(result, numbers):
    for name, matrix, bias in (("parameters", "D", "b_a, m/s²"), ("gyro-parameters", "K", "b_omega, rad/s")):
        rows, of_bias = table(result.html, name), bias.partition(",")[0]
        for i, axis in enumerate("xyz"):
            agree(rows[f"{matrix} {axis}"], numbers[matrix][i], numbers[f"{matrix}_std"][i])
        agree(rows[bias], numbers[of_bias], numbers[f"{of_bias}_std"])


def test_the_rests_are_nearer_to_gravity(result):
    rows = table(result.html, "magnitudes")
    (_, before, spread_before), (_, after, spread_after) = (map(float, rows[when]) for when in ("before", "after"))
    gravity = result.document["fit"]["gravity"]
    assert abs(after - gravity) < 0.1 * abs(before - gravity)
    assert spread_after < 0.1 * spread_before


@pytest.mark.parametrize(
    ("bias_mg", "verdict", "said"),
    [
        ((10, -10, 50), "good", "±50, ±50, ±80: usual"),
        ((49, 51, -70), "good", "y outside, z unusual; corrected"),
        ((90, 0, 0), "refused", "x outside"),
    ],
)
def test_a_bias_beside_the_data_sheet(result, bias_mg, verdict, said):
    made = replace(
        result.calibration, b_a=np.array(bias_mg) * MG, b_a_std=np.full(3, 1e-4), quality={"verdict": verdict}
    )
    page = render(made)
    assert table(page, "accelerometer")["bias, mg"][3].endswith(said)
    if "outside" in said:
        compared = element(page, "compared")
        assert compared.startswith("Outside the data sheet: bias ")
        assert ("This calibration corrects them." in compared) == (verdict == "good")
    unknown_chip = render(replace(made, sensor=replace(made.sensor, chip="ICM-20602")))
    assert "data sheet" not in unknown_chip.partition("</style>")[2]


def test_the_sentence_says_how_sure(result):
    error = result.document["quality"]["error_std"]
    sentence = element(result.html, "verdict")
    assert sentence.lower().startswith(result.document["quality"]["verdict"])
    found = re.search(r": (\S+) mg before, (\S+) mg after .*?, (\S+) deg in direction", sentence).groups()
    before, mg, direction = map(float, found)
    assert "to about 2 mg from one session to the next" in element(result.html, "repeatability")
    np.testing.assert_allclose([mg * MG, direction], [error["rms"], error["direction_deg"]], rtol=0.06)
    D, b_a, gravity = result.calibration.D, result.calibration.b_a, result.document["fit"]["gravity"]
    s = np.random.default_rng(1).normal(size=(20000, 3))
    s *= gravity / np.linalg.norm(s, axis=1, keepdims=True)
    wrong = s @ (D - np.eye(3)).T + b_a
    np.testing.assert_allclose(before * MG, np.sqrt((wrong**2).sum(axis=1).mean()), rtol=0.01)
    tilted = replace(result.calibration, fit={**result.calibration.fit, "model": "tilt"})
    assert "(rms over the tilts that it is valid for, 1 sigma)" in element(render(tilted), "verdict")


@pytest.mark.parametrize(
    ("verdict", "extra", "command"),
    [
        ("good", {}, "mpucal export calibration.json --to c-header"),
        ("usable", {}, "repeat the session"),
        ("good", {"autopilot": {"firmware": "px4"}}, "mpucal write calibration.json autopilot --mavlink URL"),
        ("refused", {}, "mpucal session"),
    ],
)
def test_the_top_says_the_verdict_its_reasons_and_what_to_do(result, verdict, extra, command):
    page = render(replace(result.calibration, quality={"verdict": verdict, "reasons": [REASON]}, extra=extra))
    assert command in page[page.index('id="verdict"') : page.index("<h2>")]
    assert element(page, "verdict").startswith(verdict.capitalize())
    assert REASON["message"] in element(page, "reasons")
    assert ("mpucal write" in page, "repeat the session" in page) == (verdict != "refused", verdict != "good")


@pytest.mark.parametrize(("name", "recording"), [("mpu6050.mcap", "mpu6050.mcap"), ("capture-2.mcap", ".")])
def test_the_page_names_the_commands_that_repeat_the_fit(result, name, recording):
    """Fit a session's folder, of all its captures, or another file alone."""
    page = render(result.calibration, replace(result.recording, name=name))
    fit = result.document["fit"]
    assert html.unescape(element(page, "reproduce")).splitlines() == [
        f"mpucal calibrate {recording} --model {fit['model']} --gravity {fit['gravity']} -o again",
        f"mpucal session --replay {recording} -o replayed",
    ]


def test_the_verification(result):
    orientation = {
        "down": [0.64, 0.48, -0.59],
        "magnitude_mps2": -0.00097,
        "magnitude_std_mps2": 0.0087,
        "direction_deg": 0.0637,
        "direction_std_deg": 0.1307,
        "agrees": True,
    }
    quality = {**result.calibration.quality, "verification": {"agrees": True, "orientations": [orientation]}}
    page = render(replace(result.calibration, quality=quality))
    assert table(page, "verification")["corner +X +Y −Z down"] == ["-0.0010 (±\u00a00.0087)", "0.064 (±\u00a00.131)"]
    assert 'id="verification"' not in result.html


def test_a_number_of_which_nothing_is_known_is_not_shown():
    row = ParameterRow("scale factor error", "%", np.array([6058.0, 2.1, 0.3]), np.array([812.0, 19.0, 0.02]))
    assert row.cells == ["not observable", "+2 ± 19", "+0.300 ± 0.020"]


@pytest.mark.parametrize("applied", [[0, 0, 0], [0.25, -0.1, 1.0]], ids=["nothing applied", "applied in hardware"])
def test_the_formula_computes_what_the_calibration_does(result, applied):
    calibration = replace(result.calibration, applied_in_hardware=np.array(applied, float))
    y = dict(zip(("y_x", "y_y", "y_z"), (0.5, -3.0, 9.0), strict=True))
    a = []
    for line, axis in zip(element(render(calibration), "formula").splitlines(), "xyz", strict=True):
        name, expression = line.split(" = ")
        assert name == f"a_{axis}"
        assert re.fullmatch(r"[-+*(). \d_xyz]+", expression)
        a.append(eval(expression, {"__builtins__": {}}, y))
    np.testing.assert_allclose(a, calibration.apply(list(y.values())), atol=2e-5)


def test_the_page_names_the_sensor_and_the_recording(result):
    made = replace(result.calibration, created="2024-05-17T09:30:00+00:00", extra={"name": "left wing"})
    sentence = "capture.mcap was never closed: its 7 records are whole."
    page = render(made, replace(result.recording, recovered=sentence))
    assert "<h1>Calibration of left wing</h1>" in page
    assert "MPU-6050, 17 May 2024, 09:30 UTC" in page
    assert sentence in page
    settings = {"chip": "MPU-6050", "WHO_AM_I": "0x68", "accelerometer range": "±4 g", "recording": "mpu6050.mcap"}
    assert {name: [value] for name, value in settings.items()}.items() <= table(page, "settings").items()


def test_unknown_values_are_named_unknown(result):
    page = render(Calibration(np.full((3, 3), np.nan), np.full(3, np.nan)))
    assert element(page, "verdict").startswith("Refused")
    assert table(page, "parameters")["D x"][0] == "unknown"
    assert table(page, "settings") == {}
    assert "cannot be inverted" in element(page, "formula")
    assert "<svg" not in render(replace(result.calibration, D=np.ones((3, 3))), result.recording)


def test_everything_that_comes_from_outside_is_escaped(result):
    evil = "<script>alert(1)</script>\"'&\u202e\x1b"
    made = replace(
        result.calibration,
        sensor=Sensor(chip=evil),
        created=evil,
        fit={"model": evil, "why": evil},
        quality={"verdict": evil, "reasons": [{"code": evil, "message": evil}]},
    )
    page = render(made, replace(result.recording, name=evil))
    assert "<script" not in page
    shown = "<script>alert(1)</script>\"'&\\u202e\\x1b"
    assert shown in html.unescape(element(page, "reasons"))
    assert table(page, "settings")["chip"] == [shown]


def test_needs_no_network_and_no_script_and_follows_the_readers_colours(result):
    page = result.html
    assert not re.search(r"<(script|link|iframe|img|object)\b|<[^>]* on\w+=|@import|url\((?!#)", page)
    assert all(link.startswith("#") for link in re.findall(r'<[^>]* (?:src|href|xlink:href)="([^"]*)"', page))
    assert "prefers-color-scheme: dark" in page
    picture = page[page.index("<svg") : page.index("</svg>")]
    assert "var(--before)" in picture and "var(--after)" in picture
    assert not re.search(r"(fill|stroke): #", picture)
    assert page == render(result.calibration, result.recording), "the same result gives the same page"


def test_the_picture_keeps_a_single_spike(result):
    acc = result.recording.acc.copy()
    acc[len(acc) // 2] = (600.0, 0.0, 0.0)
    page = render(result.calibration, replace(result.recording, acc=acc))
    page = page[page.index('id="magnitude-over-time"') :]
    path = re.search(r'<path d="([^"]*)"[^>]*stroke: var\(--before\)', page).group(1)
    heights = np.sort([float(y) for y in re.findall(r"[ML]\S+ ([^ML]+)", path)])  # SVG counts downwards
    assert len(heights) < len(acc) / 4
    assert heights[-1] - heights[1] < 0.3 * (heights[1] - heights[0])


def test_a_wrong_calibration_shows_in_the_innovations(result):
    track = Track(result.recording, result.calibration)
    wrong = replace(result.calibration, b_a=result.calibration.b_a + np.array([0.5, 0.0, 0.0]))
    both = (track, Track(result.recording, wrong))
    rms = [np.sqrt(np.mean(t.innovations[t.resting[-len(t.innovations) :]] ** 2)) for t in both]
    assert rms[1] > 1.3 * rms[0]
    # without a flat segment there is no prediction
    middle = len(result.recording) // 2
    alone = Track(replace(result.recording.part(middle, middle + 60), flat=None), result.calibration)
    assert alone.innovations is None
    assert len(alone.at_rest(alone.calibrated)) == 0


def test_a_vehicle_has_its_parameters_beside_what_they_were_and_each_other_imu(result):
    old = {"INS_ACCOFFS_X": 0.001, "INS_ACCSCAL_X": 1.001, "AHRS_ORIENTATION": 0.0}
    new = {"INS_ACCOFFS_X": 0.3165196, "INS_ACCSCAL_X": 0.9726794, "INS_ACCOFFS_Y": -0.5}
    autopilot = {"firmware": "ArduPilot <4>", "params_old": old, "params_new": new, "residual_mps2": 0.109}
    other = {**result.document, "autopilot": autopilot, "quality": {"verdict": "usable", "reasons": [REASON]}}
    extra = MappingProxyType({"autopilot": autopilot, "others": [other]})
    page = render(replace(result.calibration, extra=extra))
    rows = re.findall(r'<tr><th scope="row">INS_(\w+)</th><td>(.*?)</td><td>(.*?)</td></tr>', page)
    once = [("ACCOFFS_X", "0.001", "0.31652"), ("ACCSCAL_X", "1.001", "0.972679"), ("ACCOFFS_Y", "unknown", "-0.5")]
    assert rows == once * 2
    assert "AHRS_ORIENTATION" not in page
    assert "ArduPilot &lt;4&gt;" in page
    assert "errors of up to 0.11 m/s² in |a|" in page
    assert "MPU-6050: usable" in page
    assert REASON["message"] in page
    assert page.count('<table id="accelerometer') == 2
    assert "The vehicle" not in result.html


def test_the_page_of_a_vehicle_speaks_of_a_vehicle(result):
    sensor = Sensor(chip="ArduPilot-IMU1", message="RAW_IMU")
    extra = MappingProxyType({"autopilot": {"firmware": "ArduPilot"}})
    page = html.unescape(render(replace(result.calibration, sensor=sensor, extra=extra), result.recording))
    of_boards = re.compile(r"\b(?:board|chip|firmware|soldering)\b")
    assert [text for text in re.split("[<>]", page) if of_boards.search(text)] == []
    assert "in the vehicle's axes" in page
    assert "mpucal check calibration.json --mavlink URL" in page
    assert "in the board's axes" in html.unescape(result.html)
    assert "mpucal check calibration.json --bus /dev/i2c-1" in result.html
