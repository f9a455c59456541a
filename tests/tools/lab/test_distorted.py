import numpy as np
import pytest

from mpucal.calibration.ekf import specific_force
from mpucal.errors import RecordingError
from mpucal.simulated.sensor import SensorTruth, density
from tools.lab import distorted
from tools.lab.scenarios.recordings import GRAVITY_MPS2, paper_scenario


def quaternion(R):
    """(n, 4) w, x, y, z from sensor to earth of R (n, 3, 3), sensor from earth; by eigenvectors, which know no case."""
    R = np.swapaxes(R, 1, 2)
    N = np.zeros((len(R), 4, 4))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        N[:, 0, i + 1] = N[:, i + 1, 0] = R[:, k, j] - R[:, j, k]
        N[:, i + 1, i + 1] = R[:, i, i] - R[:, j, j] - R[:, k, k]
        N[:, i + 1, j + 1] = N[:, j + 1, i + 1] = R[:, i, j] + R[:, j, i]
    N[:, 0, 0] = np.trace(R, axis1=1, axis2=2)
    return np.linalg.eigh(N)[1][:, :, -1]


def there_and_back(x, sign=1.0):
    return np.concatenate([x, sign * x[::-1]])


@pytest.fixture(scope="module")
def captured_file(tmp_path_factory):
    """A perfect sensor under motion capture, which loses it for a second; at rest before and after."""
    sensor = SensorTruth(
        *(np.eye(3), np.zeros(3), np.eye(3), np.zeros(3)),
        gravity=GRAVITY_MPS2,
        accel_noise_density=density(0.03, 50.0),
        gyro_noise_density=density(0.002, 50.0),
    )
    simulated = paper_scenario(0, rate_hz=50.0, sensor=sensor)
    recording = simulated.recording
    # The board goes back the way that it came.
    quat = there_and_back(quaternion(simulated.attitude))
    quat[1000:1050] = np.nan
    path = tmp_path_factory.mktemp("captured") / "desk.npz"
    np.savez(
        path,
        t=np.arange(len(quat)) / 50.0,
        acc=there_and_back(recording.acc),
        gyr=there_and_back(recording.gyr, -1.0),
        quat=quat,
    )
    return path


def test_motion_capture_says_where_gravity_is(captured_file):
    captured = distorted.Captured.load(captured_file, GRAVITY_MPS2)
    seen = np.isfinite(captured.specific_force).all(1)
    assert (~seen).sum() == 50
    off = captured.recording.acc[seen] - captured.specific_force[seen]
    np.testing.assert_allclose(off.std(0), 0.03, rtol=0.2)


def test_a_distortion_is_found_and_its_tilt_removed(captured_file):
    before, after, with_gyro, exact = distorted.of_seed((captured_file, 0), gravity=GRAVITY_MPS2)
    assert "refused" not in before.told
    assert before.error > 0.5
    assert after.error == with_gyro.error < 0.1
    assert exact.error < 1e-9
    for name in ("roll_deg", "pitch_deg", "roll_turned_deg", "pitch_turned_deg"):
        assert getattr(before, name) > 1.0
        assert getattr(after, name) < 0.3
        assert getattr(exact, name) < 0.1


def test_distortions_are_drawn_within_their_limits():
    for seed in range(20):
        D, b_a = distorted.distortion(seed)
        assert np.abs(b_a).max() <= 1.0
        assert np.abs(np.linalg.norm(D, axis=1) - 1.0).max() <= 0.1 + 1e-9
        U, _, Vt = np.linalg.svd(D)
        assert np.degrees(np.arccos((np.trace(U @ Vt) - 1.0) / 2.0)) < 12.0


def test_a_recording_without_motion_capture_is_none(tmp_path):
    path = tmp_path / "plain.npz"
    np.savez(path, t=np.arange(3.0), acc=np.ones((3, 3)), gyr=np.ones((3, 3)))
    with pytest.raises(RecordingError, match="no quat"):
        distorted.Captured.load(path, 9.81)


def test_the_quaternions_of_this_test_turn_as_the_filters():
    """w, x, y, z from sensor to earth: conjugate of the filter's x, up to its sign and yaw."""
    x = np.array([[0.8, 0.6, 0.0, 0.0]])
    R = np.array([[[1.0, 0.0, 0.0], [0.0, 0.28, 0.96], [0.0, -0.96, 0.28]]])
    np.testing.assert_allclose(specific_force(x, 1.0)[0], R[0, :, 2], atol=1e-12)
    np.testing.assert_allclose(np.abs(quaternion(R)[0]), x[0], atol=1e-12)
