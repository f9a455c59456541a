"""Troubles of docs/doctor.md, each on a simulated chip that has it."""

from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "doctor.md"
HEAD = "| trouble | reported | `--bus sim:` | the doctor says |\n|---|---|---|---|\n"


# troubles with the finding of another row
REPEATED = ("zero_acc", "stuck_ax", "full_acc", "zero_gyro", "stuck_gy", "zero_acc/zero_gyro", "overflow@6", "stuckbit")


def rows():
    lines = PAGE.read_text(encoding="utf-8").split(HEAD)[1].split("\n\n")[0].splitlines()
    for line in lines:
        trouble, _, words, says = (cell.strip() for cell in line.strip("|").split(" | "))
        words = words.strip("`")
        # tests/chip identifies the families in the gate
        repeated = words.startswith("chip=") or words.removeprefix("fault=") in REPEATED
        yield pytest.param(words, says, id=trouble, marks=[pytest.mark.slow] if repeated else [])


@pytest.mark.parametrize(("words", "says"), list(rows()))
def test_the_doctor_names_each_trouble(examined, words, says):
    sentences = [f"{finding.what}: {finding.remedy}" for finding in examined(words)]
    assert any(says in sentence for sentence in sentences), sentences
