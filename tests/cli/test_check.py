"""`mpucal check` of a sensor and of a recording, and the files that it writes."""

import json
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from mpucal import result
from mpucal.result.calibration import Calibration


@pytest.fixture
def calibration(session):
    return session.folder / "calibration.json"


def test_check_of_a_recording(mpucal, session, calibration):
    done = mpucal("check", calibration, session.folder)
    assert (done.code, done.out.split(":")[0]) == (0, "Still good")
    document = json.loads(mpucal("check", calibration, session.folder, "--json").out)
    assert (document["format"], document["verdict"], document["what"]) == ("mpucal.check", "still good", "nothing")


def test_check_of_a_sensor_takes_half_a_minute_and_updates_its_biases(mpucal, calibration, tmp_path):
    done = mpucal(
        "check",
        calibration,
        "--bus",
        "sim",
        "--seed",
        "3",
        "--rate",
        "100",
        "-o",
        "today",
        "--to",
        "chip",
        "--yes",
        code=0,
    )
    assert "held 3 of 3" in done.err
    assert "Done: the offset registers" in done.out
    written = {path.name for path in (tmp_path / "today").iterdir()}
    assert {"capture.mcap", "check.json", "calibration.json", "calibration.bin"} <= written
    seconds = json.loads((tmp_path / "today" / "check.json").read_text())["seconds"]
    assert seconds < 35.0
    document = json.loads((tmp_path / "today" / "calibration.json").read_text())
    schema = json.loads((Path(result.__file__).parent / "calibration.schema.json").read_text())
    Draft202012Validator(schema).validate(document)
    assert document["updated_from"][0]["b_a"] == Calibration.load(calibration).b_a.tolist()
    # The capture is a recording, and can be replayed.
    for words in (("today/capture.mcap",), ("--replay", "today/capture.mcap")):
        assert mpucal("check", calibration, *words).out.splitlines()[0] == done.out.splitlines()[0]


def test_an_altered_calibration_is_used_only_with_force_and_its_outputs_name_it(mpucal, session, spoilt, tmp_path):
    assert mpucal("check", spoilt, session.folder).code == 0
    words = ("check", spoilt, session.folder, "-o", "today")
    refused = mpucal(*words)
    assert (refused.code, "nothing was written" in refused.err) == (6, True)
    assert not (tmp_path / "today").exists()
    assert mpucal(*words, "--force").code == 0
    assert mpucal("merge", spoilt, spoilt).code == 6
    # A merge of twice the same data is refused.
    assert mpucal("merge", spoilt, spoilt, "--force").code == 5
    exported = mpucal("export", spoilt, "--to", "c-header")
    assert "its digest does not match" in exported.out
    Calibration.load(spoilt).save(tmp_path / "again.json")
    assert "no digest" in Calibration.load(tmp_path / "again.json").doubt


def test_check_refuses_another_sensor(mpucal, calibration, tmp_path):
    done = mpucal("check", calibration, "--bus", "sim", "--seed", "4", "--rate", "100", "-o", "other", "--yes", code=5)
    assert done.out.startswith("Another sensor: its offset registers hold")
    assert not (tmp_path / "other" / "calibration.json").exists()
