"""A vehicle as a session's source: it locks a link to one, reads its parameters, and has it stream its IMUs."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ..clocks import S
from ..clocks.device_clocks import Jump
from ..data import Recording, Samples, Sensor
from ..errors import LinkError, UsageError, WriteBackError
from .dialect import Message
from .firmwares import PX4, Vehicle
from .imu import Stream
from .link import Link
from .log import Log
from .parameters.client import read_stream_parameters
from .parameters.slots import find_slot
from .px4_preparation import AUTOCAL, Preparation
from .stream import Streams
from .stream_buffers import Row, samples_of, sensor_of
from .transports import PAUSE_NS

POLL_NS = S // 20
SILENT_NS = 4 * S
# The vehicle must be back within this time; a reboot takes less, and so do most interruptions of a link.
BACK_NS = 30 * S
LOOK_NS = S
# A loss of this share is reported to the operator, once this many packets were sent.
LOSS_SHARE, LOSS_AFTER = 0.05, 2000


class VehicleSource:
    """Source of the first IMU's samples as they come, and of all IMUs' recordings at the end.

    Its behaviour depends on the packets and their times alone, so that a replay repeats it.

    Parameters
    ----------
    link : not locked yet. rate_hz : to request. system : id of the vehicle to lock to, if there are several.
    say : shows the operator a sentence. name : of the recording.
    writes : the result will be written to the vehicle: then its parameters must name its sensors.
    prepare : prepare a PX4; see Preparation. begun : called as the recorded messages begin, after the preparation.
    paused : called after a pause of the program or its computer, with the vehicle's time [ns] when it began.
    replayed : see lock_to_vehicle.
    """

    def __init__(
        self,
        link: Link,
        rate_hz: float,
        system: int | None,
        say: Callable[[str], None],
        name: str,
        writes: bool = False,
        prepare: bool = False,
        begun: Callable[[], None] = lambda: None,
        paused: Callable[[int], None] = lambda _t_ns: None,
        replayed: bool = False,
    ) -> None:
        self._link = link
        self._rate_hz = rate_hz
        self._system = system
        self._say = say
        self._name = name
        self._writes, self._replayed = writes, replayed
        self._preparation = Preparation(link, say) if prepare else None
        self._begun, self._paused = begun, paused
        self._log = Log("")
        self._streams: Streams | None = None
        self._stream: Stream | None = None
        self._rows: list[Row] = []
        self._last_us: float | None = None
        self._sampled_ns = 0
        self._pause_ns = 0
        self._interrupted_ns: list[int] = []
        self._rebooted = False
        self._changes_reported = 0
        self._loss_reported = self._was_armed = False

    def start(self) -> Sensor:
        """Listen, lock to one vehicle and say so, read its parameters, and request its streams.

        If it is called again for the next part of a resumed session, the samples are added to those so far.

        Raises
        ------
        NoAnswer : no vehicle. UsageError : several. LinkError : it sends no accelerations, or the link broke.
        """
        vehicle = lock_to_vehicle(self._link, self._system, self._say, replayed=self._replayed)
        self._system, firmware = vehicle.system, vehicle.family
        if first := not self._log.firmware:
            self._log = Log(firmware, over_reboots=True)
        elif firmware != self._log.firmware:
            raise UsageError(f"{vehicle} is another one: the session began with {self._log.firmware}", "start again")
        if self._preparation is not None:
            if firmware == PX4:
                self._preparation.prepare()
            else:
                self._say("--prepare is for a PX4 only: nothing was prepared.")
        self._begun()
        self._link.subscribe(self._on_message)
        parameters = read_stream_parameters(self._link)
        self._check_ids(parameters)
        self._streams = Streams(self._link, firmware, parameters, self._rate_hz, self._say)
        self._stream = self._streams.start()
        self._rows = []
        # A reboot between two parts needs no wait: the vehicle is back.
        self._rebooted &= first
        self._sampled_ns = self._link.now_ns()
        return sensor_of(self._stream, firmware, parameters, self._rate_hz)

    def poll(self) -> Samples:
        """Wait for a twentieth of a second, and return the first IMU's samples that came meanwhile.

        Raises
        ------
        EndOfCapture : a replay holds no more. LinkError : the vehicle stays silent, or the link broke.
        """
        if self._pause_ns:
            self._say(f"Reading paused for {self._pause_ns / S:.0f} s (process or computer suspended).")
            self._pause_ns = 0
            self._wait_for_return()
        begun_ns, sampled_ns = self._link.now_ns(), self.now_ns()
        list(self._link.messages(begun_ns + POLL_NS))
        pause_ns = self._link.now_ns() - begun_ns
        if pause_ns > PAUSE_NS:
            # The next poll waits for the vehicle. This one returns the samples of before the pause.
            self._pause_ns = pause_ns
            self._interrupted_ns.append(sampled_ns)
            self._paused(sampled_ns)
            self._sampled_ns = self._link.now_ns()
            return self._take_samples()
        if self._streams is not None:
            self._streams.watch()
        if self._rebooted or self._link.now_ns() - self._sampled_ns >= SILENT_NS:
            self._say(f"{self._link.vehicle} {self._fault()}: wait until it is back, and hold it still meanwhile.")
            self._wait_for_return()
        self._report_armed()
        self._report_changes()
        self._report_loss()
        return self._take_samples()

    def recording(self) -> Recording:
        """Return all samples so far, late ones in their places; the other IMUs' are in its `others`."""
        interrupted = (t_ns * 1e-9 for t_ns in self._interrupted_ns)
        return self._log.recording(self._name).interrupted_at(*interrupted)

    def forget(self) -> None:
        """Drop all samples so far: `recording` holds those that come from now on."""
        self._log.forget()

    def now_ns(self) -> int:
        """Return the vehicle's time: the last sample's, counted on by the link's clock."""
        last_us = self._rows[-1].t_us if self._rows else self._last_us
        # Before the first poll there are only the samples in the log, which came during the start.
        last_us, since_ns = self._log.latest if last_us is None else (last_us, self._sampled_ns)
        return round(last_us * 1e3) + self._link.now_ns() - since_ns

    def stop(self) -> None:
        """Undo the preparation; the streams stay on for other ground stations and for the write-back."""
        if self._preparation is not None:
            self._preparation.release()

    def _on_message(self, message: Message) -> None:
        """Add a message to the log; keep the first IMU's sample for `poll`, and note a reboot."""
        row, jump = self._log.add(message, self._link.now_ns())
        self._rebooted |= jump is Jump.REBOOT
        if row is not None and row.reading.stream == self._stream:
            self._rows.append(row)
            self._sampled_ns = self._link.now_ns()

    def _take_samples(self) -> Samples:
        rows, self._rows = self._rows, []
        samples = samples_of(rows, self._last_us)
        if rows:
            self._last_us = float(rows[-1].t_us)
        return samples

    def _report_armed(self) -> None:
        """Say each time that the vehicle is armed: the operator who turns it is near its propellers."""
        armed = bool(self._link.armed)
        if armed and not self._was_armed:
            self._say(
                f"{self._link.vehicle} was armed: keep clear of its propellers and disarm it;"
                " nothing is written to an armed vehicle."
            )
        self._was_armed = armed

    def _report_loss(self) -> None:
        """Say once that the link loses packets."""
        share = self._link.loss_share
        if self._loss_reported or self._link.received + self._link.lost < LOSS_AFTER or share < LOSS_SHARE:
            return
        self._loss_reported = True
        self._say(f"The link loses {100 * share:.0f} % of the packets: a nearer or faster one is better.")

    def _report_changes(self) -> None:
        """Say that parameters were changed while the vehicle streamed: one sentence for all since the last poll."""
        names = self._log.changed[self._changes_reported :]
        if not names:
            return
        self._changes_reported = len(self._log.changed)
        by = (
            f" (PX4 does that itself while {AUTOCAL} is 1; --prepare sets it to 0)" if self._log.firmware == PX4 else ""
        )
        self._say(f"{names[0]} was changed while it was measured{by}: earlier samples are corrected where possible.")

    def _check_ids(self, parameters: Mapping[str, float]) -> None:
        """Check, before the vehicle is turned, that a PX4 has the id of a sensor: else no slot can hold the result."""
        if self._log.firmware != PX4 or not parameters or find_slot(PX4, 1, parameters) is not None:
            return
        what = f"{self._link.vehicle} names none of its accelerometers (all CAL_ACCn_ID are 0)"
        if self._writes:
            raise WriteBackError(
                f"{what}, so nothing can be written to it, and nothing was measured",
                "lay it level and give --prepare, which has PX4 assign their ids and take their offsets as it lies; or"
                " give --no-write",
            )
        self._say(f"{what}: the result is for files only.")

    def _wait_for_return(self) -> None:
        """Have the vehicle stream again after a reboot, a silence or a pause, and read its parameters again."""
        if not self._rebooted:
            self._link.seek()
        if not self._link.succeeds(self._request_samples, BACK_NS):
            raise LinkError(
                f"{self._link.vehicle} {self._fault()}",
                "check its power and the link, and that no other ground station stops its IMU messages",
            )
        read_stream_parameters(self._link)
        self._rebooted = False
        self._say(f"{self._link.vehicle} is back, its parameters are read again: go on.")

    def _request_samples(self) -> bool:
        """Request the streams, and listen for a second; return True if samples came."""
        if self._streams is not None:
            self._streams.request_again()
        begun_ns = self._link.now_ns()
        list(self._link.messages(begun_ns + LOOK_NS))
        return self._sampled_ns > begun_ns

    def _fault(self) -> str:
        """Return what is wrong with the vehicle or its link, as the end of a sentence on the vehicle."""
        if self._rebooted:
            return "rebooted (its clock started again)"
        now_ns = self._link.now_ns()
        what, since_ns = "no IMU messages", self._sampled_ns
        if now_ns - self._link.heard_ns >= SILENT_NS:
            # `_sampled_ns` is later than `heard_ns` after a pause: what came during the pause is not known.
            what, since_ns = "nothing", max(self._link.heard_ns, self._sampled_ns)
        return f"has sent {what} for {(now_ns - since_ns) // S} s"


def lock_to_vehicle(link: Link, system: int | None, say: Callable[[str], None], *, replayed: bool = False) -> Vehicle:
    """Listen, say which vehicle it is, and lock the link to it; only then is anything sent to it.

    Parameters
    ----------
    replayed : the packets are those of a capture, and nothing is sent.

    Raises
    ------
    NoAnswer, LinkError : see Link.listen. UsageError : see choose_vehicle.
    """
    vehicle = choose_vehicle(link.listen(), system)
    say(f"This is {vehicle}{'' if replayed else '; nothing is sent to any other'}.")
    link.lock(vehicle)
    return vehicle


def choose_vehicle(vehicles: tuple[Vehicle, ...], system: int | None) -> Vehicle:
    """Return the only vehicle, or the only one of that system.

    Raises
    ------
    UsageError : several, with their list, or none of that system.
    """
    asked = [vehicle for vehicle in vehicles if system in (None, vehicle.system)]
    listed = ", ".join(map(str, sorted(vehicles, key=lambda v: (v.system, v.address))))
    if len(asked) == 1:
        return asked[0]
    if not asked:
        raise UsageError(f"no vehicle is system {system}: there is {listed}", "give one of these to --system")
    remedy = "choose one with --system N" if system is None else "stop the other, or listen on another port"
    raise UsageError(f"there are several vehicles: {listed}", remedy)
