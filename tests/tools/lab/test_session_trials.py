"""Sessions on a chip that suffers faults end in a true calibration or a true refusal, and never in a trace.

Each part that is claimed is simulated from its row: the driver calls it by its name and knows its temperature.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.chip.families import PARTS
from mpucal.session.events import Prompt, PromptKind
from mpucal.simulated.chip import open_simulated
from tools.lab import session_trials as trials

LONGEST_S = 60
seeds = st.integers(0, 2**32 - 1)


@settings(max_examples=1)
@given(seeds)
def test_no_session_calls_a_wrong_calibration_good(seed):
    rng = np.random.default_rng(seed)
    faults = trials.struck(rng, rng.choice(trials.FAULTS, 2), LONGEST_S)
    ended = trials.of_faulty("", faults, seed, model="accel")
    assert not ended.wrong, ended
    assert ended.verdict != trials.NOTHING or ended.said


@pytest.mark.parametrize("number", range(len(trials.FAULTS)), ids=trials.FAULTS)
@settings(max_examples=1)
@given(seed=seeds)
def test_no_pair_of_faults_makes_a_wrong_calibration_good(number, seed):
    """Each fault and another in a recording calibrated afterwards: as a session, without the fits behind its advice."""
    rng = np.random.default_rng([seed, number])
    faults = trials.struck(rng, [trials.FAULTS[number], rng.choice(trials.FAULTS)], trials.RECORDED_S)
    ended = trials.of_faulty("", faults, seed, record=True)
    assert not ended.wrong, (faults, seed, ended)
    assert ended.verdict != trials.NOTHING or ended.said


def test_every_part_has_its_name_its_temperature_and_a_source():
    parts = trials.parts()
    assert {name for name, _ in parts.values()} == {part.chip for part in PARTS.values()} | {"MPU-6050C"}
    for words, (name, source) in parts.items():
        bus = open_simulated(f"sim:chip={words},seed=4,temperature_c=27")
        bus.hear(Prompt(PromptKind.LAY_FLAT, ""))
        driver = Driver(bus, Config())
        found = driver.start()
        end_ns = driver.now_ns() + 5e8
        while driver.now_ns() < end_ns:
            driver.poll()
        assert (found.chip, bool(source)) == (name, True)
        assert driver.recording().temperature_c.mean() == pytest.approx(27, abs=0.3)
        driver.stop()


def test_a_session_on_a_part_that_only_its_identity_names_ends_good():
    ended = trials.of_part("clone98,who_am_i=0xae", 4)
    assert (ended.verdict, ended.wrong) == ("good", "")
    assert ended.said.startswith("ICM-20608D, 27.")
