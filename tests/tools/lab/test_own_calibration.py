"""ArduPilot's own calibration, with a made-up vehicle that asks for one side after another."""

from types import SimpleNamespace

import numpy as np
import pytest

from mpucal.mavlink.dialect import dialect
from mpucal.session.boards import VEHICLE, describe
from tools.lab import own_calibration
from tools.lab.own_calibration import ORDER


class Body:
    """A body that is at once where a prompt wants it, tilted a little."""

    def __init__(self):
        self.t_s, self.still_s, self.prompts = 0.0, 2.0, []
        self.hear("lay_flat", None)

    def hear(self, kind, down):
        self.prompts.append((kind, down))
        self.up = -np.array(down or ORDER[0]) + [0.0, 0.02, 0.0]


class Vehicle:
    """The vehicle's end of the link: it asks for a side until that is confirmed, and reports `end` after the last."""

    def __init__(self, body, end):
        self.body, self.end, self.side, self.confirmed = body, end, 1, []

    def now_ns(self):
        return round(self.body.t_s * 1e9)

    def messages(self, until_ns):
        self.body.t_s = until_ns / 1e9
        asked = self.side if self.side <= 6 else self.end
        yield SimpleNamespace(
            get_type=lambda: "COMMAND_LONG", command=dialect().MAV_CMD_ACCELCAL_VEHICLE_POS, param1=asked
        )

    def command(self, _link, number, *params):
        if number == dialect().MAV_CMD_ACCELCAL_VEHICLE_POS:
            self.confirmed.append((params[0], tuple(np.rint(-self.body.up))))
            self.side += 1


def test_the_sides_are_in_the_order_in_which_the_vehicle_asks_for_them():
    assert [describe(tuple(side), VEHICLE).split(" (")[0] for side in ORDER[1:].tolist()] == [
        "on its left side",
        "on its right side",
        "nose down",
        "nose up",
        "on its back",
    ]


@pytest.mark.parametrize(("end", "succeeds"), [(own_calibration.SUCCESS, True), (own_calibration.FAILED, False)])
def test_each_side_is_confirmed_where_it_was_asked_for(monkeypatch, end, succeeds):
    body = Body()
    vehicle = Vehicle(body, end)
    monkeypatch.setattr(own_calibration, "send_command", vehicle.command)
    done, took_s, level = own_calibration.calibrate(vehicle, body)
    assert done is succeeds
    assert vehicle.confirmed == [(k + 1, tuple(side)) for k, side in enumerate(ORDER)]
    assert took_s == pytest.approx(7 * 0.2)
    np.testing.assert_allclose(level, [-np.degrees(0.02), 0.0], atol=0.01)
