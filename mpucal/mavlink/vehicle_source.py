"""A vehicle as a session's source: locked to, its parameters read, its IMUs streamed."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ..data import Recording, Samples, Sensor
from ..errors import LinkError, UsageError, WriteBackError
from .clock import Jump
from .dialect import Message
from .firmwares import ARDUPILOT, PX4, accel_lag_s
from .imu import Stream, decode_reading
from .link import Link, S
from .log import Log
from .parameters.names import find_slot
from .prearm import ARMED
from .px4_preparation import Preparation
from .stream import Streams
from .stream_buffers import Row, chip, least_noise, samples_of, steps
from .stream_parameters import read_stream_parameters
from .transport import PAUSE_NS
from .vehicle import Vehicle

POLL_NS = S // 20
SILENT_NS = 4 * S
# how long a vehicle that fell silent is waited for: a reboot takes so long, and a link that was lost
BACK_NS = 30 * S
LOOK_NS = S
US_PER_S = 1e6
# packets after which their loss is weighed, and the share of it that a person should know of
WEIGHED, WORTH_SAYING = 2000, 0.05
# vehicles in one sentence
MOST_LISTED = 8


class VehicleSource:
    """The first IMU's samples as they come; all IMUs' recordings at the end.

    What it does depends on the packets and their times alone, so that a replay repeats it.

    Parameters
    ----------
    link : not locked yet. rate_hz : to ask for. system : whom to lock to, where there are several.
    say : tells the person a sentence. name : what to call the recording.
    writes : the result will be written to it: then its parameters must name its sensors.
    prepare : of a PX4, have it name its sensors, and learn no offsets meanwhile; see Preparation.
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
    ) -> None:
        self._link = link
        self._rate_hz = rate_hz
        self._system = system
        self._say = say
        self._name = name
        self._writes = writes
        self._preparation = Preparation(link, say) if prepare else None
        self._log = Log(ARDUPILOT)
        self._streams: Streams | None = None
        self._stream: Stream | None = None
        self._rows: list[Row] = []
        self._last_us: float | None = None
        self._heard_ns = self._sampled_ns = 0
        self._stood_ns = 0
        self._rebooted = False
        self._firmware = ARDUPILOT
        self._told = 0
        self._received = self._lost = 0
        self._said_lost = self._said_armed = False

    def start(self) -> Sensor:
        """Listen, lock to one vehicle and say so, read its parameters, and have it stream.

        Raises
        ------
        NoAnswer : no vehicle. UsageError : several. LinkError : it sends no accelerations, or the link broke.
        """
        vehicle = choose_vehicle(self._link.listen(), self._system)
        # nothing is sent before the person has seen to whom
        self._say(f"This is {vehicle}; what is asked and written goes there alone.")
        self._link.lock(vehicle)
        firmware = self._firmware = vehicle.family
        if self._preparation is not None:
            if firmware == PX4:
                self._preparation.prepare()
            else:
                self._say("--prepare is for a PX4 only: nothing was prepared.")
        self._log = Log(firmware, over_reboots=True)
        self._link.subscribe(self._hear)
        parameters = read_stream_parameters(self._link, firmware)
        self._check_named(parameters)
        self._streams = Streams(self._link, firmware, parameters, self._rate_hz, self._say)
        self._stream = self._streams.start()
        self._rows = []
        self._lost = self._link.lost
        self._heard_ns = self._sampled_ns = self._link.now_ns()
        return Sensor(
            chip=chip(firmware, self._stream.imu),
            rate_hz=self._rate_hz,
            message=self._stream.name,
            least_noise=least_noise(self._stream),
            steps=steps(self._stream),
            accel_lag_s=accel_lag_s(parameters),
        )

    def poll(self) -> Samples:
        """Wait for a twentieth of a second, and give the first IMU's samples that came meanwhile.

        Raises
        ------
        EndOfCapture : a replay holds no more. LinkError : the vehicle fell silent for good, or the link broke.
        """
        if self._stood_ns:
            self._say(f"This program, or its computer, stood still for {self._stood_ns / S:.0f} s, and read nothing.")
            self._stood_ns = 0
            self._wait_until_back()
        begun_ns = self._link.now_ns()
        for _ in self._link.messages(begun_ns + POLL_NS):
            self._heard_ns = self._link.now_ns()
            self._received += 1
        stood_ns = self._link.now_ns() - begun_ns
        if stood_ns > PAUSE_NS:
            # what came before is given first
            self._stood_ns = stood_ns
            self._heard_ns = self._sampled_ns = self._link.now_ns()
            return self._taken()
        if self._streams is not None:
            self._streams.watch()
        if self._rebooted or self._link.now_ns() - self._sampled_ns >= SILENT_NS:
            self._say(f"{self._link.vehicle} {self._trouble()}: wait until it is back, and hold it still meanwhile.")
            self._wait_until_back()
        self._tell_changes()
        self._weigh()
        return self._taken()

    def _taken(self) -> Samples:
        rows, self._rows = self._rows, []
        samples = samples_of(rows, self._last_us)
        if rows:
            self._last_us = float(rows[-1].t_us)
        return samples

    def recording(self) -> Recording:
        """All samples so far, late ones in their places; the other IMUs' in its `others`."""
        return self._log.recording(self._name)

    def forget(self) -> None:
        """Let go of all samples so far: `recording` holds what comes from now on."""
        self._log.forget()

    def now_ns(self) -> int:
        """The vehicle's clock: that of the last sample, and what the link's clock counted since."""
        if self._last_us is None:
            return self._link.now_ns() - self._sampled_ns
        return round(self._last_us * 1e3) + self._link.now_ns() - self._sampled_ns

    def stop(self) -> None:
        """Undo what was prepared; the streams are left to its other ground stations, and to the write-back."""
        if self._preparation is not None:
            self._preparation.release()

    def _hear(self, message: Message) -> None:
        self._log.add_other(message)
        if message.get_type() == "HEARTBEAT":
            self._beware(bool(message.base_mode & ARMED))
        content = decode_reading(message)
        if content is None:
            return
        row, jump = self._log.add_reading(content, self._link.now_ns())
        self._rebooted |= jump is Jump.REBOOT
        if row is not None and content.stream == self._stream:
            self._rows.append(row)
            self._sampled_ns = self._link.now_ns()

    def _beware(self, armed: bool) -> None:
        """Say each time it is armed: whoever turns it is near its propellers."""
        if armed and not self._said_armed:
            self._say(
                f"{self._link.vehicle} was armed: keep clear of its propellers and disarm it;"
                " nothing is written to an armed vehicle."
            )
        self._said_armed = armed

    def _weigh(self) -> None:
        """Say once that the link loses packets."""
        lost = self._link.lost - self._lost
        sent = self._received + lost
        if self._said_lost or sent < WEIGHED or lost < WORTH_SAYING * sent:
            return
        self._said_lost = True
        self._say(
            f"The link loses {100 * self._link.lost / sent:.0f} % of the packets; a nearer or faster one is better."
        )

    def _check_named(self, parameters: Mapping[str, float]) -> None:
        """Before anything is turned: a PX4 that names no sensor has no place for the result."""
        if self._firmware != PX4 or not parameters or find_slot(PX4, 1, parameters) is not None:
            return
        what = f"{self._link.vehicle} names none of its accelerometers (all CAL_ACCn_ID are 0)"
        if self._writes:
            raise WriteBackError(
                f"{what}, so that nothing can be written to it, and nothing was measured",
                "lay it level and give --prepare, by which PX4 names them and takes their offsets as it lies; or take"
                " --no-write",
            )
        self._say(f"{what}: the result is for files only.")

    def _wait_until_back(self) -> None:
        """After a reboot, a silence or a pause, have it stream again, and read its parameters anew."""
        end_ns = self._link.now_ns() + BACK_NS
        if not self._rebooted:
            self._link.seek()
        while not self._streams_again():
            if self._link.now_ns() >= end_ns:
                raise LinkError(
                    f"{self._link.vehicle} {self._trouble()}",
                    "check its power and the link, and that no other ground station stops its IMU messages",
                )
        read_stream_parameters(self._link, self._firmware)
        self._rebooted = False
        self._say(f"{self._link.vehicle} is back, its parameters are read again: go on.")

    def _trouble(self) -> str:
        if self._rebooted:
            return "rebooted (its clock started again)"
        now_ns = self._link.now_ns()
        heard = now_ns - self._heard_ns < SILENT_NS
        what, since_ns = ("no IMU messages", self._sampled_ns) if heard else ("nothing", self._heard_ns)
        return f"has sent {what} for {(now_ns - since_ns) // S} s"

    def _streams_again(self) -> bool:
        """Ask for the streams, and listen for a second; whether samples came."""
        if self._streams is not None:
            self._streams.ask_again()
        begun_ns = self._link.now_ns()
        for _ in self._link.messages(begun_ns + LOOK_NS):
            self._heard_ns = self._link.now_ns()
        return self._sampled_ns > begun_ns

    def _tell_changes(self) -> None:
        """Say once a change that parameters were changed while it streamed."""
        names = self._log.changed[self._told :]
        if not names:
            return
        self._told = len(self._log.changed)
        by = (
            " (PX4 does that itself while SENS_IMU_AUTOCAL is 1; --prepare holds it at 0)"
            if self._firmware == PX4
            else ""
        )
        self._say(f"{names[0]} was changed while it was measured{by}: what came before counts as far as it can.")


def choose_vehicle(vehicles: tuple[Vehicle, ...], system: int | None) -> Vehicle:
    """The only vehicle, or the only one of that system.

    Raises
    ------
    UsageError : several, with their list, or none of that system.
    """
    asked = [vehicle for vehicle in vehicles if system in (None, vehicle.system)]
    shown = sorted(vehicles, key=lambda v: (v.system, v.address))[:MOST_LISTED]
    listed = ", ".join(map(str, shown)) + (f" and {more} more" if (more := len(vehicles) - len(shown)) else "")
    if len(asked) == 1:
        return asked[0]
    if not asked:
        raise UsageError(f"no vehicle is system {system}: there is {listed}", "give one of these to --system")
    remedy = "choose one with --system N" if system is None else "stop the other, or listen on another port"
    raise UsageError(f"there are several vehicles: {listed}", remedy)
