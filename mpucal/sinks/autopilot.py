"""An autopilot's accelerometer parameters as a place for a calibration. Knows no person and no fit."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from ..data import STANDARD_GRAVITY_MPS2
from ..errors import LinkError, WriteBackError
from ..files import write_atomically
from ..mavlink.dialect import dialect
from ..mavlink.link import Link, command
from ..mavlink.parameters.client import Parameters
from ..mavlink.parameters.plan import NOTHING, Change, changes, left_out
from ..mavlink.parameters.text import PARAM, PARAMS, param_text, params_text
from ..mavlink.parameters.write import Writer
from ..mavlink.prearm import Prearm, Watch, prearm
from ..mavlink.shaping import read_parameters, shaping_names
from ..mavlink.still import Rest, Stillness
from ..mavlink.truth import ARDUPILOT, PX4
from ..result import Calibration
from .sink import Applied

OLD_PARAMETERS = "autopilot_old"
CORRECTION = re.compile(r"(OFFS|SCAL)_[XYZ]$|[XYZ](OFF|SCALE)$")
SAVE_IDS = 76

# a step of the stream, and what an attitude by the gyroscope is worse than one that did not change
AGREE_MPS2, SIGMAS, PER_TURN = 0.03, 3.0, 0.05


class AutopilotSink:
    """The vehicle at the end of a locked link.

    Parameters
    ----------
    link : locked to the vehicle; the sink leaves it open.
    """

    name = "autopilot"

    def __init__(self, link: Link) -> None:
        self._link = link
        self._firmware = PX4 if link.vehicle.is_px4 else ARDUPILOT
        self._watch = Watch(link)

    @property
    def where(self) -> str:
        """The vehicle, in words."""
        return str(self._link.vehicle)

    def keep(self, folder: Path) -> tuple[Path, ...]:
        """Save all accelerometer parameters of the vehicle to a file that its ground stations load.

        Raises
        ------
        LinkError : they cannot be read. OutputError : they cannot be saved.
        """
        held = read_parameters(self._link, shaping_names(self._firmware), self._firmware)
        values = {name: value for name, value in held.items() if CORRECTION.search(name)}
        remarks = [f"Accelerometer parameters of {self.where} before mpucal wrote new ones"]
        if self._firmware == PX4:
            path, text = folder / (OLD_PARAMETERS + PARAMS), params_text(values, remarks, self._link.vehicle.system)
        else:
            path, text = folder / (OLD_PARAMETERS + PARAM), param_text(values, remarks)
        write_atomically(path, text.encode())
        return (path,)

    def write(self, calibration: Calibration) -> Applied:
        """Set each parameter, read all back, and see their effect in the streams; or put the old ones back.

        Raises
        ------
        WriteBackError : refused (nothing was written), or failed (the old parameters are back).
        """
        planned = changes(calibration, self._firmware)
        writer = Writer(self._link, self._watch, [change.place for change in planned])
        stillness = Stillness(self._link, [change.stream for change in planned])
        try:
            self._check(planned)
            before = prearm(self._link)
            old = writer.held()
            rest = stillness.rest()
        except LinkError as error:
            raise WriteBackError(f"{NOTHING}: {error.what}", error.remedy) from error
        if rest is None:
            raise WriteBackError(f"{NOTHING}: the vehicle did not lie still", "set it down, then write again")
        new = {name: value for change in planned for name, value in change.place.values(change.new).items()}
        writer.write(old, new, lambda: verify(planned, old, rest, stillness))
        after = self._settled(planned)
        return Applied(written(calibration, old, new), self._said(planned, left_out(calibration), before, after))

    def _check(self, planned: Sequence[Change]) -> None:
        """Disarmed, and with the sensors that were calibrated."""
        if self._watch.armed:
            raise WriteBackError(f"{NOTHING}: {self.where} is armed", "disarm it, then write again")
        known = {c.place.sensor_id: c.sensor_id for c in planned if c.sensor_id}
        for name, held in Parameters(self._link).read(tuple(known)).items():
            # 0: the vehicle's parameters were wiped since
            if held not in (0, known[name]):
                raise WriteBackError(
                    f"{NOTHING}: {name} is {held:.0f}, and the calibration is of sensor {known[name]:.0f}",
                    "connect the vehicle that was calibrated, or calibrate this one",
                )

    def _settled(self, planned: Sequence[Change]) -> Prearm:
        """How it would arm now; sensors that have no ids after a wipe are given theirs."""
        now = prearm(self._link)
        if self._firmware != ARDUPILOT or now.ready:
            return now
        ids = Parameters(self._link).read([change.place.sensor_id for change in planned])
        if all(ids.values()):
            return now
        command(self._link, dialect().MAV_CMD_PREFLIGHT_CALIBRATION, 0, 0, 0, 0, SAVE_IDS)
        return prearm(self._link)

    def _said(self, planned: Sequence[Change], out: Sequence[int], before: Prearm, after: Prearm) -> str:
        imus = " and ".join(str(change.imu) for change in planned)
        residuals = ", ".join(f"{change.residual_mps2:.3f}" for change in planned)
        sentences = [
            f"The parameters of IMU {imus} are written to {self.where}, read back, and their effect is seen in the"
            f" streams. Parameters hold no cross-axis terms: |a| stays wrong by up to {residuals} m/s^2.",
            f"Before, it {before}; now it {after}.",
        ]
        if out:
            sentences.append(f"IMU {', '.join(map(str, out))} keeps its old ones: its calibration was refused.")
        if self._firmware == PX4:
            sentences.append("Leave it powered for three seconds more: PX4 saves late.")
        return " ".join(sentences)


def verify(planned: Sequence[Change], old: Mapping[str, float], before: Rest, stillness: Stillness) -> None:
    """See in each stream what its new parameters must make of it.

    Raises
    ------
    WriteBackError : a stream shows something else.
    """
    after = stillness.rest()
    if after is None:
        raise WriteBackError("the vehicle did not lie still while the new parameters were verified", "set it down")
    turned = before.attitude.T @ after.attitude
    angle = float(np.linalg.norm(turned - np.eye(3)) / np.sqrt(2))
    for change in planned:
        held = change.place.correction(old)
        if held is None or not held.scale.all():
            continue
        expected = change.place.used(held).seen_through(change.new, change.mounting, before.mean[change.stream])
        apart = np.abs(after.mean[change.stream] - turned.T @ expected)
        noise = np.hypot(before.error[change.stream], after.error[change.stream])
        if (apart > AGREE_MPS2 + SIGMAS * noise + PER_TURN * angle * STANDARD_GRAVITY_MPS2).any():
            raise WriteBackError(
                f"IMU {change.imu}'s stream does not show its new parameters: it is off by {apart.max():.3f} m/s^2",
                "check that nobody else writes parameters, then calibrate again",
            )


def written(calibration: Calibration, old: Mapping[str, float], new: Mapping[str, float]) -> Calibration:
    """The calibration, which now says what the vehicle held and holds."""
    autopilot = {**calibration.extra["autopilot"], "written": {"before": dict(old), "after": dict(new)}}
    return replace(calibration, extra=MappingProxyType({**calibration.extra, "autopilot": autopilot}))
