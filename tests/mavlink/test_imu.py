"""IMU messages in SI units."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpucal.mavlink.imu import ACC_LSB_MPS2, GYRO_LSB_RAD_S, Stream, decode_reading


@given(mg=st.floats(-16000, 16000), mrad_s=st.floats(-32000, 32000))
def test_a_truncated_value_is_centred(station, decoded, mg, mrad_s):
    content = decode_reading(decoded(station().raw(1, (int(mg), 0, -1000), (0, int(mrad_s), 0))))
    assert content.acc[0] == pytest.approx(mg * ACC_LSB_MPS2, abs=(0.5 if int(mg) else 1.0) * ACC_LSB_MPS2 + 1e-9)
    assert content.gyr[1] == pytest.approx(
        mrad_s * GYRO_LSB_RAD_S, abs=(0.5 if int(mrad_s) else 1.0) * GYRO_LSB_RAD_S + 1e-9
    )
    assert content.acc[2] == pytest.approx(-9.80665 - 0.5 * ACC_LSB_MPS2)


@pytest.mark.parametrize(("name", "imu"), [("scaled_imu", 1), ("scaled_imu2", 2), ("scaled_imu3", 3)])
def test_scaled_messages_tell_their_imu(station, decoded, name, imu):
    content = decode_reading(decoded(station().message(name, 1234, 0, 0, -1000, 0, 0, 0, 0, 0, 0)))
    assert (content.stream, content.time) == (Stream(name.upper(), imu), 1234)
    assert content.stream.unit_us == 1000
    assert math.isnan(content.temperature_c)


def highres(station, decoded, acc=(0.1, 0.2, -9.8), updated=0xFFFF, id_=1):
    fields = (77, *acc, 0.01, 0.02, 0.03, 0, 0, 0, 0, 0, 0, 25.5, updated, id_)
    return decode_reading(decoded(station().message("highres_imu", *fields)))


def test_highres_is_taken_as_it_is(station, decoded):
    content = highres(station, decoded)
    assert content.stream == Stream("HIGHRES_IMU", 2)
    assert not content.stream.is_truncated
    assert content.acc == pytest.approx((0.1, 0.2, -9.8), rel=1e-6)


def test_a_message_without_new_values_is_none(station, decoded):
    for how in ({"updated": 0x38}, {"updated": 0x07}, {"acc": (math.nan, 0, 0)}):
        assert highres(station, decoded, **how) is None
    assert decode_reading(decoded(station().heartbeat())) is None
