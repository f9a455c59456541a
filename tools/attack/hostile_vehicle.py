"""Hostile MAVLink packets beside a vehicle, during a session that writes back and during `mpucal write --store`.

    python -m tools.attack hostile_vehicle                          # every kind, until 100,000 packets of it were heard
    python -m tools.attack hostile_vehicle --packets 2000 --runs 1 ids ftp

The simulated vehicle and the attacker share one link, and the packets go through the code that those of a socket do.
The attacker sends as a stranger (an address of its own), as the vehicle (its address forged, nothing signed) and
against signing (the address forged, both sides sign, and it has no key, but packets of an earlier session). Each run
is a process of its own: both commands, the first with a thousand packets a second of the vehicle's time from the lock
on, the others with bursts of any rate and length at any time, some from before the lock on.

Of a stranger, and against signing, the calibration must be the undisturbed one to the bit, and be written. Always
wrong is an exit code that says nothing, a trace, a hang, no sentence, a file in part, a parameter set that is neither
the vehicle's own value nor that of calibration.json, and a calibration that promises what it does not hold, where no
samples were forged. Exit code 1 where a run was wrong.
"""

from __future__ import annotations

import json
import os
import re
import signal
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from mpucal.__main__ import run
from mpucal.errors import MpucalError
from mpucal.files.mcap import read_capture
from mpucal.mavlink.parameters.write import DETOUR
from mpucal.mavlink.tlog import RawPacket
from mpucal.result.calibration import Calibration
from tools.lab.campaign_judge import false, partial_files
from tools.lab.judge import judged
from tools.processes import CODES, Died, Ended, Report, Tell, become, forked, limit_cpu, ready
from tools.programs import PROCESSORS, Jobs

from .hostile_link import ATTACKERS, FORGED, KINDS, MOST_HEARD, SIGNED, STRANGER, Attack, HostileTransport, hostile

KEY = bytes(range(32))
FIRMWARES = ("ardupilot", "px4")
# kinds that may pass for the vehicle's samples if the address is forged and nothing is signed
OF_SAMPLES = ("values", "time", "replayed", "junk", "mixed")
MOST_RUNS = 60
# packets a second of the vehicle's time
RATE = 1000.0
CPU_S, WALL_S = 300, 1200
NO_VEHICLE = 2
QUICK = ("--rate", "50", "--target", "quick")
NUMBER = re.compile(r"-?\d[\d.e+-]*|nan|inf")


def commands(attack: Attack, clean: Path | None) -> Iterator[tuple[str, list[str]]]:
    """Yield each command, and the file whose parameters it may set."""
    vehicle = [f"sim:firmware={attack.firmware}"]
    signing = ["--signing-key", "key"] if attack.attacker == SIGNED else []
    yield "out/calibration.json", ["session", "--mavlink", *vehicle, *signing, *QUICK, "-o", "out", "--yes"]
    if clean is not None:
        words = ["write", str(clean), "autopilot", "--mavlink", *vehicle, *signing, "--store", "--yes", "-o", "written"]
        yield str(clean), words


def run_attack(attack: Attack, clean: Path | None, place: Path) -> dict[str, Any]:
    """Run the commands in this process, and judge them."""
    place.mkdir(parents=True)
    become(place, place / "said")
    Path("key").write_bytes(KEY)
    os.environ["XDG_STATE_HOME"] = str(place / "state")
    codes, wrong, ends, unasked = [], [], [], 0
    allowed = (*CODES, NO_VEHICLE) if attack.early else CODES
    with hostile(attack):
        for file, words in commands(attack, clean):
            attack.draw(words[0])
            done = Ended(run(words), Path("said").read_text("utf-8", "replace"))
            codes.append(done.code)
            ends += [f"exit {done.code}: {NUMBER.sub('N', done.last)}"] if done.code else []
            extra = not_asked(attack.sets, Path(file))
            unasked += len(extra)
            wrong += [f"{words[0]} set {extra[0]}"] if extra else []
            wrong += done.wrong(allowed)
    wrong += partial_files(Path("out"), codes[0])
    if attack.attacker == SIGNED or (attack.attacker == STRANGER and not attack.early):
        undisturbed = clean is None or same(Path("out/calibration.json"), clean)
        wrong += [f"not as without: exit codes {codes}"] if any(codes) or not undisturbed else []
    fooled, lies = judge_samples(attack)
    wrong += lies
    return {"sent": attack.sent, "codes": codes, "wrong": wrong, "unasked": unasked, "fooled": fooled, "ends": ends}


def judge_samples(attack: Attack) -> tuple[int, list[str]]:
    """Return 1 if the error of the calibration exceeds its claim, and why that is wrong (not of forged samples)."""
    try:
        calibration = Calibration.load(Path("out/calibration.json"))
    except MpucalError:
        return 0, []
    truth = HostileTransport.truths[0]
    found = judged(calibration, (np.array(truth["D"]), np.array(truth["b_a"])))
    lies = [f"{lie}: {found.error:.3f} m/s^2, {found.claims:.1f} claims" for lie in false(found)]
    forged = attack.attacker == FORGED and attack.kind in OF_SAMPLES
    return len(lies), [] if forged else lies


def not_asked(sets: list[tuple[str, float, float]], file: Path) -> list[tuple[str, float]]:
    """Return parameters that were set to values neither of the calibration in `file` nor of the vehicle."""
    new: dict[str, float] = {}
    if file.is_file():
        document = json.loads(file.read_text())
        for imu in (document, *document["others"]):
            new |= imu["autopilot"].get("params_new", {})
    return [
        (name, value)
        for name, value, old in sets
        if name not in new or not min(abs(value - old), abs(value - new[name])) <= DETOUR * 1.01
    ]


def same(file: Path, clean: Path) -> bool:
    """Return True if both hold the same D and b_a."""
    if not file.is_file():
        return False
    one, other = map(Calibration.load, (file, clean))
    return bool(np.array_equal(one.D, other.D) and np.array_equal(one.b_a, other.b_a))


def outcomes(attacks: Sequence[tuple[Attack, Path | None, Path]], jobs: int) -> Iterator[dict[str, Any]]:
    """Run each attack in a process of its own, and yield the outcomes, as they end."""
    for _, told in forked([partial(alone, *each) for each in attacks], jobs):
        died = {"sent": 0, "codes": ["?"], "unasked": 0, "fooled": 0, "ends": []}
        yield {**died, "wrong": [f"it hung, or was ended ({told.code})"]} if isinstance(told, Died) else told


def alone(attack: Attack, clean: Path | None, place: Path, tell: Tell) -> None:
    """Run an attack, and report its outcome; the kernel ends a process that hangs."""
    limit_cpu(CPU_S)
    signal.alarm(WALL_S)
    tell(run_attack(attack, clean, place))
    # skips the orderly close of what the session has open
    os._exit(0)


def main(
    kinds: Annotated[list[str], KINDS, "default: all"] = tuple(KINDS),
    *,
    packets: Annotated[int, "of each kind and attacker, at least"] = 100_000,
    runs: Annotated[int, "of each kind, attacker and firmware, at least"] = 3,
    jobs: Jobs = PROCESSORS,
) -> int:
    """Run the attacks and print a line for each kind and attacker; return the exit code."""
    ready()
    wrong = False
    with tempfile.TemporaryDirectory() as temporary:
        place = Path(temporary).resolve()
        for kind, attacker in product(kinds, ATTACKERS):
            report = Report()
            done = attacked(place, kind, attacker, packets, runs, jobs)
            for outcome in done:
                report.tell(f"{kind}, {attacker}", "; ".join(outcome["wrong"]))
            wrong |= bool(report.shown())
            sent, unasked, fooled = (sum(outcome[key] for outcome in done) for key in ("sent", "unasked", "fooled"))
            ends = Counter(end for outcome in done for end in outcome["ends"]).most_common()
            exits = ", ".join(f"{count} x {end}" for end, count in ends)
            print(
                f"    {sent} packets, {unasked} sets not asked for, {fooled} fooled; {exits or 'all exit 0'}",
                flush=True,
            )
    return int(wrong)


def undisturbed(place: Path, attacker: str, firmware: str) -> Path:
    """Return the folder of a session without an attack."""
    signed = SIGNED if attacker == SIGNED else STRANGER
    folder = place / f"{firmware} {signed}"
    if not folder.exists():
        [outcome] = outcomes([(Attack("ids", signed, firmware, 0, 0.0), None, folder)], 1)
        if outcome["wrong"] or any(outcome["codes"]):
            raise SystemExit(f"{firmware} undisturbed: {outcome}")
    return folder / "out"


def attacked(place: Path, kind: str, attacker: str, packets: int, runs: int, jobs: int) -> list[dict[str, Any]]:
    """Run attacks until enough packets of a kind were heard; return their outcomes."""
    clean = {firmware: undisturbed(place, attacker, firmware) for firmware in FIRMWARES}
    heard = {}
    for firmware in FIRMWARES:
        records = read_capture(clean[firmware] / "capture.mcap").records
        heard[firmware] = tuple(r.data for r in records if isinstance(r, RawPacket))[-MOST_HEARD // 2 :]
    done: list[dict[str, Any]] = []
    for seed in range(MOST_RUNS):
        if seed >= runs and sum(outcome["sent"] for outcome in done) >= packets:
            break
        tasks = []
        for firmware in FIRMWARES:
            here = place / f"{kind}-{attacker.replace(' ', '-')}-{firmware}-{seed}"
            attack = Attack(kind, attacker, firmware, seed, RATE, heard[firmware])
            tasks.append((attack, clean[firmware] / "calibration.json", here))
        done += outcomes(tasks, jobs)
    return done
