"""An autopilot's accelerometer parameters as a sink: set, read back, and verified in its streams, or restored."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..clocks import S
from ..data import Vector
from ..disk.atomic import write_atomically
from ..errors import LinkError, RecordingError, WriteBackError
from ..mavlink.dialect import dialect
from ..mavlink.firmwares import ARDUPILOT, PX4
from ..mavlink.link import Link
from ..mavlink.parameters import document
from ..mavlink.parameters.client import read_parameters, read_stream_parameters, require_parameters
from ..mavlink.parameters.encoding import parameters_text, read_parameters_file
from ..mavlink.parameters.mounting import MOST_DEG, Level, Leveller, trim_names, trim_of
from ..mavlink.parameters.plan import (
    NOTHING,
    Change,
    adapt_to_write,
    plan_changes,
    refused_imus,
    select_improving,
    swap_slots,
)
from ..mavlink.parameters.slots import Correction, all_slots
from ..mavlink.parameters.write import NEW, OLD, SwappedSlotsError, Writer, is_partial_write, verify
from ..mavlink.requests import PrearmState, check_prearm, is_armed, send_command
from ..mavlink.rest import Attitude, Horizon, RestMeans, RestMonitor
from ..result.calibration import Calibration
from ..result.journal import AT, Journal
from ..session.lay_flat import STAND, put_down
from ..sinks.kind import Applied, Confirm, Device, Say, Sink, decline
from ..sinks.old_state import check_accepted, interrupting, nothing_written
from ..sinks.table import AUTOPILOT, OLD_PARAM, OLD_PARAMS
from .source import OpenedVehicle

SAVE_IDS = 76
# ArduPilot's complaint about sensors with other ids than their calibration's
UNCALIBRATED = re.compile(r"accel\w*.* cal", re.IGNORECASE)
INCONSISTENT = re.compile(r"accel\w* inconsistent", re.IGNORECASE)
AGREE_NS = 13 * S
# An estimator that has just started is not ready yet, and says so.
READY_NS = 40 * S
REBOOT = (
    "Reboot {} now? Its attitude estimate keeps biases that it learnt under the old parameters until it is rebooted."
)
NOT_CHECKED = "look whether its horizon is level before it flies"
NOT_REBOOTED = "reboot it before it flies: its attitude estimate keeps biases that it learnt under the old parameters"
TILTED_DEG = 0.1
KEPT_LEVEL = "what was level stays level"
CHANGED_LEVEL = (
    "somebody else changed its offsets, so of two possible levels it has the one by which it stands less tilted"
)
MEASURED_LEVEL = "it is level as it stands now"
TOO_TILTED = "it stands too tilted for a level, so what was level stays level"
# PX4 saves parameters late.
SAVED_NS = 3 * S


@contextmanager
def open_autopilot(device: Device) -> Iterator[AutopilotSink]:
    """Open the parameters of the vehicle on a link, after asking the user to put it down.

    Raises
    ------
    LinkError : the link cannot be opened, or there is no vehicle.
    """
    source: OpenedVehicle = device.open()
    with source.connected(device.say) as link:
        put_down(source.listeners, device.say, STAND)
        journal = Journal.of(AUTOPILOT, device.name)
        sink = AutopilotSink(link, journal, device.say, device.confirm)
        recovered = sink.recover()
        if recovered is not None:
            device.say(recovered)
        yield sink


class AutopilotSink(Sink):
    """Accelerometer parameters of the vehicle on a locked link.

    Parameters
    ----------
    link : locked to the vehicle; the sink leaves it open.
    journal : notes a write. say : shows the user a sentence. confirm : asks the user; see Device.
    """

    def __init__(
        self,
        link: Link,
        journal: Journal | None = None,
        say: Say = lambda _sentence: None,
        confirm: Confirm = decline,
    ) -> None:
        self._say, self._confirm = say, confirm
        self._stands_level: bool | None = None
        self._link = link
        self._journal = journal or Journal()
        self._firmware, self.where = link.vehicle.family, str(link.vehicle)

    def recover(self) -> str | None:
        """Restore the parameters of an interrupted write; return a clause for the user, or None if there was none.

        Raises
        ------
        LinkError : the parameters cannot be read. WriteBackError : see Sink.
        """
        note = self._journal.interrupted()
        if note is None:
            return None
        old, new = note[OLD], note[NEW]
        writer = Writer(self._link, old)
        held = writer.read()
        interrupted = f"a write to this vehicle was interrupted at {note[AT]}"
        if held == old:
            self._journal.end()
            return None
        if set(held) != set(old) or not is_partial_write(held, old, new):
            self._journal.end()
            return f"{interrupted}; {self.where} has neither the old nor the new parameters, and they are not changed"
        with interrupting():
            writer.write(held, old, lambda: None)
        self._journal.end()
        return f"{interrupted}; the old parameters are restored and read back"

    def keep(self, folder: Path) -> tuple[Path, ...]:
        """Save all accelerometer parameters and the level of the vehicle to a file that ground stations can load.

        Raises
        ------
        LinkError : they cannot be read. OutputError : they cannot be saved.
        """
        held = read_stream_parameters(self._link)
        values = {name: held[name] for slot in all_slots(self._firmware) for name in slot.names if name in held}
        values |= read_parameters(self._link, trim_names(self._firmware))
        remarks = [f"Accelerometer parameters and level of {self.where} before mpucal wrote new ones"]
        file = OLD_PARAMS if self._firmware == PX4 else OLD_PARAM
        text = parameters_text(self._firmware, values, remarks, self._link.vehicle.system)
        path = file.free_in(folder)
        write_atomically(path, text.encode())
        return (path,)

    def put_back(self, kept: Path) -> str:
        """Restore the parameters from the file of an earlier `keep`; see Sink."""
        wanted = read_parameters_file(kept)
        writer = Writer(self._link, wanted, self._journal)
        if not writer.slots:
            raise RecordingError(
                f"{kept} holds no accelerometer parameters of {self._firmware}", "give a file that a write saved"
            )
        with nothing_written():
            old = writer.read()
        writer.write(old, {name: wanted[name] for name in old}, lambda: None)
        return f"{self.where} has the parameters of {kept.name} again, read back; {NOT_REBOOTED}"

    def reason_to_keep(self, calibration: Calibration) -> str | None:
        """See Sink; residual cross-axis errors count, and one IMU with better parameters is enough."""
        planned = plan_changes(calibration, self._firmware)
        if any(change.improves for change in planned):
            return None
        old, new = (max(getattr(c, key) or 0.0 for c in planned) for key in ("residual_old_mps2", "residual_mps2"))
        return (
            f"the parameters of {self.where} are predicted to be as good as the new ones (error of |a| up to"
            f" {old:.3f} m/s^2 with the old ones, {new:.3f} with the new ones)"
        )

    def write(self, calibration: Calibration) -> Applied:
        """Set each parameter, read all back, and verify their effect in the streams; see Sink."""
        # One that may not be written is refused before the vehicle is asked for anything.
        check_accepted(calibration)
        plan_changes(calibration, self._firmware)
        calibration = self._turned(calibration)
        possible = plan_changes(calibration, self._firmware)
        try:
            return self._write(calibration, possible)
        except WriteBackError as error:
            other = error.__cause__
            if not isinstance(other, SwappedSlotsError) or not self._writer.restored:
                raise
        return self._write(calibration, swap_slots(possible, other.order))

    def _turned(self, calibration: Calibration) -> Calibration:
        """Return the calibration in the present axes of the streams, which a PX4 that was levelled since has turned."""
        names, then = trim_names(self._firmware), calibration.extra[document.AUTOPILOT][document.OLD]
        if self._firmware != PX4 or not then.keys() >= set(names):
            return calibration
        with nothing_written():
            held = require_parameters(self._link, names)
        level = Level(PX4, trim_of(PX4, then), trim_of(PX4, held))
        return (
            calibration if np.array_equal(level.held_deg, level.wanted_deg) else adapt_to_write(calibration, (), level)
        )

    def _write(self, calibration: Calibration, possible: Sequence[Change]) -> Applied:
        planned = select_improving(possible)
        names = [name for change in planned for name in change.slot.names]
        writer = self._writer = Writer(self._link, [*names, *trim_names(self._firmware)], self._journal)
        first = possible[0]
        monitor = RestMonitor(self._link, list(dict.fromkeys(change.stream for change in (first, *planned))))
        with nothing_written():
            self._check(planned)
            before = check_prearm(self._link)
            old = writer.read()
            rest = _at_rest(monitor)
            held = first.slot.correction(old) if first in planned else None
            leveller = Leveller(self._firmware, trim_of(self._firmware, old), held, first.new, first.mounting)
            then = first.slot.correction(_first_parameters(calibration))
            level, of_level = _keep_level(leveller, then, rest.mean[first.stream])
            if self._does_stand_level(leveller.standing_deg(level, rest.mean[first.stream])):
                rest = _at_rest(monitor)
                measured = leveller.measure(rest.mean[first.stream])
                level, of_level = (level, TOO_TILTED) if measured is None else (measured, MEASURED_LEVEL)
        new = {name: value for change in planned for name, value in change.slot.values(change.new).items()}
        new |= level.values()
        now = adapt_to_write(calibration, planned, level)
        writer.write(old, new, lambda: verify(planned, old, rest, monitor.wait(), level.turn))
        imus = " and ".join(str(change.imu) for change in planned)
        clauses = [
            f"{self.where} has the new parameters of IMU {imus}, read back and verified in its streams",
            *(f"IMU {each.imu}: without cross-axis terms, errors of up to {each.residual} remain" for each in planned),
            _level_clause(level, of_level),
            *self._finish(before, first, level),
            *_unchanged_clauses(possible, planned, refused_imus(calibration)),
        ]
        return Applied(now, tuple(clauses))

    def _does_stand_level(self, standing_deg: Vector) -> bool:
        """Return True if the user says that the vehicle stands as it should hover."""
        if self._stands_level is None:
            stands = f"{self.where} stands {_tilt_words(standing_deg)} by what it calls level."
            self._stands_level = self._confirm(f"{stands} Is this how it should hover? (No: its level stays.)", False)
        return self._stands_level

    def _finish(self, before: PrearmState, first: Change, level: Level) -> Iterator[str]:
        """Reboot the vehicle if the user agrees, and yield clauses on its horizon and on its pre-arm check."""
        left = NOT_REBOOTED
        try:
            # A reboot loses ids that were not saved; a complaint that takes time to end is waited for after it.
            now = self._check_prearm()
            if not self._confirm(REBOOT.format(self.where), True):
                yield NOT_REBOOTED
                if self._firmware == PX4:
                    yield f"leave it powered for {SAVED_NS // S} more seconds, as PX4 saves late"
                now = self._await_agreement(now)
                if now.complaints:
                    yield f"before, it {before}; now it {now}"
                return
            if self._firmware == PX4:
                list(self._link.messages(self._link.now_ns() + SAVED_NS))
            self._say(f"{self.where} reboots: leave it as it stands.")
            horizon = Horizon(self._link)
            if not horizon.reboot():
                yield f"it refused to reboot; {left}"
                return
            left = NOT_CHECKED
            yield _horizon_clause(horizon.settled(first.stream, level.wanted_deg), bool(self._stands_level))
            yield f"before, it {before}; now it {self._await_ready(before)}"
        except LinkError as error:
            yield f"but {error.what}: {error.remedy}, and {left}"
        except KeyboardInterrupt:
            yield f"you interrupted what follows the write; {left}"

    def _await_ready(self, before: PrearmState) -> PrearmState:
        """Return the pre-arm state after a reboot, once it is ready, or has no complaints other than those before.

        Accelerometers that were inconsistent before should agree now.
        """
        end_ns = self._link.now_ns() + READY_NS
        stays = {complaint for complaint in before.complaints if not INCONSISTENT.search(complaint)}
        now = self._check_prearm()
        while not now.ready and self._link.now_ns() < end_ns:
            # one that would not arm and gives no reason yet is still starting
            if set(now.complaints) <= stays and (now.complaints or now.ready is None):
                break
            now = check_prearm(self._link)
        return now

    def _check(self, planned: Sequence[Change]) -> None:
        """Check that the vehicle is disarmed and has the sensors that were calibrated."""
        if is_armed(self._link):
            raise WriteBackError(f"{NOTHING}: {self.where} is armed", "disarm it, then write again")
        known = {c.slot.sensor_id: c.sensor_id for c in planned if c.sensor_id}
        for name, held in require_parameters(self._link, tuple(known)).items():
            # 0: the vehicle's parameters were reset
            if held not in (0, known[name]):
                raise WriteBackError(
                    f"{NOTHING}: {name} is {held:.0f}, but the calibration is of sensor {known[name]:.0f}",
                    "connect the vehicle that was calibrated, or calibrate this one",
                )

    def _check_prearm(self) -> PrearmState:
        """Return the pre-arm state; an ArduPilot whose saved ids are wrong saves those of its sensors before.

        Its id parameters show the sensors' ids without being saved (AP_InertialSensor::register_accel).
        """
        now = check_prearm(self._link)
        if self._firmware == ARDUPILOT and any(map(UNCALIBRATED.search, now.complaints)):
            send_command(self._link, dialect().MAV_CMD_PREFLIGHT_CALIBRATION, 0, 0, 0, 0, SAVE_IDS)
            now = check_prearm(self._link)
        return now

    def _await_agreement(self, now: PrearmState) -> PrearmState:
        """Return the pre-arm state once it has settled.

        ArduPilot calls IMUs inconsistent until they have agreed for ten seconds (AP_Arming::ins_accels_consistent).
        """
        until_ns = self._link.now_ns() + AGREE_NS
        while any(map(INCONSISTENT.search, now.complaints)) and self._link.now_ns() < until_ns:
            now = check_prearm(self._link)
        return now


def _at_rest(monitor: RestMonitor) -> RestMeans:
    rest = monitor.wait()
    if rest is None:
        raise WriteBackError(f"{NOTHING}: the vehicle did not lie still", "set it down, then write again")
    return rest


def _tilt_words(roll_pitch_deg: Vector) -> str:
    """Return roll and pitch as a pilot says them, such as: 1.2 deg nose up and 0.3 deg right side down."""
    roll, pitch = roll_pitch_deg.tolist()
    nose, side = ("up" if pitch > 0 else "down"), ("right" if roll > 0 else "left")
    return f"{abs(pitch):.1f} deg nose {nose} and {abs(roll):.1f} deg {side} side down"


def _first_parameters(calibration: Calibration) -> dict[str, float]:
    """Return the vehicle's parameters as they were when it was first seen, by name."""
    autopilot = calibration.extra[document.AUTOPILOT]
    return {**autopilot[document.OLD], **autopilot.get(document.FIRST, {})}


def _keep_level(leveller: Leveller, then: Correction | None, mean: Vector) -> tuple[Level, str]:
    """Return the level by which what was level stays level, and words on it.

    If the offsets were changed after the vehicle was first seen, nobody knows under which of them the trim was taken:
    of the two levels it is the one by which the vehicle stands less tilted.

    Parameters
    ----------
    then : the first accelerometer's correction when the vehicle was first seen. mean : of its stream now.
    """
    level, held, new = leveller.keep(), leveller.old, leveller.new
    if held is None or then is None or new is None or held.is_close(then) or held.is_close(new):
        return level, KEPT_LEVEL
    levels = level, replace(leveller, old=then).keep()
    return min(levels, key=lambda each: float(np.abs(leveller.standing_deg(each, mean)).max())), CHANGED_LEVEL


def _level_clause(level: Level, words: str) -> str:
    """Return a clause on the new trim."""
    if not level.wanted_deg[:2].any():
        return f"its level was never set ({trim_names(level.firmware)[0]} is 0) and stays that of its autopilot's axes"
    changes = zip(trim_names(level.firmware)[:2], level.held_deg, level.wanted_deg, strict=False)
    listed = " and ".join(f"{name} from {old:.2f} to {new:.2f} deg" for name, old, new in changes)
    doubt = ""
    if np.abs(level.wanted_deg[:2]).max() > MOST_DEG:
        doubt = ", a large tilt for a board: check what it calls level, and calibrate its level before it flies"
    return f"{words} ({listed}, read back){doubt}"


def _horizon_clause(attitude: Attitude | None, measured: bool) -> str:
    """Return a clause on the attitude after a reboot; only a person knows if a vehicle stands as it should hover."""
    if attitude is None:
        return "it is rebooted, but its horizon was not checked, as it did not rest"
    apart, shown = (float(np.abs(angles).max()) for angles in (attitude.error_deg, attitude.roll_pitch_deg))
    if apart > TILTED_DEG:
        return f"it is rebooted, and its horizon is tilted by {apart:.2f} deg: calibrate its level before it flies"
    within = f"within {max(apart, 0.01):.2f} deg"
    if measured:
        return f"it is rebooted, and its horizon is level {within}"
    agrees = f"it is rebooted, its horizon agrees with gravity {within}"
    if shown <= TILTED_DEG:
        return f"{agrees}, and it shows level as it stands"
    return (
        f"{agrees}, and it shows {_tilt_words(attitude.roll_pitch_deg)} as it stands: if it stands as it should hover,"
        " run `mpucal write` with this calibration at a terminal, and say so there"
    )


def _unchanged_clauses(possible: Sequence[Change], planned: Sequence[Change], refused: Sequence[int]) -> list[str]:
    """Return clauses on the IMUs that keep their old parameters, with the reason."""
    clauses = [
        f"IMU {change.imu} keeps its old ones, which are predicted to be as good (error of |a| up to"
        f" {change.residual_old_mps2 or 0.0:.3f} m/s^2)"
        for change in possible
        if change not in planned
    ]
    if refused:
        clauses.append(f"IMU {', '.join(map(str, refused))} keeps its old ones, as its calibration was refused")
    return clauses
