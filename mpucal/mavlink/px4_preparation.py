"""A PX4 made ready to be calibrated: its accelerometers named by their ids, its own learning of offsets held.

What was asked for by --prepare; the parameters are those of PX4's `sensors` and `commander` modules.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from ..errors import LinkError
from .dialect import dialect
from .firmwares import PX4
from .imu import HIGHRES, MESSAGE_ID, decode_reading
from .link import Link, S
from .parameters.client import ParameterClient
from .parameters.encoding import INT32
from .parameters.names import all_slots
from .prompts import ReceivedPrompt, encode_prompt
from .request import send_command
from .stream_parameters import read_parameters

AUTOCAL = "SENS_IMU_AUTOCAL"
# MAV_CMD_PREFLIGHT_CALIBRATION, param5: offsets from where it lies level, which also stores each sensor's id
QUICK = 4
NAMED_NS = 10 * S
# how far from level it may seem to lie: offsets of 60 mg of two axes, which are not known yet, are 5 degrees of it
LEVEL_DEG, LEVEL_NS, LOOK_US = 8, 20 * S, 20_000


class Preparation:
    """What is changed on the PX4 that `link` is locked to, for a session; `say` tells the person."""

    def __init__(self, link: Link, say: Callable[[str], None]) -> None:
        self._link, self._say = link, say
        self._held = False

    def prepare(self) -> None:
        """Have it name its accelerometers where it names none, and switch SENS_IMU_AUTOCAL off until `release`.

        Raises
        ------
        EndOfCapture, LinkError : see ParameterClient.set.
        """
        if not self._named():
            self._name()
        if read_parameters(self._link, (AUTOCAL,), PX4).get(AUTOCAL):
            # before it is set: where the answer is lost, it may be 0 all the same
            self._held = True
            ParameterClient(self._link).set(AUTOCAL, 0, INT32)
            self._say(f"{AUTOCAL} is 0 for the session, and then 1 again: PX4 learns no offsets of its own meanwhile.")

    def _name(self) -> None:
        """Its quick calibration, once it lies level; no sensor used the offsets that this replaces."""
        vehicle = self._link.vehicle
        self._say(f"Lay {vehicle} level, top up: it names its accelerometers then, with offsets as it lies.")
        self._link.send(encode_prompt(ReceivedPrompt("lay_flat", None)))
        send_command(self._link, dialect().MAV_CMD_SET_MESSAGE_INTERVAL, MESSAGE_ID[HIGHRES], LOOK_US)
        end_ns = self._link.now_ns() + LEVEL_NS
        while not self._is_level():
            if self._link.now_ns() >= end_ns:
                self._say(
                    f"{vehicle} was not seen to lie level within {LEVEL_DEG} degrees, so it names no accelerometers:"
                    " start again with it on a level table."
                )
                return
        self._say("It names them now: do not touch it. Where this session writes nothing, it keeps these offsets.")
        send_command(self._link, dialect().MAV_CMD_PREFLIGHT_CALIBRATION, 0, 0, 0, 0, QUICK)
        end_ns = self._link.now_ns() + NAMED_NS
        while not self._named() and self._link.now_ns() < end_ns:
            list(self._link.messages(self._link.now_ns() + S))

    def _is_level(self) -> bool:
        """Whether each sample of a second has gravity along z, as where the vehicle stands on its feet."""
        heard = [decode_reading(message) for message in self._link.messages(self._link.now_ns() + S)]
        felt = [one.acc for one in heard if one is not None]
        return bool(felt) and all(math.hypot(x, y) < -z * math.tan(math.radians(LEVEL_DEG)) for x, y, z in felt)

    def _named(self) -> bool:
        ids = read_parameters(self._link, [where.sensor_id for where in all_slots(PX4)], PX4)
        # one that does not answer is asked for again, and judged, with the rest
        return not ids or any(ids.values())

    def release(self) -> None:
        """Switch it on again where `prepare` switched it off; a vehicle that is gone is left, and that is said."""
        if not self._held:
            return
        self._held = False
        try:
            ParameterClient(self._link).set(AUTOCAL, 1, INT32)
        except LinkError:
            self._say(f"{AUTOCAL} could not be set back: set it to 1 with your ground station.")
