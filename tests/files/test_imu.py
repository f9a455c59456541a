"""The .mcap that `apply` writes, read by rosbags."""

import numpy as np
import pytest

from mpucal.data import Recording
from mpucal.files import open_writer
from mpucal.files.rows import Rows

T_S = np.array([0.25, 1.5])
ACC, GYR = np.random.default_rng(1).normal(size=(2, 2, 3))


@pytest.mark.parametrize(
    "noise",
    [
        pytest.param([[0.02, 0.03, 0.04], [4.1e-5, 5e-7, 1e-3]], id="known"),
        pytest.param([[0.02, 0.03, 0.04], [np.nan] * 3], id="of the accelerometer alone"),
    ],
)
def test_ros_reads_the_samples_and_the_covariances_of_their_noise(tmp_path, noise):
    from rosbags.highlevel import AnyReader

    noise = np.array(noise)
    rows = Rows.of(Recording.from_arrays(T_S, ACC, GYR))
    with open_writer(tmp_path / "out.mcap", Rows(iter(()), noise=noise), "done") as write:
        for samples in rows.runs:
            write(samples)
    with AnyReader([tmp_path / "out.mcap"]) as bag:
        found = [(of.topic, t_ns, bag.deserialize(data, of.msgtype)) for of, t_ns, data in bag.messages()]
    # zeros say that it is not known
    wanted = [np.diag(np.nan_to_num(std**2)).ravel() for std in noise]
    for (topic, t_ns, message), t_s, acc, gyr in zip(found, T_S, ACC, GYR, strict=True):
        stamp, a, w = message.header.stamp, message.linear_acceleration, message.angular_velocity
        assert (topic, message.header.frame_id) == ("/imu/data", "imu")
        assert stamp.sec * 1_000_000_000 + stamp.nanosec == t_ns == round(t_s * 1e9)
        assert ([a.x, a.y, a.z], [w.x, w.y, w.z]) == (acc.tolist(), gyr.tolist())
        # there is no orientation
        assert message.orientation_covariance[0] == -1.0
        np.testing.assert_array_equal(message.linear_acceleration_covariance, wanted[0])
        np.testing.assert_array_equal(message.angular_velocity_covariance, wanted[1])
