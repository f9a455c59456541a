"""The .mcap that `apply` writes, read by rosbags."""

import numpy as np
import pytest

from mpucal.data import Recording
from mpucal.files import open_writer
from mpucal.files.rows import Rows


@pytest.mark.parametrize(
    "noise",
    [
        pytest.param([[0.02, 0.03, 0.04], [4.1e-5, 5e-7, 1e-3]], id="known"),
        pytest.param([[0.02, 0.03, 0.04], [np.nan] * 3], id="of the accelerometer alone"),
    ],
)
def test_covariances_are_those_of_the_noise(tmp_path, noise):
    from rosbags.highlevel import AnyReader

    noise = np.array(noise)
    rows = Rows.of(Recording.from_arrays([0.0, 0.5], np.ones((2, 3)), np.ones((2, 3))))
    with open_writer(tmp_path / "out.mcap", Rows(iter(()), noise=noise), "done") as write:
        for samples in rows.runs:
            write(samples)
    with AnyReader([tmp_path / "out.mcap"]) as bag:
        found = [bag.deserialize(data, of.msgtype) for of, _, data in bag.messages()]
    # zeros say that it is not known
    wanted = [np.diag(np.nan_to_num(std**2)).ravel() for std in noise]
    for message in found:
        np.testing.assert_array_equal(message.linear_acceleration_covariance, wanted[0])
        np.testing.assert_array_equal(message.angular_velocity_covariance, wanted[1])
    assert len(found) == 2
