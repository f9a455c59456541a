"""The table of reasons: complete, each used, the only source of reasons; and each can be caused as its page says."""

import ast
import json
import shlex
from dataclasses import replace
from pathlib import Path
from string import Formatter

import numpy as np
import pytest

import mpucal
from mpucal.__main__ import run
from mpucal.errors import RefusedError
from mpucal.reasons import KINDS, reason

SESSIONS = Path(__file__).parents[1] / "fixtures" / "sessions"
PACKAGE = Path(mpucal.__file__).parent
ALL = {(code, name): row for code, kind in KINDS.items() for name, row in kind.sentences.items()}


def calls():
    """{(code, sentence): [the keywords of a call]}, of every call of `reason` in the package."""
    found = {}
    for text in (path.read_text() for path in PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(text)) if " reason(" in text or "(reason(" in text else ():
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "reason":
                code, *rest = node.args
                codes = [value.value for value in CODES_BY_ARGUMENT.get(ast.unparse(code), [code])]
                for sentence in ast.walk(rest[0]):
                    if isinstance(sentence, ast.Constant) and isinstance(sentence.value, str):
                        for each in codes:
                            found.setdefault((each, sentence.value), []).append((len(rest), node.keywords))
    return found


# a helper that is called for two codes
CODES_BY_ARGUMENT = {"code": [ast.Constant("gyro_clipped"), ast.Constant("accel_clipped")]}


def test_every_sentence_is_used_and_every_use_fills_its_places():
    made = calls()
    assert made.keys() == ALL.keys()
    for key, uses in made.items():
        row = ALL[key]
        places = {name for text in (row.what, row.remedy) for _, name, _, _ in Formatter().parse(text) if name}
        for arguments, keywords in uses:
            given = {keyword.arg for keyword in keywords}
            assert given - {"refuse"} == places, key
            assert (row.refuse is None) == (arguments == 2 or "refuse" in given), key


def test_a_row_is_whole():
    for code, kind in KINDS.items():
        assert kind.meaning.endswith("."), code
        assert (kind.refuses == "depends") == bool(kind.refused_when), code
        for row in kind.sentences.values():
            assert row.what, code
            assert row.remedy, code
            assert not row.what.endswith((".", ";"))
            assert not row.remedy.endswith(".")


def test_the_table_or_the_caller_decides_whether_a_reason_refuses():
    assert reason("never_still", "at_all").refuse
    assert not reason("gyro_clipped", "samples", False, count=1, share=0.01).refuse
    for refuse, of in ((None, ("gyro_clipped", "samples")), (False, ("never_still", "at_all"))):
        with pytest.raises(ValueError, match=of[0]):
            reason(*of, refuse=refuse, count=1, share=0.01)


# ---- the commands of the page


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


@pytest.mark.parametrize("code", [code for code in KINDS if code not in {*SESSION, "same_data"}])
def test_a_spoilt_recording_shows_its_reason(r, code):
    found = eval(KINDS[code].reproduce, {"mpucal": mpucal, "numpy": np, "replace": replace, "r": r})
    assert code in codes(found.quality)
