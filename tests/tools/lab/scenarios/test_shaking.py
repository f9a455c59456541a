import numpy as np
import pytest

from mpucal.simulated.disturbance import HandDisturbance
from tools.lab.scenarios import body
from tools.lab.scenarios.body import band_noise, lever_acceleration
from tools.lab.scenarios.recordings import attitude

STEP_S, N = 1 / 1000, 20000
STILL, ALWAYS = np.zeros(N), np.ones(N)
OMEGA = np.tile([0.0, 0.0, 2.0], (N, 1))


def acceleration(hand, omega=OMEGA, moving=ALWAYS, holding=STILL, seed=0):
    return body.acceleration(hand, omega, moving, holding, STEP_S, np.random.default_rng(seed))


def test_band_noise_has_unit_rms_and_nothing_outside_its_band():
    noise = band_noise(N, STEP_S, (2.0, 10.0), np.random.default_rng(0))
    np.testing.assert_allclose((noise**2).mean(0), 1.0, rtol=1e-9)
    frequency = np.fft.rfftfreq(N, STEP_S)
    spectrum = np.abs(np.fft.rfft(noise, axis=0))
    assert spectrum[(frequency < 1.99) | (frequency > 10.01)].max() < 1e-9 * spectrum.max()


def test_a_lever_at_constant_rate_is_centripetal():
    a = acceleration(HandDisturbance(lever_m=(0.2, 0.2), sway_mps2=0.0, jerks_per_s=0.0))
    assert np.ptp(a, axis=0).max() < 1e-12
    assert a[0, 2] == 0
    assert 0 < np.linalg.norm(a[0]) <= 4 * 0.2


def test_a_levers_acceleration_is_the_second_derivative_of_its_path():
    t = STEP_S * np.arange(N)[:, None]
    omega = np.concatenate([1.2 * np.sin(1.7 * t), 0.8 * np.cos(0.9 * t), 1.5 * np.sin(0.4 * t + 1)], axis=1)
    r = np.array([0.1, -0.2, 0.15]) + 0.05 * np.concatenate([np.sin(2 * t), np.cos(t), np.sin(3 * t)], axis=1)
    between = 0.5 * (omega[1:] + omega[:-1])
    R = attitude(between, STEP_S)
    path = (np.swapaxes(R, -1, -2) @ r[..., None])[..., 0]
    from_path = (path[2:] - 2 * path[1:-1] + path[:-2]) / STEP_S**2
    in_body = (R[1:-1] @ from_path[..., None])[..., 0]
    np.testing.assert_allclose(lever_acceleration(omega, r, STEP_S)[2:-2], in_body[1:-1], atol=1e-5)


def test_a_pivot_that_wobbles_shakes_a_board_that_does_not_turn():
    rigid, wobbling = (
        HandDisturbance(lever_m=(0.2, 0.2), wobble=w, sway_mps2=0.0, jerks_per_s=0.0) for w in (0.0, 1.0)
    )
    assert (acceleration(rigid, 0 * OMEGA) == 0).all()
    # 0.2 m rms at 0.05 to 0.4 Hz: between 0.2 (2 pi 0.05)^2 and 0.2 (2 pi 0.4)^2
    rms = np.sqrt((acceleration(wobbling, 0 * OMEGA) ** 2).sum(1).mean())
    assert 0.02 < rms < 1.27


def test_jerks_come_while_the_hand_moves_and_are_as_large_as_said():
    moving = np.where(np.arange(N) < N // 2, 1.0, 0.0)
    a = acceleration(HandDisturbance(lever_m=(0, 0), sway_mps2=0.0, jerks_per_s=1.0), 0 * OMEGA, moving)
    size = np.linalg.norm(a, axis=1)
    assert (size[N // 2 + 120 :] == 0).all()
    assert 2 < size.max() < 12
    assert 0.1 < (size > 0).mean() / (0.5 * 0.09) < 3


@pytest.mark.parametrize(
    ("moving", "holding", "rms"), [(1, 0, 0.3), (0, 1, 0.1), (0, 0, 0.0)], ids=["sway", "tremor", "flat"]
)
def test_sway_while_moving_tremor_while_holding(moving, holding, rms):
    hand = HandDisturbance(lever_m=(0, 0), jerks_per_s=0.0, tremor_mps2=0.1, tremor_rad_s=0.02)
    a = acceleration(hand, 0 * OMEGA, moving * ALWAYS, holding * ALWAYS)
    np.testing.assert_allclose(np.sqrt((a**2).mean(0)), rms, rtol=1e-9)
    tremor = body.tremor(hand, holding * ALWAYS, STEP_S, np.random.default_rng(0))
    np.testing.assert_allclose(np.sqrt((tremor**2).mean(0)), 0.02 * holding, rtol=1e-9)
