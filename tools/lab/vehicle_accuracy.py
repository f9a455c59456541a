"""Sessions with simulated vehicles against the truth, and whether their claims hold: a line a session.

    python -m tools.lab vehicle_accuracy                # 20 of ArduPilot, 10 of PX4, fresh and used in turn
    python -m tools.lab vehicle_accuracy --seeds 0:4    # of the first four seeds, and half as many of PX4
    python -m tools.lab vehicle_accuracy --hand placing # put down on its sides instead of held

Each runs `mpucal session --mavlink sim:... --yes --no-write` as fast as it can. `took` [s] is the time of its samples;
`offset` [m/s^2] and `scale` are how far the new parameters are from the sensors' truth, at worst over axes and IMUs;
`level` [deg] is by how much the attitude of the vehicle, which stands where it was levelled, differs after the result
was written and the vehicle rebooted, which a refused one does not have; `z` is the rms over D and b_a of all IMUs of
(estimate - truth) / standard uncertainty. The exit code is 1 where one that is good is more than OFFSET_MPS2, SCALE or
LEVEL_DEG off, or the z of all of them is not within Z.
"""

from typing import Annotated

import numpy as np

from mpucal.clocks import S
from mpucal.data import Vector
from mpucal.mavlink.dialect import dialect
from mpucal.mavlink.link import Link
from mpucal.mavlink.parameters.slots import slot_of
from mpucal.mavlink.requests import interval_command, send_command
from mpucal.mavlink.rest import ATTITUDE
from mpucal.mavlink.texts import ReceivedPrompt, encode_prompt
from mpucal.result.calibration import GOOD, REFUSED, Calibration
from mpucal.simulated.hands import HANDS
from mpucal.simulated.vehicle import SimulatedVehicle, VehicleOptions
from mpucal.simulated.vehicle.firmware import LEVEL
from mpucal.simulated.vehicle.transport import SimulatedTransport
from mpucal.vehicle.sink import AutopilotSink

from .judge import needed, off, rms, z_of
from .runner import Trial
from .sessions import by_command
from .table import Row, known, over

OFFSET_MPS2, SCALE, LEVEL_DEG, Z = 6e-3, 1e-3, 0.1, (0.7, 1.3)
LIES_NS, BOOTED_NS, HEARD_NS = 6 * S, 4 * S, 3 * S
FIRST_SEED = 100
# parameters, mounting and filters of vehicles that were in use
USED = {
    "ardupilot": (
        "INS_ACCOFFS_X=0.3,INS_ACCSCAL_Y=0.985,INS_ACC2OFFS_Z=-0.4,rotation=4",
        "highres=no,INS_ACCOFFS_Z=-0.2,INS_ACC2SCAL_X=1.02",
        "INS_ACCEL_FILTER=10,INS_GYRO_FILTER=10,INS_ACCOFFS_Y=0.15",
        "INS_GYRO_FILTER=40,INS_ACC2OFFS_Y=0.25,rotation=12",
    ),
    "px4": (
        "CAL_ACC0_XOFF=0.3,CAL_ACC1_YSCALE=0.98,rotation=4",
        "CAL_ACC0_ZOFF=-0.25,CAL_ACC1_XOFF=0.2,imus=3",
    ),
}


def words_of(firmware: str, n: int) -> str:
    """Return the --mavlink value of the n-th vehicle; every second one has been in use."""
    used = USED[firmware]
    more = "" if n % 2 == 0 else "," + used[n // 2 % len(used)]
    return f"firmware={firmware},seed={FIRST_SEED + n}{more}"


def scenarios(*, seeds: range) -> list[str]:
    """Return the --mavlink value of each seed's ArduPilot, and of half as many PX4."""
    return [
        words_of(firmware, n)
        for firmware, share in (("ardupilot", 1), ("px4", 2))
        for n in seeds[: len(seeds) // share]
    ]


def of_vehicle(words: str, *, hand: Annotated[str, HANDS, "that turns the vehicle"] = "guided") -> Row:
    """Run a session with a vehicle in this hand, and compare."""
    words += f",hand={hand}"
    done, document = by_command("--mavlink", f"sim:{words}", "--no-write")
    if done.calibration is None:
        return Row(words=words, code=done.code, verdict="none")
    documents, truths = ([first, *first["others"]] for first in (document, done.truth))
    z = [each for one, truth in zip(documents, truths, strict=True) for each in z_of(one, truth)]
    far = []
    simulated = SimulatedVehicle(VehicleOptions.parse(f"sim:{words}"))
    for one, truth in zip(documents, simulated.imus.truths, strict=True):
        autopilot = one["autopilot"]
        where = slot_of(autopilot["firmware"], autopilot["imu"], autopilot["params_new"])
        far.append(off(where, autopilot["params_new"], needed(truth)))
    offset, scale = map(max, zip(*far, strict=True))
    row = Row(words=words, code=done.code, verdict=done.calibration.verdict, z=tuple(z), offset=offset, scale=scale)
    row.took = float(document["fit"]["seconds"])
    if done.calibration.verdict != REFUSED:
        row.level = level_change_deg(words, done.calibration)
    return row


def level_change_deg(words: str, calibration: Calibration) -> float:
    """Level the vehicle as it stands, write and reboot; return the largest change of its roll or pitch."""
    vehicle = SimulatedVehicle(VehicleOptions.parse(f"sim:{words}"))
    link = Link(SimulatedTransport(vehicle), lambda _t_ns, _packet: None)
    link.lock(link.listen()[0])
    link.send(encode_prompt(ReceivedPrompt("lay_flat", None)))
    list(link.messages(link.now_ns() + LIES_NS))
    send_command(link, dialect().MAV_CMD_PREFLIGHT_CALIBRATION, 0, 0, 0, 0, LEVEL)
    # the estimator forgets what it learnt, as it does at the reboot after the write
    vehicle.reboot()
    list(link.messages(link.now_ns() + BOOTED_NS))
    before = attitude_deg(link)
    AutopilotSink(link, confirm=lambda _question, with_yes: with_yes).write(calibration)
    return float(np.abs(attitude_deg(link) - before).max())


def attitude_deg(link: Link) -> Vector:
    """Return the mean roll and pitch (2,) of a few seconds."""
    send_command(link, *interval_command(ATTITUDE))
    heard = [m for m in link.messages(link.now_ns() + HEARD_NS) if m.get_type() == ATTITUDE]
    return np.asarray(np.degrees(np.mean([(m.roll, m.pitch) for m in heard], axis=0)))


COLUMNS = {
    "took": over("took"),
    "offset": over("offset"),
    "scale": over("scale"),
    "level": over("level"),
    "z": over("z", rms),
}


def report(rows: list[Row]) -> int:
    """Print the number of accurate sessions and the rms z of all; return 1 if one is not, or the claims are wrong."""
    good = [row for row in rows if row.verdict == GOOD]
    z = rms(known(good, "z"))
    near = sum(row.offset <= OFFSET_MPS2 and row.scale <= SCALE and row.level <= LEVEL_DEG for row in good)
    limits = f"{OFFSET_MPS2} m/s^2, {SCALE} and {LEVEL_DEG} deg"
    print(f"{len(good)} of {len(rows)} good, {near} of these within {limits}; rms z {z:.2f}")
    return 0 if near == len(good) > 0 and Z[0] <= z <= Z[1] else 1


main = Trial(__doc__, of_vehicle, scenarios, COLUMNS, ("words", "code", "verdict"), report=report)
