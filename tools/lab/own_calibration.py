"""An autopilot's own calibration of its accelerometers: six sides in a simulated hand, and the attitude afterwards."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from mpucal.clocks import S
from mpucal.data import Vector
from mpucal.errors import LinkError
from mpucal.mavlink.dialect import Message, dialect
from mpucal.mavlink.firmwares import PX4
from mpucal.mavlink.link import Link
from mpucal.mavlink.parameters.mounting import tilt_deg
from mpucal.mavlink.requests import encode_command, interval_command, send_command
from mpucal.mavlink.rest import ATTITUDE, Horizon
from mpucal.session.aims import SIDES

if TYPE_CHECKING:
    from .bodies import Body

PATIENCE_NS, LISTEN_NS = 600 * S, S // 5
# level, left, right, nose down, nose up, back
ORDER = SIDES[[0, 1, 4, 2, 5, 3]]
# A person presses the key once the vehicle rests on the requested side.
HELD_S, NEAR = 1.0, 0.97
PUT_DOWN_S = 5.0
# What ArduPilot reports in place of a side.
SUCCESS, FAILED = 16777215, 16777216
# PX4 says so in its messages, and "front side done, rotate to a different side".
PX4_SAYS, PX4_DONE, PX4_FAILED, SIDE_DONE = "[cal] ", "calibration done", "calibration failed", " side done"
# The attitude's estimator settles within this, and is then averaged.
SETTLED_S, AVERAGED = 20.0, 20


def calibrate(link: Link, body: Body) -> tuple[bool, float, Vector]:
    """Have the vehicle calibrate itself on six sides; return if it succeeded, the time [s] it took, and its level.

    The level (2,) [deg] is roll and pitch of the vehicle as it was put down for the first side.
    """
    side, confirmed, level, begun_s = 0, 0, np.zeros(2), body.t_s
    command = dialect().MAV_CMD_ACCELCAL_VEHICLE_POS

    def reported(message: Message) -> int:
        is_side = message.get_type() == "COMMAND_LONG" and message.command == command
        return round(message.param1) if is_side else 0

    body.hear("lay_flat", None)
    send_command(link, dialect().MAV_CMD_PREFLIGHT_CALIBRATION, 0, 0, 0, 0, 1)
    end_ns = link.now_ns() + PATIENCE_NS
    while link.now_ns() < end_ns:
        for message in link.messages(link.now_ns() + LISTEN_NS):
            asked = reported(message)
            if asked in (SUCCESS, FAILED):
                return asked == SUCCESS, body.t_s - begun_s, level
            if 0 < asked != side:
                side = asked
                if side > 1:
                    body.hear("rotate", tuple(ORDER[side - 1].tolist()))
        if side > confirmed and body.still_s > HELD_S and -body.up @ ORDER[side - 1] > NEAR:
            level = tilt_deg(body.up) if side == 1 else level
            confirmed = side
            send_command(link, command, side)
    return False, body.t_s - begun_s, level


def calibrate_px4(link: Link, body: Body) -> tuple[bool, float, Vector]:
    """See `calibrate`. A PX4 waits until it rests on a side that it has not measured yet; its level is taken after."""
    done: set[str] = set()
    begun_s = body.t_s
    body.hear("lay_flat", None)
    for text in _said(link, 1):
        if text.startswith((PX4_DONE, PX4_FAILED)):
            took_s = body.t_s - begun_s
            return text.startswith(PX4_DONE), took_s, set_level(link, body)
        name, end, _ = text.partition(SIDE_DONE)
        # each is said twice
        if end and name not in done:
            done.add(name)
            if len(done) < len(ORDER):
                body.hear("rotate", tuple(ORDER[len(done)].tolist()))
    return False, body.t_s - begun_s, np.zeros(2)


def _said(link: Link, kind: int) -> Iterator[str]:
    """Have a PX4 calibrate its accelerometers (`kind` 1) or its level (2); yield what it says of that."""
    command = encode_command(link, dialect().MAV_CMD_PREFLIGHT_CALIBRATION, 0, 0, 0, 0, kind)
    link.send(command)
    for message in link.messages(link.now_ns() + PATIENCE_NS):
        if message.get_type() == "STATUSTEXT" and message.text.startswith(PX4_SAYS):
            yield message.text.removeprefix(PX4_SAYS)


def set_level(link: Link, body: Body) -> Vector:
    """Have the vehicle take its level as it is put down; return roll and pitch (2,) [deg] of its body there.

    Raises
    ------
    LinkError : it refuses.
    """
    _put_down(link, body)
    if link.vehicle.family == PX4:
        # Its estimator learns biases while it is moved, and takes the level with them.
        Horizon(link).reboot()
        end = next(text for text in _said(link, 2) if text.startswith((PX4_DONE, PX4_FAILED)))
        refused = end.startswith(PX4_FAILED)
    else:
        refused = bool(send_command(link, dialect().MAV_CMD_PREFLIGHT_CALIBRATION, 0, 0, 0, 0, 2, timeout_s=30.0))
    if refused:
        raise LinkError("the vehicle does not take its level", "look what it says")
    return tilt_deg(body.up)


def attitude_error_deg(link: Link, body: Body, level_deg: Vector) -> float:
    """Reboot the vehicle; return how far roll and pitch [deg] are from the truth, less `level_deg`, at worst."""
    _put_down(link, body)
    Horizon(link).reboot()
    heard: list[tuple[float, float]] = []
    begun_s = body.t_s
    while body.t_s - begun_s < SETTLED_S or len(heard) < AVERAGED:
        if not heard:
            send_command(link, *interval_command(ATTITUDE))
        for message in link.messages(link.now_ns() + S):
            if message.get_type() == ATTITUDE:
                heard.append((message.roll, message.pitch))
    found = np.degrees(np.mean(heard[-AVERAGED:], axis=0))
    return float(np.abs(found - (tilt_deg(body.up) - level_deg)).max())


def _put_down(link: Link, body: Body) -> None:
    body.hear("lay_flat", None)
    begun_s = body.t_s
    while body.t_s - begun_s < PUT_DOWN_S or body.still_s < HELD_S:
        list(link.messages(link.now_ns() + LISTEN_NS))
