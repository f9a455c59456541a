"""The simulated bus: options, time, recordings behind the chip, and the driver on it."""

from types import SimpleNamespace

import numpy as np
import pytest

from mpucal.chip import registers as reg
from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.data import Samples
from mpucal.errors import EndOfCapture, RecordingError, UsageError
from mpucal.simulated.chip import open_recorded, open_simulated
from mpucal.simulated.chip.clock import RealClock

G0 = 9.80665


def prompt(kind):
    return SimpleNamespace(kind=kind, down=None)


def session(bus, seconds, rotate_s=None, config=None):
    """A driver's recording of a hand that lays the board flat and, at `rotate_s`, turns it."""
    driver = Driver(bus, config)
    driver.start()
    bus.hear(prompt("lay_flat"))
    end = driver.now_ns() + int(seconds * 1e9)
    said = rotate_s is None
    rotate_ns = 0 if rotate_s is None else driver.now_ns() + int(rotate_s * 1e9)
    while driver.now_ns() < end:
        driver.poll()
        if not said and driver.now_ns() >= rotate_ns:
            bus.hear(prompt("rotate"))
            said = True
    return driver.recording()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        pytest.param("sim:colour=red", "does not know 'colour=red'", id="unknown key"),
        pytest.param("sim:chip", "does not know 'chip'", id="no value"),
        pytest.param("sim:chip=mpu9999", "one of mpu6050, mpu6050c, mpu6500, ", id="unknown chip"),
        pytest.param("sim:hand=robot", "hand=robot is not one of guided, ", id="unknown hand"),
        pytest.param("sim:pace=slow", "one of fast, real", id="unknown pace"),
        pytest.param("sim:seed=-1", "a whole number from 0 on", id="negative seed"),
        pytest.param("sim:seed=x", "a whole number from 0 on", id="no seed"),
        pytest.param("sim:seed=1,seed=2", "seed is given twice", id="twice"),
        pytest.param("sim:b_a=1/2", "three numbers", id="two of three"),
        pytest.param("sim:b_a=1/2/nan", "three numbers", id="no number"),
        pytest.param("sim:D=1/0/0/0/1/0/0/0/0", "that can be inverted", id="singular"),
        pytest.param("sim:who_am_i=0x168", "a byte", id="no byte"),
        pytest.param("sim:noise=-1", "from 0 on", id="negative noise"),
    ],
)
def test_options_that_make_no_sense(text, says):
    with pytest.raises(UsageError, match=r"^sim: ") as caught:
        open_simulated(text)
    assert str(caught.value).count(says) == 1


def test_a_seed_beside_the_text():
    assert open_simulated("sim", seed=5).truth_document()["seed"] == 5
    assert open_simulated("sim:seed=5", seed=5).truth_document()["seed"] == 5
    with pytest.raises(UsageError, match="seed=4 and --seed 5 differ"):
        open_simulated("sim:seed=4", seed=5)


def test_what_is_asked_for_becomes_the_truth():
    text = "sim:chip=mpu6500,rate_error_ppm=4000,b_a=0.1/0.2/-0.3,b_omega=0/0/0.1,temperature_c=30,noise=0"
    truth = open_simulated(text, gravity=9.82).truth_document()
    assert truth["b_a"] == [0.1, 0.2, -0.3]
    assert truth["b_omega"] == [0.0, 0.0, 0.1]
    assert (truth["rate_error_ppm"], truth["temperature_c"], truth["gravity"]) == (4000, 30, 9.82)
    assert truth["accel_noise_density"] == 0


def test_a_gyro_matrix_that_is_not_symmetric_is_brought_to_its_frame():
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    K = "/".join(str(value) for value in turn.ravel())
    truth = open_simulated(f"sim:D=1/0/0/0/1/0/0/0/1,K={K}").truth_document()
    np.testing.assert_allclose(truth["K"], np.eye(3), atol=1e-12)
    np.testing.assert_allclose(truth["D"], turn, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "who_am_i"),
    [("sim", 0x68), ("sim:chip=mpu6500", 0x70), ("sim:chip=clone98", 0x98), ("sim:who_am_i=0x72", 0x72)],
)
def test_the_chip_answers(text, who_am_i):
    assert open_simulated(text).read(reg.WHO_AM_I, 1).data == bytes([who_am_i])


def test_transfers_take_their_time_at_400_khz():
    bus = open_simulated()
    assert bus.read(reg.FIFO_R_W, 56).t_ns == 0
    assert bus.write(reg.SMPLRT_DIV, b"\x04") == (27 + 3 + 9 * 56) * 2500
    bus.sleep_until(5_000_000)
    assert bus.read(reg.WHO_AM_I, 1).t_ns == 5_000_000
    bus.sleep_until(1)
    assert bus.read(reg.WHO_AM_I, 1).t_ns == 5_000_000 + 39 * 2500


def test_at_a_real_pace_time_is_the_hosts():
    clock = RealClock()
    start = clock.now()
    clock.spend(3_000_000)
    assert clock.now() >= start + 3_000_000
    clock.sleep_until(start + 8_000_000)
    assert clock.now() >= start + 8_000_000


def test_a_session_is_the_same_every_time():
    first, second = (session(open_simulated("sim:seed=9"), 5, rotate_s=2) for _ in range(2))
    np.testing.assert_array_equal(first.t, second.t)
    np.testing.assert_array_equal(first.acc, second.acc)
    np.testing.assert_array_equal(first.gyr, second.gyr)


@pytest.mark.parametrize("chip", ["mpu6050", "mpu6500", "clone98"])
def test_the_driver_reads_what_is_true_of_a_board_at_rest(chip):
    bus = open_simulated(f"sim:chip={chip},seed=3,rate_error_ppm=4000", gravity=9.82)
    truth = bus.truth_document()
    recording = session(bus, 15)
    assert not recording.gap.any()
    assert recording.rate_hz == pytest.approx(200 * 1.004, rel=2e-4)
    assert recording.temperature_c.mean() == pytest.approx(truth["temperature_c"], abs=0.05)
    flat = recording.t > recording.t[0] + 5
    expected = np.array(truth["D"])[:, 2] * 9.82 + truth["b_a"]
    np.testing.assert_allclose(recording.acc[flat].mean(axis=0), expected, atol=0.006)
    np.testing.assert_allclose(recording.gyr[flat].mean(axis=0), truth["b_omega"], atol=2e-4)


def test_gravity_carried_by_the_gyro_agrees_with_the_accelerometer():
    bus = open_simulated("sim:seed=11,noise=0")
    truth = {key: np.array(value) for key, value in bus.truth_document().items() if key in ("D", "b_a", "K", "b_omega")}
    recording = session(bus, 45, rotate_s=8)
    force = np.linalg.solve(truth["D"], (recording.acc - truth["b_a"]).T).T
    rates = (recording.gyr - truth["b_omega"]) @ truth["K"].T
    carried, s = [], np.array([0.0, 0.0, G0])
    flat = 6 * 200
    for i, rate in enumerate(rates[flat:], start=flat):
        angle = np.linalg.norm(rate) * (recording.t[i] - recording.t[i - 1])
        axis = rate / np.linalg.norm(rate)
        s = s * np.cos(angle) - np.cross(axis, s) * np.sin(angle) + axis * (axis @ s) * (1 - np.cos(angle))
        carried.append(s)
    carried = np.array(carried)
    # half a second of tremor averages to a few hundredths
    errors = [
        np.linalg.norm(force[flat:][i : i + 100].mean(axis=0) - carried[i : i + 100].mean(axis=0))
        for i in range(0, len(carried) - 100, 100)
        if np.abs(rates[flat:][i : i + 100]).max() < 0.1
    ]
    assert len(errors) > 15
    assert np.median(errors) < 0.04
    assert np.ptp(carried, axis=0).min() > 1.2 * G0


def recorded(n=300, seed=0):
    rng = np.random.default_rng(seed)
    return rng.integers(-32768, 32768, (n, 3)), rng.integers(-32768, 32768, (n, 3))


def served(bus, config):
    driver, parts = Driver(bus, config), []
    driver.start()
    while True:
        try:
            parts.append(driver.poll())
        except EndOfCapture:
            return Samples.joined(parts)


def test_a_recordings_counts_come_out_as_they_are():
    acc, gyr = recorded()
    samples = served(open_recorded(acc, gyr, 100, 2, 250), Config(accel_range_g=2, gyro_range_dps=250, rate_hz=100))
    n = len(samples)
    assert 290 <= n <= 300
    np.testing.assert_allclose(samples.acc, acc[-n:] / 16384 * G0, rtol=1e-12)
    np.testing.assert_allclose(samples.gyr, np.radians(gyr[-n:] / 131), rtol=1e-12)


@pytest.mark.parametrize(
    ("config", "says"),
    [
        pytest.param(Config(4, 250, 100), "set to 4 g, the recording to 2 g", id="accelerometer"),
        pytest.param(Config(2, 500, 100), "set to 500 deg/s, the recording to 250 deg/s", id="gyroscope"),
        pytest.param(Config(2, 250, 200), "set to 200 Hz, the recording to 100 Hz", id="rate"),
    ],
)
def test_a_chip_set_otherwise_than_the_recording_is_an_error(config, says):
    with pytest.raises(UsageError, match=says):
        served(open_recorded(*recorded(), 100, 2, 250), config)


@pytest.mark.parametrize(
    ("acc", "gyr"),
    [
        pytest.param(np.zeros((5, 3)), np.zeros((4, 3)), id="not as many"),
        pytest.param(np.zeros((5, 2)), np.zeros((5, 2)), id="two axes"),
        pytest.param(np.full((5, 3), 0.5), np.zeros((5, 3)), id="fractions"),
        pytest.param(np.full((5, 3), 32768), np.zeros((5, 3)), id="beyond 16 bits"),
        pytest.param(np.full((5, 3), np.nan), np.zeros((5, 3)), id="no numbers"),
    ],
)
def test_what_is_no_recording_of_counts(acc, gyr):
    with pytest.raises(RecordingError):
        open_recorded(acc, gyr, 100, 2, 250)


def test_a_recording_has_no_truth_and_hears_nothing():
    bus = open_recorded(*recorded(), 100, 2, 250)
    bus.hear(prompt("rotate"))
    assert bus.truth_document() is None
