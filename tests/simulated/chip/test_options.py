"""Options of the simulated chip, and the truth that they give."""

import numpy as np
import pytest

from mpucal.errors import UsageError
from mpucal.simulated.chip import open_simulated


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("sim:colour=red", "does not know 'colour=red'"),
        ("sim:chip=mpu9999", "one of mpu6050, mpu6050c, mpu6500, "),
        ("sim:seed=-1", "a whole number from 0 on"),
        ("sim:seed=1,seed=2", "seed is given twice"),
        ("sim:b_a=1/2", "three numbers"),
        ("sim:D=1/0/0/0/1/0/0/0/0", "that can be inverted"),
        ("sim:who_am_i=0x168", "a byte"),
        ("sim:noise=-1", "from 0 on"),
    ],
)
def test_invalid_options_are_refused(text, says):
    with pytest.raises(UsageError, match=r"^sim: ") as caught:
        open_simulated(text)
    assert str(caught.value).count(says) == 1


def test_options_become_the_truth():
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
