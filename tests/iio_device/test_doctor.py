"""Examination of a simulated device of the kernel."""

import json

import pytest

from mpucal.__main__ import run


@pytest.mark.parametrize("trigger", [(), ("--trigger", "none")], ids=["buffered", "polled"])
def test_the_doctor_examines_a_device_of_the_kernel(capsys, trigger):
    assert run(["doctor", "--iio", "sim:hand=still", "--seconds", "4", "--json", *trigger]) == 0
    by_topic = {finding["topic"]: finding for finding in json.loads(capsys.readouterr().out)["findings"]}
    assert {"iio:device0", "ranges", "sample rate", "losses", "at rest"} <= set(by_topic)
    assert ("buffer" in by_topic) is (not trigger)
    assert by_topic["sample rate"]["mark"] == "ok"
    assert by_topic["iio:device0"]["data"]["in_accel_scale"]
    assert not [topic for topic, finding in by_topic.items() if finding["mark"] == "bad"]
