"""Live fits: asked for and brought at fixed numbers of samples, and right about what is known."""

import numpy as np
import pytest

from mpucal.data import Samples, Sensor
from mpucal.live.fits import Live
from mpucal.live.store import Store
from mpucal.session.events import Ask, Checked, Learnt, Tried, Wish
from mpucal.session.plan import Plan
from mpucal.simulation.scenarios import GRAVITY_MPS2, hand_scenario

SENSOR = Sensor(chip="MPU-6050", rate_hz=200.0)
POLL = 20


@pytest.fixture(scope="module")
def poses():
    """Twelve poses of an MPU-6050 in a hand, 200 Hz."""
    return hand_scenario(3, "pose12").recording


def polls(recording, first, last):
    """Samples first..last-1 as they arrive."""
    names = ("t", "acc", "gyr", "temperature_c", "gap", "acc_clipped", "gyr_clipped")
    for a in range(first, last, POLL):
        yield Samples(*(getattr(recording, name)[a : min(a + POLL, last)] for name in names))


def live_at(recording, seconds):
    live = Live(Plan(gravity=GRAVITY_MPS2), SENSOR)
    for samples in polls(recording, 0, round(seconds * 200)):
        live.add(samples)
    return live


def answer(live, recording, first, wish, wait_s=0.1):
    """What comes of an ask, and after how many samples."""
    live.ask(Ask(wish, wait_s))
    for count, samples in enumerate(polls(recording, first, len(recording))):
        live.add(samples)
        answers = live.answers()
        if answers:
            return answers[0], (count + 1) * POLL
    raise AssertionError("no answer came")


def test_an_answer_comes_after_the_asked_number_of_samples_and_no_sooner(poses):
    live = live_at(poses, 20)
    _, count = answer(live, poses, 4000, Wish.KNOW, wait_s=0.5)
    live.close()
    assert count == 100


def test_more_orientations_are_better_known(poses):
    found = []
    for seconds in (18, 26, 44):
        live = live_at(poses, seconds)
        learnt, _ = answer(live, poses, seconds * 200, Wish.KNOW)
        live.close()
        found.append(learnt.knowledge)
    assert [k.overall for k in found] == sorted(k.overall for k in found)
    assert max(found[0].bias_mg) > 3 * max(found[2].bias_mg)
    assert found[2].overall > 0.9
    assert all(0.0 <= p <= 1.0 for k in found for p in (*k.gain, *k.misalignment, *k.bias))
    assert not any(k.doubt for k in found)


def test_the_same_samples_give_the_same_bits(poses):
    def run():
        live = live_at(poses, 22)
        learnt = answer(live, poses, 4400, Wish.ADVISE)[0]
        live.close()
        return learnt

    assert run() == run()


def test_the_advised_orientation_is_a_turn_away(poses):
    live = live_at(poses, 22)
    learnt, _ = answer(live, poses, 4400, Wish.ADVISE)
    live.close()
    assert isinstance(learnt, Learnt)
    assert learnt.advice
    down = np.array(learnt.knowledge.down)
    assert np.linalg.norm(down) == pytest.approx(1.0)
    here = -poses.acc[4390:4400].mean(0) / np.linalg.norm(poses.acc[4390:4400].mean(0))
    assert here @ down < np.cos(np.radians(20.0))


def test_a_try_and_its_check_agree_on_good_data(poses):
    live = live_at(poses, 40)
    tried, _ = answer(live, poses, 8000, Wish.TRY)
    live.close()
    assert isinstance(tried, Tried)
    assert tried.verdict in ("good", "usable")

    live = live_at(poses, 40)
    live.ask(Ask(Wish.TRY, 0.1))
    for samples in polls(poses, 8000, len(poses)):
        live.add(samples)
    live.ask(Ask(Wish.CHECK, 0.0))
    checked = live.answers()[-1]
    live.close()
    assert isinstance(checked, Checked)
    assert checked.agrees, checked
    assert all(v.direction_deg < 1.0 and abs(v.magnitude_mps2) < 0.1 for v in checked.found)


def test_what_is_forgotten_is_not_computed(poses):
    live = live_at(poses, 30)
    live.ask(Ask(Wish.KNOW, 0.0))
    live.forget(2200)
    assert not live.answers()
    learnt, _ = answer(live, poses, 6000, Wish.KNOW, wait_s=4.0)
    live.close()
    assert learnt.knowledge.overall < 0.2


@pytest.mark.parametrize(("rate_hz", "size"), [(50.0, 1), (200.0, 1), (1000.0, 5), (500.0, 2)])
def test_faster_samples_are_averaged(rate_hz, size):
    n = 1003
    t = np.arange(n) / rate_hz
    no = np.zeros(n, bool)
    gap = no.copy()
    gap[501] = True
    samples = Samples(t, np.tile(t[:, None], (1, 3)), np.zeros((n, 3)), np.full(n, 25.0), gap, no, no)
    store = Store(Sensor(rate_hz=rate_hz))
    for first in range(0, n, 7):
        store.add(Samples(*(array[first : first + 7] for array in vars(samples).values())))
    recording = store.recording()
    assert len(recording) == n // size
    np.testing.assert_allclose(recording.acc[:, 0], recording.t)
    assert np.flatnonzero(recording.gap).tolist() == [501 // size]
