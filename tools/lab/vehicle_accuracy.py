"""How near sessions with simulated vehicles come to the truth, and whether their claims hold: a line a session.

    python -m tools.lab vehicle_accuracy                        # 20 of ArduPilot, 10 of PX4, fresh and used in turn
    python -m tools.lab vehicle_accuracy --ardupilot 4 --px4 2  # fewer

Each runs `mpucal session --mavlink sim:... --yes --no-write` as fast as it can. `offset` [m/s^2] and `scale` are how
far the new parameters are from the sensors' truth, at worst over axes and IMUs; `z` is the rms over D and b_a of all
IMUs of (estimate - truth) / standard uncertainty. The exit code is 1 where one that is good is more than OFFSET_MPS2 or
SCALE off, or the z of all of them is not within Z.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mpucal.data import Vector
from mpucal.mavlink.parameters.names import place_of
from mpucal.simulated.vehicle import SimulatedVehicle, VehicleOptions

MPUCAL = Path(sys.executable).parent / "mpucal"
AT_ONCE = 2
OFFSET_MPS2, SCALE, Z = 2e-3, 5e-4, (0.7, 1.3)
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
    """Of one session; z : (n,), of all IMUs."""

    words: str
    code: int
    verdict: str
    offset: float
    scale: float
    z: Vector

    @property
    def near(self) -> bool:
        """Whether it is good, and as near as it should be; or makes no such claim."""
        return self.verdict != "good" or (self.offset <= OFFSET_MPS2 and self.scale <= SCALE)

    def __str__(self) -> str:
        rms = float(np.sqrt(np.mean(self.z**2))) if len(self.z) else np.nan
        numbers = f"{self.offset:9.5f} {self.scale:9.6f} {rms:6.2f}"
        return f"{self.code:4d} {self.verdict:8} {numbers} {'  ' if self.near else '! '}{self.words}"


def main() -> int:
    """Run them, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ardupilot", type=int, default=20)
    parser.add_argument("--px4", type=int, default=10)
    arguments = parser.parse_args()
    words = [word for name in ("ardupilot", "px4") for word in _words(name, getattr(arguments, name))]
    print("exit verdict     offset     scale      z  vehicle", flush=True)
    outcomes = []
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(AT_ONCE) as pool:
        jobs = [partial(run, word, Path(folder) / str(n)) for n, word in enumerate(words)]
        for outcome in pool.map(lambda job: job(), jobs):
            print(outcome, flush=True)
            outcomes.append(outcome)
    good = [outcome for outcome in outcomes if outcome.verdict == "good"]
    rms = float(np.sqrt(np.mean(np.concatenate([outcome.z for outcome in good]) ** 2))) if good else np.nan
    near = sum(outcome.near for outcome in good)
    print(
        f"{len(good)} of {len(outcomes)} good, {near} of these within {OFFSET_MPS2} m/s^2 and {SCALE}; rms z {rms:.2f}"
    )
    return 0 if near == len(good) > 0 and Z[0] <= rms <= Z[1] else 1


def _words(firmware: str, count: int) -> list[str]:
    """Every second one has been in use."""
    used = USED[firmware]
    more = ["" if n % 2 == 0 else "," + used[n // 2 % len(used)] for n in range(count)]
    return [f"firmware={firmware},seed={100 + n}{words}" for n, words in enumerate(more)]


def run(words: str, folder: Path) -> Outcome:
    """One session."""
    command = [str(MPUCAL), "session", "--mavlink", f"sim:{words}", "--yes", "--no-write", "-o", str(folder)]
    done = subprocess.run(command, capture_output=True, check=False, stdin=subprocess.DEVNULL)
    file = folder / "calibration.json"
    if not file.exists():
        return Outcome(words, done.returncode, "none", np.nan, np.nan, np.empty(0))
    document = json.loads(file.read_text())
    truth = json.loads((folder / "truth.json").read_text())
    offset, scale = _off(words, [document, *document["others"]])
    z = [_z(one, true) for one, true in zip([document, *document["others"]], [truth, *truth["others"]], strict=True)]
    return Outcome(words, done.returncode, document["quality"]["verdict"], offset, scale, np.concatenate(z))


def _off(words: str, documents: list[dict[str, Any]]) -> tuple[float, float]:
    """How far the new parameters are from the truth at worst: offset [m/s^2], scale."""
    vehicle = SimulatedVehicle(VehicleOptions.parse(f"sim:{words}"))
    offset, scale = [], []
    for document, truth in zip(documents, vehicle.imus.truths, strict=True):
        autopilot = document["autopilot"]
        where = place_of(autopilot["firmware"], autopilot["imu"], autopilot["params_new"])
        correction = None if where is None else where.correction(autopilot["params_new"])
        if correction is None:
            return np.nan, np.nan
        offset.append(np.abs(correction.offset - truth.b_a).max())
        scale.append(np.abs(correction.scale - np.diag(np.linalg.inv(truth.D))).max())
    return float(max(offset)), float(max(scale))


def _z(document: dict[str, Any], truth: dict[str, Any]) -> Vector:
    """(12,) of D and b_a."""
    found = document["accelerometer"]
    parts = [(np.array(found[key]) - truth[key]) / np.array(found[f"{key}_std"]) for key in ("D", "b_a")]
    return np.concatenate([part.ravel() for part in parts])
