"""Each part that is claimed, simulated from its row: the driver calls it by its name and knows its temperature."""

import pytest

from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.chip.families import PARTS
from mpucal.session.events import Prompt, PromptKind
from mpucal.simulated.chip import open_simulated
from tools.lab import chip_sessions


def test_every_part_has_its_name_its_temperature_and_a_source():
    chips = chip_sessions.chips()
    assert {name for _, name, _ in chips} == {part.chip for part in PARTS.values()} | {"MPU-6050C"}
    for words, name, source in chips:
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
    chip, celsius, verdict, error = chip_sessions.session("clone98,who_am_i=0xae", 4)
    assert (chip, verdict) == ("ICM-20608D", "good")
    assert celsius == pytest.approx(27, abs=0.3)
    assert error < 2e-3
