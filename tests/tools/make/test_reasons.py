"""The page of reasons is true."""

import json
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import mpucal
from mpucal.__main__ import run
from mpucal.errors import RefusedError
from mpucal.reasons import KINDS

SESSIONS = Path(__file__).parents[3] / "fixtures" / "sessions"


def codes(quality):
    return [reason["code"] for reason in quality["reasons"]]


SESSION = {code: kind.reproduce for code, kind in KINDS.items() if kind.reproduce.startswith("mpucal session ")}


@pytest.mark.slow
@pytest.mark.parametrize("command", dict.fromkeys(SESSION.values()), ids=lambda words: words.split()[3])
def test_a_session_shows_its_reasons(command, capsys, tmp_path):
    run([*shlex.split(command)[1:], "-o", str(tmp_path / "s"), "--no-write", "--yes", "--json"])
    found = codes(json.loads(capsys.readouterr().out)["quality"])
    assert {code for code in SESSION if SESSION[code] == command} <= set(found)


def test_merging_what_is_merged_already_shows_its_reason(capsys, tmp_path):
    words = shlex.split(KINDS["same_data"].reproduce)[1:]
    file = tmp_path / "calibration.json"
    mpucal.calibrate(mpucal.load(SESSIONS / "mpu6050.mcap")).save(file)
    assert run([word.replace("board7/calibration.json", str(file)) for word in words]) == RefusedError.exit_code
    assert "calibrations 1 and 2 were made of the same recording" in capsys.readouterr().err


@pytest.fixture(scope="module")
def r():
    """A good recording."""
    return mpucal.load(SESSIONS / "mpu6050.mcap")


def test_a_good_recording_shows_none(r):
    assert mpucal.calibrate(r).verdict == "good"


@pytest.mark.parametrize("code", [code for code in KINDS if code not in {*SESSION, "same_data"}])
def test_a_spoilt_recording_shows_its_reason(r, code):
    found = eval(KINDS[code].reproduce, {"mpucal": mpucal, "numpy": np, "replace": replace, "r": r})
    assert code in codes(found.quality)
