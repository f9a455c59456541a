"""Preparation of a PX4 for a session (--prepare): accelerometer ids assigned, its own learning of offsets paused.

The parameters are those of PX4's modules `sensors` and `commander`.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from ..clocks import S
from ..errors import LinkError
from .dialect import dialect
from .firmwares import PX4
from .imu import HIGHRES, decode_reading
from .link import Link
from .parameters.client import read_parameters, set_parameter
from .parameters.encoding import INT32
from .parameters.slots import all_slots
from .requests import interval_command, send_command
from .texts import ReceivedPrompt, encode_prompt

AUTOCAL = "SENS_IMU_AUTOCAL"
# MAV_CMD_PREFLIGHT_CALIBRATION, param5: estimate offsets from a level rest, which also stores each sensor's id.
QUICK = 4
ASSIGN_NS = 10 * S
# Offsets of 60 mg on two axes, which are not known yet, look like 5 degrees of tilt.
LEVEL_DEG, LEVEL_NS = 8, 20 * S


class Preparation:
    """Changes to the PX4 that `link` is locked to, for one session; `say` shows the operator a sentence."""

    def __init__(self, link: Link, say: Callable[[str], None]) -> None:
        self._link, self._say = link, say
        self._paused = False

    def prepare(self) -> None:
        """Assign accelerometer ids if there are none, and set SENS_IMU_AUTOCAL to 0 until `release`.

        Raises
        ------
        EndOfCapture, LinkError : see set_parameter.
        """
        if not self._has_ids():
            self._assign_ids()
        if read_parameters(self._link, (AUTOCAL,)).get(AUTOCAL):
            # Noted before it is set: if the answer is lost, it may be 0 nevertheless.
            self._paused = True
            set_parameter(self._link, AUTOCAL, 0, INT32)
            self._say(f"{AUTOCAL} is 0 during the session, and 1 again after it: PX4 learns no offsets meanwhile.")

    def release(self) -> None:
        """Set SENS_IMU_AUTOCAL to 1 again if `prepare` set it to 0; say so if the vehicle does not answer."""
        if not self._paused:
            return
        self._paused = False
        try:
            set_parameter(self._link, AUTOCAL, 1, INT32)
        except LinkError:
            self._say(f"{AUTOCAL} could not be set back: set it to 1 with your ground station.")

    def _has_ids(self) -> bool:
        ids = read_parameters(self._link, [slot.sensor_id for slot in all_slots(PX4)])
        # Without an answer, the reading of all parameters asks for them again and decides.
        return not ids or any(ids.values())

    def _assign_ids(self) -> None:
        """Run PX4's quick calibration once the vehicle is level; no sensor used the offsets that this replaces."""
        vehicle = self._link.vehicle
        self._say(f"Lay {vehicle} level, top up: it assigns ids to its accelerometers then, and offsets as it lies.")
        self._link.send(encode_prompt(ReceivedPrompt("lay_flat", None)))
        send_command(self._link, *interval_command(HIGHRES))
        if not self._link.succeeds(self._is_level, LEVEL_NS):
            self._say(
                f"{vehicle} did not lie level within {LEVEL_DEG} degrees, so it assigns no accelerometer ids:"
                " start again with it on a level table."
            )
            return
        self._say(
            "It assigns accelerometer ids now: do not touch it. If this session writes nothing, it keeps these offsets."
        )
        send_command(self._link, dialect().MAV_CMD_PREFLIGHT_CALIBRATION, 0, 0, 0, 0, QUICK)
        end_ns = self._link.now_ns() + ASSIGN_NS
        while not self._has_ids() and self._link.now_ns() < end_ns:
            list(self._link.messages(self._link.now_ns() + S))

    def _is_level(self) -> bool:
        """Return True if each sample of a second has gravity along z, as on a vehicle that stands on its feet."""
        readings = [decode_reading(message) for message in self._link.messages(self._link.now_ns() + S)]
        accs = [one.acc for one in readings if one is not None]
        return bool(accs) and all(math.hypot(x, y) < -z * math.tan(math.radians(LEVEL_DEG)) for x, y, z in accs)
