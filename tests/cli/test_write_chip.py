"""`mpucal write ... chip` and `mpucal doctor` on the simulated chip."""

import json

import pytest


@pytest.fixture(scope="module")
def calibrated(session):
    return session.folder / "calibration.json"


def test_the_written_calibration_states_what_the_chip_subtracts(mpucal, calibrated, tmp_path):
    written = mpucal("write", calibrated, "chip", "--bus", "sim:seed=3", "-o", tmp_path, "--json")
    assert written.code == 0, written.err
    b_a = json.loads(calibrated.read_text())["accelerometer"]["b_a"]
    assert json.loads(written.out)["applied_in_hardware"]["b_a"] == pytest.approx(b_a, abs=0.006)
    left = {path.name for path in tmp_path.iterdir()}
    assert left >= {"chip-offsets.json", "calibration-on-chip.json", "calibration-on-chip.bin"}
    assert json.loads((tmp_path / "calibration-on-chip.json").read_text()) == json.loads(written.out)


def test_numbers_that_changed_since_are_written_only_by_force(mpucal, spoilt, tmp_path):
    words = ("write", spoilt, "chip", "--bus", "sim:seed=3", "-o", tmp_path / "out")
    refused = mpucal(*words)
    assert (refused.code, "its digest does not match" in refused.err) == (6, True)
    assert not (tmp_path / "out").exists()
    assert mpucal(*words, "--force").code == 0
    shown = mpucal("show", spoilt)
    assert (shown.code, "its digest does not match" in shown.err) == (0, True)


def test_a_write_to_volatile_registers_is_announced(mpucal, calibrated, tmp_path):
    result = mpucal("write", calibrated, "chip", "--bus", "sim:seed=3", "-o", tmp_path)
    assert "volatile" in result.out


@pytest.mark.parametrize(
    ("bus", "words"),
    [
        ("sim:seed=4", "the old state of the offset registers is restored"),
        ("sim:seed=3,offsets=readonly", "does not respond to its offset registers"),
        ("sim:seed=3,chip=mpu6500", "nothing was written"),
    ],
    ids=["other_piece", "read_only", "other_chip"],
)
def test_a_refusal_is_exit_code_6_and_one_sentence(mpucal, calibrated, tmp_path, bus, words):
    result = mpucal("write", calibrated, "chip", "--bus", bus, "-o", tmp_path)
    assert result.code == 6
    assert words in result.err
    assert "Traceback" not in result.err
    assert not (tmp_path / "calibration-on-chip.json").exists()


def test_a_doctor_wants_a_bus(mpucal, session):
    assert mpucal("doctor", "--replay", session.folder / "capture.mcap").code == 2
