"""The troubles of the page, each on a simulated chip that has it."""

from pathlib import Path

import pytest

from mpucal.chip.config import Config
from mpucal.doctor.examine import examine
from mpucal.errors import SourceError
from mpucal.session.events import Prompt, PromptKind
from mpucal.simulated.chip import open_simulated

PAGE = Path(__file__).parents[2] / "docs" / "doctor.md"
HEAD = "| trouble | reported | `--bus sim:` | the doctor says |\n|---|---|---|---|\n"


def rows():
    lines = PAGE.read_text(encoding="utf-8").split(HEAD)[1].split("\n\n")[0].splitlines()
    for line in lines:
        trouble, _, words, says = (cell.strip() for cell in line.strip("|").split(" | "))
        yield pytest.param(words.strip("`"), says, id=trouble)


@pytest.mark.parametrize(("words", "says"), list(rows()))
def test_the_doctor_names_it(words, says):
    bus = open_simulated(f"sim:seed=3,{words}")
    try:
        bus.hear(Prompt(PromptKind.LAY_FLAT, ""))
        told = [f"{finding.what}: {finding.remedy}" for finding in examine(bus, Config(), 5.0)]
    except SourceError as error:
        told = [str(error)]
    assert any(says in sentence for sentence in told), told
