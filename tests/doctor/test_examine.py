"""The examination of simulated chips: the finding of each kind of chip and fault."""

import json
from dataclasses import replace

import numpy as np
import pytest

from mpucal.chip.config import Config
from mpucal.chip.quick_measure import PATIENCE, READS
from mpucal.data import Recording, Sensor
from mpucal.doctor.dead_axes import dead_axes, live_axes
from mpucal.doctor.examine import examine
from mpucal.doctor.finding import Finding, Mark, document, text
from mpucal.session.events import Prompt, PromptKind
from mpucal.simulated.chip import open_simulated


@pytest.fixture
def topics(examined):
    """The findings of a chip, by their topics."""

    def call(words):
        return {finding.topic: finding for finding in examined(words)}

    return call


def findings(bus):
    bus.hear(Prompt(PromptKind.LAY_FLAT, ""))
    return {finding.topic: finding for finding in examine(bus, Config(), 3.0)}


@pytest.mark.parametrize(
    ("chip", "place", "genuine"),
    [
        ("mpu6050,rate_error_ppm=-7000", 0x06, True),
        ("mpu6500", 0x77, True),
        ("clone98", 0x77, True),
        ("clone98,who_am_i=0x68", 0x77, False),
    ],
)
def test_a_sound_chip_has_no_fault(topics, chip, place, genuine):
    by_topic = topics(f"chip={chip}")
    assert [topic for topic, finding in by_topic.items() if finding.mark is Mark.BAD] == []
    assert by_topic["offset registers"].data["place"] == place
    assert (by_topic["genuine?"].mark is Mark.OK) is genuine
    assert by_topic["bus speed"].data["achieved_hz"] == pytest.approx(400_000, rel=0.01)
    if "rate_error_ppm" in chip:
        assert by_topic["sample rate"].data["rate_hz"] == pytest.approx(200 * 0.993, rel=1e-3)


@pytest.mark.parametrize(
    ("keys", "topic", "mark"),
    [
        ("rate_error_ppm=30000", "sample rate", Mark.BAD),
        ("noise=6", "accelerometer noise", Mark.BAD),
        ("noise=2", "gyroscope noise", Mark.NOTE),
        ("offsets=readonly", "offset registers", Mark.NOTE),
        ("offsets=readonly", "genuine?", Mark.NOTE),
        ("b_omega=0.5/0/0", "zero rate", Mark.NOTE),
        ("b_a=0/0/3", "at rest", Mark.NOTE),
        ("temperature_c=90", "temperature", Mark.NOTE),
        ("hand=restless", "noise", Mark.UNKNOWN),
        ("fault=brownout@6", "losses", Mark.BAD),
        ("fault=bit_errors@0", "bit errors", Mark.BAD),
        ("fault=nacks", "transfers", Mark.NOTE),
        ("fault=low_x", "dead axis", Mark.BAD),
    ],
)
def test_each_fault_is_found(topics, keys, topic, mark):
    by_topic = topics(keys)
    assert by_topic[topic].mark is mark
    assert by_topic[topic].remedy


def test_a_board_that_is_never_put_down_costs_one_wait(topics):
    by_topic = topics("hand=restless")
    assert "the board moves" in by_topic["offset registers"].what
    # What such a board shows says nothing about the chip.
    assert (by_topic["self test"].mark, by_topic["self test"].what) == (Mark.UNKNOWN, "the board moved")
    assert (by_topic["genuine?"].mark, by_topic["genuine?"].what) == (Mark.UNKNOWN, "undecided: the board moved")
    assert "stuck bits" not in by_topic
    assert PATIENCE * READS < by_topic["transfers"].data["transfers"] < 1.5 * PATIENCE * READS


def test_a_board_that_is_put_down_late_is_examined():
    bus = open_simulated("sim:hand=still", seed=51)
    by_topic = {}
    for finding in examine(bus, Config(), 3.0):
        # The finding of the chip comes after the wait.
        if finding.topic == "chip":
            bus.hear(Prompt(PromptKind.REST, ""))
        by_topic[finding.topic] = finding
    assert by_topic["transfers"].data["transfers"] > PATIENCE * READS
    assert by_topic["offset registers"].mark is Mark.OK


def test_transfers_that_fail_now_and_then_are_counted_and_stop_nothing(topics):
    by_topic = topics("fault=nacks")
    counted = by_topic["transfers"].data
    assert counted["errors"] == {"not acknowledged": pytest.approx(counted["transfers"] / 50, rel=0.5)}
    assert 0 < counted["retries"] <= counted["errors"]["not acknowledged"]
    assert "genuine?" in by_topic
    assert "100 kHz" in by_topic["transfers"].remedy


def test_an_axis_that_dies_midway_is_named_and_one_that_rarely_changes_is_not():
    rng = np.random.default_rng(1)
    counts = np.rint(rng.normal((300, -7, 8192), 16, (2000, 3)))
    acc = counts * (4 * 9.80665 / 32768)
    acc[1200:, 1] = acc[1200, 1]
    rare = np.where(np.arange(2000) % 900 == 899, 0.001, 0.0)
    gyr = np.column_stack([rng.normal(0, 1e-3, (2000, 2)), rare])
    recording = replace(Recording.from_arrays(np.arange(2000) / 200, acc, gyr), sensor=Sensor(accel_range_g=4.0))
    (found,) = dead_axes(recording)
    assert (found.data["dead"], "from 6 s on" in found.what) == (["accelerometer y"], True)
    assert [mask.tolist() for mask in live_axes(recording)] == [[True, False, True], [True, True, True]]


def test_stuck_bits_of_a_revision_c_are_found_at_half_the_scale(topics):
    by_topic = topics("chip=mpu6050c,fault=high_bit@0")
    assert by_topic["stuck bits"].what == "bit 12 of accelerometer y does not move"


@pytest.mark.parametrize("at_s", [0, 6])
def test_an_unplugged_chip_ends_the_examination_with_a_finding(topics, at_s):
    by_topic = topics(f"fault=unplugged@{at_s}")
    assert list(by_topic.values())[-1].mark is Mark.BAD
    assert "nothing answers" in list(by_topic.values())[-1].what
    assert "genuine?" not in by_topic


def test_a_correction_is_still_there_afterwards():
    bus = open_simulated("sim:chip=mpu6500")
    bus.write(0x77, b"\x12\x34")
    assert findings(bus)["factory trim"].mark is Mark.NOTE
    assert bus.read(0x77, 2).data == b"\x12\x34"


def test_page_and_document_hold_every_finding():
    all_of = [Finding("chip", Mark.OK, "a chip"), Finding("bus", Mark.BAD, "is slow", "mend it", {"hz": 1.0})]
    page, content = text("sim", "1.0", all_of), json.loads(document("sim", "1.0", all_of))
    assert "! bus" in page
    assert "-> mend it" in page
    assert page.endswith("1 fault (!), no notes (* or ?).")
    assert [finding["topic"] for finding in content["findings"]] == ["chip", "bus"]
    assert content["findings"][1]["data"] == {"hz": 1.0}


@pytest.mark.parametrize("at_s", [7.72, 11.91])
def test_a_reset_during_the_examination_is_not_called_a_defect(at_s):
    """Each reset falls into the self test, or into the measurement with shifted offset registers."""
    by_topic = findings(open_simulated(f"sim:chip=mpu6050,fault=brownout@{at_s}"))
    assert "lost its settings" in by_topic["broken off"].what
    assert "supply" in by_topic["broken off"].remedy
    assert not {"dead axis", "stuck bits"} & {topic for topic, found in by_topic.items() if found.mark is Mark.BAD}
