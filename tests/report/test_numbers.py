"""Every number on the page against calibration.json, converted here once more."""

import html
import math
import re
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from mpucal.report import render
from mpucal.report.units import ParameterRow
from mpucal.result.calibration import Calibration

CELL = re.compile(r"([-+]?[\d.]+) ±\u00a0([\d.]+)")
TABLE = r'<table id="{}">(.*?)</table>'
MG = 9.80665e-3


def table(page, name):
    rows = {}
    for row in re.findall(r"<tr>(.*?)</tr>", re.search(TABLE.format(name), page, re.DOTALL)[1], re.DOTALL):
        cells = [html.unescape(cell) for cell in re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row)]
        rows[cells[0]] = cells[1:]
    return rows


def agree(cells, values, stds):
    """Each cell is its value and deviation, as far as their digits go."""
    assert len(cells) == len(values)
    for cell, value, std in zip(cells, values, stds, strict=True):
        if math.isnan(value):
            assert cell == ""
            continue
        shown, deviation = CELL.fullmatch(cell).groups()
        digit = 10.0 ** -len(shown.partition(".")[2])
        assert abs(float(shown) - value) <= 0.51 * digit
        assert abs(float(deviation) - std) <= 0.51 * digit
        assert digit <= 0.11 * std


@pytest.fixture(scope="module")
def accelerometer(result):
    return {name: np.array(result.document["accelerometer"][name]) for name in ("D", "b_a", "D_std", "b_a_std")}


def test_scale_factor_errors_and_biases(result, accelerometer):
    rows = table(result.html, "accelerometer")
    a = accelerometer
    agree(rows["scale factor error, %"][:3], 100 * (np.diag(a["D"]) - 1), 100 * np.diag(a["D_std"]))
    agree(rows["bias, mg"][:3], a["b_a"] / MG, a["b_a_std"] / MG)


@pytest.mark.parametrize(("i", "j"), list(permutations(range(3), 2)))
def test_misalignments(result, accelerometer, i, j):
    D, D_std = accelerometer["D"], accelerometer["D_std"]
    angle = math.degrees(math.atan(D[i, j] / D[i, i]))
    std = math.degrees(math.hypot(D[i, i] * D_std[i, j], D_std[i, i] * D[i, j]) / math.hypot(D[i, i], D[i, j]) ** 2)
    cells = table(result.html, "accelerometer")[f"misalignment to {'xyz'[j]}, deg"]
    agree(cells[i : i + 1], [angle], [std])
    assert cells[j] == ""


def test_the_gyroscope(result):
    gyro = {name: np.array(value) for name, value in result.document["gyroscope"].items() if name != "formula"}
    rows = table(result.html, "gyroscope")
    wrong = np.linalg.inv(gyro["K"])
    agree(rows["scale factor error, %"], 100 * (np.diag(wrong) - 1), 100 * np.diag(gyro["K_std"]))
    agree(rows["bias, deg/s"], np.degrees(gyro["b_omega"]), np.degrees(gyro["b_omega_std"]))


def test_the_matrices(result, accelerometer):
    rows = table(result.html, "parameters")
    for i, axis in enumerate("xyz"):
        agree(rows[f"D {axis}"], accelerometer["D"][i], accelerometer["D_std"][i])
    agree(rows["b_a, m/s²"], accelerometer["b_a"], accelerometer["b_a_std"])
    rows, gyro = table(result.html, "gyro-parameters"), result.document["gyroscope"]
    for i, axis in enumerate("xyz"):
        agree(rows[f"K {axis}"], gyro["K"][i], gyro["K_std"][i])
    agree(rows["b_omega, rad/s"], gyro["b_omega"], gyro["b_omega_std"])


def test_the_rests_are_nearer_to_gravity(result):
    rows = table(result.html, "magnitudes")
    (_, before, spread_before), (_, after, spread_after) = (map(float, rows[when]) for when in ("before", "after"))
    gravity = result.document["fit"]["gravity"]
    assert abs(after - gravity) < 0.1 * abs(before - gravity)
    assert spread_after < 0.1 * spread_before


@pytest.mark.parametrize(
    ("bias_mg", "said"),
    [
        ((10, -10, 50), "±50, ±50, ±80: usual"),
        ((49, 51, -70), "y outside, z unusual; corrected"),
        ((40, 0, 0), "x unusual"),
    ],
)
def test_a_bias_beside_the_data_sheet(result, bias_mg, said):
    page = render(replace(result.calibration, b_a=np.array(bias_mg) * MG, b_a_std=np.full(3, 1e-4)))
    assert said in table(page, "accelerometer")["bias, mg"][3]


@pytest.mark.parametrize(("verdict", "corrects"), [("good", True), ("refused", False)])
def test_what_is_outside_the_data_sheet_is_corrected_unless_refused(result, verdict, corrects):
    calibration = replace(result.calibration, b_a=np.array((90, 0, 0)) * MG, quality={"verdict": verdict})
    page = render(calibration)
    cell = table(page, "accelerometer")["bias, mg"][3]
    compared = re.search(r'id="compared">(.*?)</p>', page)[1]
    assert "x outside" in cell
    assert compared.startswith("Outside the data sheet: bias x")
    assert ("corrected" in cell, "This calibration corrects them." in compared) == (corrects, corrects)


def test_a_chip_whose_data_sheet_is_not_at_hand_is_compared_with_none(result):
    page = render(replace(result.calibration, sensor=replace(result.calibration.sensor, chip="ICM-20602")))
    assert len(table(page, "accelerometer")["bias, mg"]) == 3
    assert "data sheet" not in page.partition("</style>")[2]


def test_the_sentence_says_how_sure(result):
    error = result.document["quality"]["error_std"]
    sentence = re.search(r'id="verdict">(.*?)</p>', result.html)[1]
    assert sentence.lower().startswith(result.document["quality"]["verdict"])
    found = re.search(r": (\S+) mg before, (\S+) mg after .*?, (\S+) deg in direction", sentence).groups()
    before, mg, direction = map(float, found)
    assert re.search(r'id="repeatability".*?to about 2 mg from one session to the next', result.html)
    np.testing.assert_allclose([mg * MG, direction], [error["rms"], error["direction_deg"]], rtol=0.06)
    D, b_a = result.calibration.D, result.calibration.b_a
    s = result.document["fit"]["gravity"] * np.random.default_rng(1).normal(size=(20000, 3))
    s /= np.linalg.norm(s, axis=1, keepdims=True) / result.document["fit"]["gravity"]
    wrong = s @ (D - np.eye(3)).T + b_a
    np.testing.assert_allclose(before * MG, np.sqrt((wrong**2).sum(axis=1).mean()), rtol=0.01)


def test_it_says_how_to_fit_it_again(result):
    commands = html.unescape(re.search(r'<pre id="reproduce"[^>]*>(.*?)</pre>', result.html, re.DOTALL)[1]).splitlines()
    fit = result.document["fit"]
    assert commands[0] == f"mpucal calibrate mpu6050.mcap --model {fit['model']} --gravity {fit['gravity']} -o again"
    assert commands[1] == "mpucal session --replay mpu6050.mcap -o replayed"


@pytest.mark.parametrize("name", ["capture.mcap", "capture-2.mcap"])
def test_a_session_is_fitted_again_from_all_its_captures(result, name):
    page = render(result.calibration, replace(result.recording, name=name))
    assert "mpucal calibrate . --model" in page
    assert "mpucal session --replay . -o replayed" in page


def test_what_was_only_tilted_claims_its_tilts_alone(result):
    document = {**result.document, "fit": {**result.document["fit"], "model": "tilt"}}
    sentence = re.search(r'id="verdict">(.*?)</p>', render(Calibration.from_document(document)))[1]
    assert "(rms over the tilts that it is valid for, 1 sigma)" in sentence


def test_the_verification(result):
    document = {
        **result.document,
        "quality": {
            **result.document["quality"],
            "verification": {
                "agrees": True,
                "orientations": [
                    {
                        "down": [0.64, 0.48, -0.59],
                        "magnitude_mps2": -0.00097,
                        "magnitude_std_mps2": 0.0087,
                        "direction_deg": 0.0637,
                        "direction_std_deg": 0.1307,
                        "agrees": True,
                    }
                ],
            },
        },
    }
    page = render(Calibration.from_document(document))
    assert table(page, "verification")["corner +X +Y −Z down"] == ["-0.0010 (±\u00a00.0087)", "0.064 (±\u00a00.131)"]
    assert 'id="verification"' not in result.html


def test_a_number_of_which_nothing_is_known_is_not_shown():
    row = ParameterRow("scale factor error", "%", np.array([6058.0, 2.1, 0.3]), np.array([812.0, 19.0, 0.02]))
    assert row.cells == ["not observable", "+2 ± 19", "+0.300 ± 0.020"]
