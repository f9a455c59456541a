"""Hostile names and dates: refused by the reader, and written only into comments.

Each form's consumer is the judge: what it makes of the file is the same whatever the sensor is called.
"""

import ast
import json
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from mpucal.errors import RecordingError
from mpucal.export.forms import FORMS
from mpucal.result.calibration import Calibration

HOSTILE = (
    "x\ntouch PWNED",
    'x"; touch PWNED; "',
    "$(touch PWNED) `touch PWNED`",
    '"""\nopen("PWNED", "w")\n"""',
    "\\",
    "x */ int pwned; /*",
    "x ??/\nint pwned;",
    "x\nSM: [1.0]",
    "x\nINS_ACCOFFS_X,7",
    "x\x85int pwned;\u2028int pwned;",
    "!lambda return 0;",
)


def meaning_to_c(folder, name, text):
    if shutil.which("gcc") is None:
        pytest.skip("needs gcc")
    (folder / name).write_text(text)
    (folder / "Wire.h").write_text("")
    (folder / "MPU6050.h").write_text("")
    words = ["gcc", "-trigraphs", "-w", "-I.", "-E", "-P", "-x", "c++" if name.endswith(".ino") else "c", name]
    return subprocess.run(words, cwd=folder, capture_output=True, text=True, check=True).stdout


def meaning_to_sh(folder, name, text):
    (folder / name).write_text(text)
    subprocess.run(["sh", "-n", name], cwd=folder, check=True)
    (folder / "iio").mkdir(exist_ok=True)
    run = subprocess.run(["sh", name, "iio"], cwd=folder, capture_output=True, check=False)
    written = {path.name: path.read_text() for path in (folder / "iio").iterdir()}
    return run.returncode, run.stdout, written


def meaning_to_python(folder, name, text):
    documented = ast.parse(text).body
    if isinstance(documented[0], ast.Expr):
        assert isinstance(documented[0].value, ast.Constant)
        del documented[0]
    return [ast.dump(node) for node in documented]


def meaning_to_yaml(folder, name, text):
    # OpenCV's own first line
    return yaml.load(text.removeprefix("%YAML:1.0"), PlainLoader)


def meaning_to_mavlink(folder, name, text):
    rows = [re.split(r"[\t,]", line) for line in text.splitlines() if line and not line.startswith("#")]
    assert len(rows) == 6
    return rows


def meaning_to_json(folder, name, text):
    document = json.loads(text)
    document["sensor"].pop("chip")
    for words in ("created", "digest"):
        document.pop(words)
    return document


def meaning_without_comments(folder, name, text):
    """Return the lines of another language that are no comments."""
    return [line for line in text.splitlines() if not line.startswith(("#", "%", "//", "--"))]


class PlainLoader(yaml.SafeLoader):
    """YAML as ESPHome reads it: `!lambda` and the like are tags."""


PlainLoader.add_multi_constructor("!", lambda loader, tag, node: (tag, node.value))

CONSUMERS = {
    ".h": meaning_to_c,
    ".ino": meaning_to_c,
    ".sh": meaning_to_sh,
    ".py": meaning_to_python,
    ".yaml": meaning_to_yaml,
    ".param": meaning_to_mavlink,
    ".params": meaning_to_mavlink,
    ".json": meaning_to_json,
}


def of_vehicle(calibration, name):
    """Return the calibration, as one of a vehicle for a vehicle's form."""
    if name == "ardupilot":
        firmware, names = "ArduPilot", [f"INS_ACC{kind}_{axis}" for kind in ("OFFS", "SCAL") for axis in "XYZ"]
    elif name == "px4":
        firmware, names = "PX4", [f"CAL_ACC0_{axis}{kind}" for kind in ("OFF", "SCALE") for axis in "XYZ"]
    else:
        return calibration
    values = {each: float("SCAL" in each) for each in names}
    document = {"firmware": firmware, "imu": 1, "message": "RAW_IMU", "params_old": values, "params_new": values}
    document |= {"residual_mps2": 0.1, "mounting": np.eye(3).tolist()}
    return replace(calibration, extra={"autopilot": document})


@pytest.mark.parametrize("row", FORMS, ids=lambda row: row.name)
def test_a_name_or_a_date_changes_nothing_but_remarks(calibration, row, tmp_path):
    calibration = of_vehicle(calibration, row.name)

    def meaning(chip, created=calibration.created):
        named = replace(calibration, created=created, sensor=replace(calibration.sensor, chip=chip))
        return CONSUMERS.get(row.suffix, meaning_without_comments)(
            tmp_path, f"calibration{row.suffix}", row.export(named)[0]
        )

    # the file of an unknown chip with a harmless name
    plain = meaning("another")
    for words in HOSTILE:
        assert meaning(words, words) == plain, words
        assert not list(Path(tmp_path).rglob("PWNED")), words


@pytest.mark.parametrize("key", ["created", "chip", "message"])
def test_a_document_with_such_a_name_is_no_calibration(calibration, key, tmp_path):
    for words in HOSTILE:
        document = calibration.document()
        (document if key == "created" else document["sensor"])[key] = words
        (tmp_path / "c.json").write_text(json.dumps(document))
        with pytest.raises(RecordingError, match=f"{key} is|a string holds"):
            Calibration.load(tmp_path / "c.json")


def test_a_time_of_iso_8601_is_read_and_another_refused(calibration):
    document = calibration.document()
    for created in ("", "2024-05-17", "2024-05-17 09:30:00.123456Z", "2024-05-17T09:30:00"):
        assert Calibration.from_document(document | {"created": created}).created == created
    for created in ("2024-13-17", '2024-05-17"09:30:00', "2024-05-17\n09:30:00", 7):
        with pytest.raises(ValueError, match=r"created|month"):
            Calibration.from_document(document | {"created": created})
