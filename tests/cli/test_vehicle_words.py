"""The words of the command line that name vehicles, and what contradicts them."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from mpucal.cli import commands
from mpucal.cli.page import choose_board
from mpucal.cli.summary import use_in_device
from mpucal.origin import Origin
from mpucal.result.calibration import Calibration
from mpucal.sources.opened_source import SOURCE
from mpucal.sources.opening import open_source, reopen_source


def run(*words):
    return CliRunner().invoke(commands, [str(word) for word in words])


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A few seconds of the simulated vehicle, recorded by mpucal."""
    path = tmp_path_factory.mktemp("recorded") / "capture.mcap"
    result = run("record", "--mavlink", "sim:imus=1", "--seconds", 6, "-o", path, "--gravity", 9.81)
    assert result.exception is None, result.output
    return path


def test_a_vehicle_takes_rates_that_a_chip_does_not(tmp_path):
    path = tmp_path / "capture.mcap"
    result = run("record", "--mavlink", "sim:imus=1", "--rate", 300, "--seconds", 4, "-o", path)
    assert result.exception is None, result.output
    shown = run("show", path).output
    assert "ArduPilot-IMU1" in shown
    assert float(re.search(r"at ([\d.]+) Hz", shown).group(1)) > 299


def test_a_replay_sends_nothing_and_does_not_say_to_whom(recorded, tmp_path):
    result = run("session", "--replay", recorded, "-o", tmp_path)
    assert "This is system 1" in result.output
    assert "nothing is sent" not in result.output


def test_a_source_says_what_it_is_and_the_drawn_board_follows_from_it(recorded):
    chip = Path(__file__).parents[2] / "fixtures" / "sessions" / "mpu6050.mcap"
    for values, origin, drawn in (
        ({"replay": recorded}, Origin.VEHICLE, "vehicle"),
        ({"mavlink": "sim:imus=1"}, Origin.VEHICLE, "vehicle"),
        ({"replay": chip}, Origin.CHIP, "gy-521"),
        ({"iio": "sim"}, Origin.DEVICE, "gy-521"),
    ):
        source = open_source(values)
        assert (source.origin, choose_board(None, source)) == (origin, drawn)
        assert choose_board("plain", source) == "plain"
    assert choose_board(None, open_source({"replay": chip, "board": "plain"})) == "plain"


def test_a_resumed_session_reads_its_signing_key_again_from_any_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("key").write_bytes(bytes(range(32)))
    source = open_source({"mavlink": "sim:imus=1", "signing_key": Path("key"), "system": 1})
    words = json.loads(json.dumps(source.source_meta()))[SOURCE]
    monkeypatch.chdir("/")
    again = reopen_source(words, source.plan)
    assert (again.key, again.system) == (bytes(range(32)), 1)


@pytest.mark.parametrize(
    ("extra", "says"),
    [
        ({}, "in firmware  a/calibration.bin"),
        (
            {"autopilot": {"params_new": {"INS_ACCOFFS_X": 0.1}}},
            "mpucal write a/calibration.json autopilot",
        ),
        ({"autopilot": {"params_new": {}, "why": "no slot names it"}}, "cannot be written: no slot names it"),
    ],
    ids=["chip", "vehicle", "vehicle whose parameters are not known"],
)
def test_the_next_step_leads_into_the_device(extra, says):
    assert says in use_in_device(Calibration(np.eye(3), np.zeros(3), extra=extra), Path("a"))
