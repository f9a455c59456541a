import numpy as np
from scipy.spatial.transform import Rotation

from mpucal.simulated.sensor import SensorTruth, density
from tools.lab import distorted
from tools.lab.scenarios.recordings import paper_scenario
from tools.lab.scenarios.sensors import GRAVITY_MPS2


def there_and_back(x, sign=1.0):
    return np.concatenate([x, sign * x[::-1]])


def test_a_distortion_is_found_and_its_tilt_removed(tmp_path):
    """A perfect sensor under motion capture, which loses it for a second; at rest before and after."""
    sensor = SensorTruth(
        *(np.eye(3), np.zeros(3), np.eye(3), np.zeros(3)),
        gravity=GRAVITY_MPS2,
        accel_noise_density=density(0.03, 50.0),
        gyro_noise_density=density(0.002, 50.0),
    )
    simulated = paper_scenario(0, rate_hz=50.0, sensor=sensor)
    acc, gyr = there_and_back(simulated.recording.acc), there_and_back(simulated.recording.gyr, -1.0)
    # from sensor to earth: w, x, y, z
    quat = there_and_back(np.roll(Rotation.from_matrix(np.swapaxes(simulated.attitude, 1, 2)).as_quat(), 1, axis=1))
    quat[1000:1050] = np.nan
    np.savez(tmp_path / "desk.npz", t=np.arange(len(quat)) / 50.0, acc=acc, gyr=gyr, quat=quat)
    before, after, with_gyro, exact = distorted.of_seed((tmp_path / "desk.npz", 0), gravity=GRAVITY_MPS2)
    assert "refused" not in before.told
    assert before.error > 0.5
    assert after.error == with_gyro.error < 0.1
    assert exact.error < 1e-9
    for name in ("roll_deg", "pitch_deg", "roll_turned_deg", "pitch_turned_deg"):
        assert getattr(before, name) > 1.0
        assert getattr(after, name) < 0.3
        assert getattr(exact, name) < 0.1
