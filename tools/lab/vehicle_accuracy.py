"""How near sessions with simulated vehicles come to the truth, and whether their claims hold: a line a session.

    python -m tools.lab vehicle_accuracy                # 20 of ArduPilot, 10 of PX4, fresh and used in turn
    python -m tools.lab vehicle_accuracy --seeds 0:4    # of the first four seeds, and half as many of PX4

Each runs `mpucal session --mavlink sim:... --yes --no-write` as fast as it can. `offset` [m/s^2] and `scale` are how
far the new parameters are from the sensors' truth, at worst over axes and IMUs; `z` is the rms over D and b_a of all
IMUs of (estimate - truth) / standard uncertainty. The exit code is 1 where one that is good is more than OFFSET_MPS2 or
SCALE off, or the z of all of them is not within Z.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from mpucal.mavlink.parameters.names import slot_of
from mpucal.result.calibration import GOOD
from mpucal.simulated.vehicle import SimulatedVehicle, VehicleOptions

from .judge import rms
from .sessions import by_command
from .trials import command_line, in_parallel, save
from .vehicle_truth import needed, off, z_of

OFFSET_MPS2, SCALE, Z = 2e-3, 5e-4, (0.7, 1.3)
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


@dataclass(frozen=True)
class Outcome:
    """Of one session; z : of all IMUs."""

    words: str
    code: int
    verdict: str = "none"
    offset: float = math.nan
    scale: float = math.nan
    z: tuple[float, ...] = ()

    @property
    def near(self) -> bool:
        """Whether it is good, and as near as it should be; or makes no such claim."""
        return self.verdict != GOOD or (self.offset <= OFFSET_MPS2 and self.scale <= SCALE)

    def __str__(self) -> str:
        numbers = f"{self.offset:9.5f} {self.scale:9.6f} {rms(self.z):6.2f}"
        return f"{self.code:4d} {self.verdict:8} {numbers} {'  ' if self.near else '! '}{self.words}"


def main() -> int:
    """Run them, and print the table."""
    asked = command_line(__doc__).parse_args()
    words = [words_of("ardupilot", n) for n in asked.seeds]
    words += [words_of("px4", n) for n in asked.seeds[: len(asked.seeds) // 2]]
    print("exit verdict     offset     scale      z  vehicle", flush=True)
    outcomes = []
    for outcome in in_parallel(run, words, asked.jobs):
        print(outcome, flush=True)
        outcomes.append(outcome)
    good = [outcome for outcome in outcomes if outcome.verdict == GOOD]
    z, near = rms([each for outcome in good for each in outcome.z]), sum(outcome.near for outcome in good)
    print(f"{len(good)} of {len(outcomes)} good, {near} of these within {OFFSET_MPS2} m/s^2 and {SCALE}; rms z {z:.2f}")
    save(asked.json, outcomes)
    return 0 if near == len(good) > 0 and Z[0] <= z <= Z[1] else 1


def words_of(firmware: str, n: int) -> str:
    """Every second one has been in use."""
    used = USED[firmware]
    more = "" if n % 2 == 0 else "," + used[n // 2 % len(used)]
    return f"firmware={firmware},seed={FIRST_SEED + n}{more}"


def run(words: str) -> Outcome:
    """One session."""
    done, document = by_command("--mavlink", f"sim:{words}", "--no-write")
    if done.calibration is None:
        return Outcome(words, done.code)
    documents, truths = ([first, *first["others"]] for first in (document, done.truth))
    z = [each for one, truth in zip(documents, truths, strict=True) for each in z_of(one, truth)]
    far = []
    simulated = SimulatedVehicle(VehicleOptions.parse(f"sim:{words}"))
    for one, truth in zip(documents, simulated.imus.truths, strict=True):
        autopilot = one["autopilot"]
        where = slot_of(autopilot["firmware"], autopilot["imu"], autopilot["params_new"])
        far.append(off(where, autopilot["params_new"], needed(truth)))
    offset, scale = map(max, zip(*far, strict=True))
    return Outcome(words, done.code, done.calibration.verdict, offset, scale, tuple(z))
