"""Simulated chips, each examined once in a run of the tests, whichever test asks first."""

import json
from urllib.parse import quote

import pytest

from mpucal.chip.config import Config
from mpucal.doctor.examine import examine
from mpucal.doctor.finding import Finding, Mark
from mpucal.session.events import Prompt, PromptKind
from mpucal.simulated.chip import open_simulated

SECONDS = 5.0


@pytest.fixture(scope="session")
def examined(once):
    """Examine the chip that `words` describe, on a board that is laid flat."""

    def call(words):
        def make(folder):
            bus = open_simulated(f"sim:seed=3,{words}")
            bus.hear(Prompt(PromptKind.LAY_FLAT, ""))
            found = [finding.document() for finding in examine(bus, Config(), SECONDS)]
            (folder / "found.json").write_text(json.dumps(found), encoding="utf-8")

        folder = once(f"examined {quote(words, safe='')}", make)
        found = json.loads((folder / "found.json").read_text(encoding="utf-8"))
        return [Finding(**{**finding, "mark": Mark(finding["mark"])}) for finding in found]

    return call
