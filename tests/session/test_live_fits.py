"""Live fits: right about what is known, and the same for the same samples."""

from dataclasses import replace

import numpy as np
import pytest

from mpucal.data import Recording, Samples, Sensor
from mpucal.mavlink.texts import ReceivedPrompt
from mpucal.session.aims import ALL_AROUND
from mpucal.session.events import Checked, FitKind, Learnt, Tried
from mpucal.session.live_fits import Fits, SampleStore, Task
from mpucal.session.plan import Plan
from mpucal.simulated.disturbance import ARMS
from mpucal.simulated.hands import HANDS
from mpucal.simulated.motion import Motion
from tools.lab.scenarios.recordings import hand_scenario
from tools.lab.scenarios.sensors import GRAVITY_MPS2

SENSOR = Sensor(chip="MPU-6050", rate_hz=200.0)


@pytest.fixture(scope="module")
def poses():
    """Twelve poses of an MPU-6050 in a hand, 200 Hz."""
    return hand_scenario(3, "pose12").recording


def part(recording, first_s, last_s=None):
    """The samples of that time."""
    chosen = slice(round(first_s * 200), None if last_s is None else round(last_s * 200))
    return recording.at(chosen)


@pytest.fixture(scope="module")
def swaying():
    """A sensor whose gyroscope has a growing bias, in the hand of an arm that sways: 22 poses in 100 s."""
    rng = np.random.default_rng(1)
    downs = rng.permutation(ALL_AROUND)[:22].tolist()
    motion = Motion(HANDS["guided"](rng), rng, GRAVITY_MPS2, disturbance=ARMS["standing"])
    motion.hear(ReceivedPrompt("lay_flat", None), 0.0)
    parts = [motion.means(np.arange(2401) / 200)]
    for pose, down in enumerate(downs):
        motion.hear(ReceivedPrompt("rotate", tuple(down)), 12.0 + 4.0 * pose)
        parts.append(motion.means(12.0 + 4.0 * pose + np.arange(801) / 200))
    acc, gyr = (np.concatenate(values) for values in zip(*parts, strict=True))
    t = np.arange(1, len(acc) + 1) / 200
    drift = np.radians(0.1 / 60.0) * np.maximum(t - 10.0, 0.0)[:, None]
    noisy = acc + rng.normal(0.0, 0.02, acc.shape), gyr + drift + rng.normal(0.0, 1e-3, gyr.shape)
    return Recording.from_arrays(t, *noisy, sensor=SENSOR)


def after(samples, seconds):
    """Return the samples `seconds` later, after a gap."""
    return replace(samples, t=samples.t + seconds, gap=np.arange(len(samples)) == 0)


@pytest.fixture
def fits():
    return Fits(Plan(gravity=GRAVITY_MPS2), SENSOR)


def test_the_advised_orientation_is_a_turn_away(fits, poses):
    learnt = fits.do(Task(part(poses, 0, 22), FitKind.ADVISE))
    assert isinstance(learnt, Learnt)
    assert learnt.advice
    down = np.array(learnt.knowledge.down)
    assert np.linalg.norm(down) == pytest.approx(1.0)
    here = -poses.acc[4390:4400].mean(0) / np.linalg.norm(poses.acc[4390:4400].mean(0))
    assert here @ down < np.cos(np.radians(20.0))


def test_a_try_and_its_check_agree_on_good_data(fits, poses):
    tried = fits.do(Task(part(poses, 0, 32), FitKind.TRY))
    assert isinstance(tried, Tried)
    assert tried.verdict in ("good", "usable")
    checked = fits.do(Task(part(poses, 32), FitKind.CHECK, of=3))
    assert isinstance(checked, Checked)
    assert checked.agrees, checked
    assert all(v.direction_deg < 1.0 and abs(v.magnitude_mps2) < 0.1 for v in checked.verifications)


@pytest.mark.parametrize(("slipped_deg", "agrees"), [(0.0, True), (1.5, False)])
def test_a_growing_bias_of_the_gyroscope_is_told_from_a_mount_that_slips(fits, swaying, slipped_deg, agrees):
    """The mean rates of the rests hide the bias, as the arm sways; the fit knows it."""
    fits.do(Task(part(swaying, 0, 84), FitKind.TRY))
    later = part(swaying, 84)
    slipped = later.acc - np.cross(np.radians(slipped_deg) * np.array([0.6, 0.0, 0.8]), later.acc)
    checked = fits.do(Task(replace(later, acc=slipped), FitKind.CHECK, of=3))
    assert checked.agrees == agrees, checked


def test_orientations_that_the_fit_has_seen_verify_nothing(fits, poses):
    fits.do(Task(part(poses, 0, 44), FitKind.TRY))
    checked = fits.do(Task(after(part(poses, 18, 44), 26.0 + 1 / 200), FitKind.CHECK, of=3))
    assert (checked.verifications, checked.agrees) == ((), None)
    assert checked.reason.what.startswith("the board was held still in 0 of 3 orientations that the calibration has")
    assert not checked.reason.refuse


def test_orientations_that_the_fit_has_seen_may_refute_it(fits, poses):
    fits.do(Task(part(poses, 0, 44), FitKind.TRY))
    again = after(part(poses, 18, 44), 26.0 + 1 / 200)
    checked = fits.do(Task(replace(again, acc=1.03 * again.acc), FitKind.CHECK, of=3))
    assert checked.agrees is False
    assert "|a| is +0.3" in checked.reason.what


@pytest.mark.parametrize(("rate_hz", "size"), [(50.0, 1), (200.0, 1), (1000.0, 5), (500.0, 2)])
def test_faster_samples_are_averaged(rate_hz, size):
    n = 1003
    t = np.arange(n) / rate_hz
    no = np.zeros(n, bool)
    gap = no.copy()
    gap[501] = True
    samples = Samples(t, np.tile(t[:, None], (1, 3)), np.zeros((n, 3)), np.full(n, 25.0), gap, no, no)
    store = SampleStore(Sensor(rate_hz=rate_hz))
    for first in range(0, n, 7):
        store.add(samples.at(slice(first, first + 7)))
    recording = store.recording()
    assert len(recording) == n // size
    np.testing.assert_allclose(recording.acc[:, 0], recording.t)
    assert np.flatnonzero(recording.gap).tolist() == [501 // size]
