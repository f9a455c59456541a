"""Hostile MAVLink packets beside a vehicle, during a session that writes back and during `mpucal write`.

    python -m tools.attack hostile_vehicle --seeds 9                # a few hours; 18 runs of each kind and attacker
    python -m tools.attack hostile_vehicle --seeds 1 --kinds ids ftp

The simulated vehicle and the attacker share one link, and the packets go through the code that those of a socket do.
The attacker sends as a stranger (an address of its own), as the vehicle (its address forged, nothing signed) and
against signing (the address forged, both sides sign, and it has no key, but packets of an earlier session). Seed 0
sends a thousand packets a second of the vehicle's time from the lock on, the others bursts of any rate and length at
any time, some from before the lock on.

Of a stranger, and against signing, the calibration must be the undisturbed one to the bit, and be written. Always
wrong is an undocumented exit code, a traceback, a hang, a failure without a sentence, an incomplete file, a parameter
that is set to neither the vehicle's own value nor that of calibration.json, and, where no samples were forged, a
calibration with larger errors than it claims. Exit code 1: a run was wrong.
"""

import json
import os
import re
import tempfile
from collections.abc import Iterator, Sequence
from functools import cache, partial
from itertools import product
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np

from mpucal.__main__ import run
from mpucal.files.mcap import read_capture
from mpucal.mavlink.parameters.write import DETOUR
from mpucal.mavlink.tlog import RawPacket
from mpucal.result.calibration import Calibration
from tools.lab.campaign_judge import partial_files
from tools.lab.judge import judged
from tools.lab.runner import Trial
from tools.lab.table import Column, Row, count, frequencies
from tools.processes import CODES, Child, lasting_folder, ready

from .hostile_link import ATTACKERS, FORGED, KINDS, MOST_HEARD, SIGNED, STRANGER, Attack, HostileTransport, hostile

KEY = bytes(range(32))
FIRMWARES = ("ardupilot", "px4")
# kinds that may pass for the vehicle's samples if the address is forged and nothing is signed
OF_SAMPLES = ("values", "time", "replayed", "junk", "mixed")
# packets a second of the vehicle's time
RATE = 1000.0
CPU_S, WALL_S = 300, 1200.0
NO_VEHICLE = 2
QUICK = ("--rate", "50", "--target", "quick")
NUMBER = re.compile(r"-?\d[\d.e+-]*|nan|inf")


class Case(NamedTuple):
    """An attack to run, and the results of an undisturbed session; without these, it is that session."""

    attack: Attack
    clean: Path | None = None


def commands(case: Case) -> Iterator[tuple[Path, list[str]]]:
    """Yield each command, and before it the file whose parameters it may set."""
    link = ["--mavlink", f"sim:firmware={case.attack.firmware}"]
    link += ["--signing-key", "key"] if case.attack.attacker == SIGNED else []
    yield Path("out/calibration.json"), ["session", *link, *QUICK, "-o", "out", "--yes"]
    if case.clean is not None:
        clean = case.clean / "calibration.json"
        yield clean, ["write", str(clean), "autopilot", *link, "--yes", "-o", "written"]


def under_attack(attack: Attack, words: list[str]) -> int:
    """Run a command in this process, and leave what it was sent and set, and the truth of the vehicle."""
    os.environ["XDG_STATE_HOME"] = str(Path("state").resolve())
    attack.draw(words[0])
    with hostile(attack):
        code = run(words)
    told = {"sent": attack.sent, "sets": attack.sets, "truth": HostileTransport.truths[0]}
    Path("told").write_text(json.dumps(told))
    return code


def run_attack(case: Case, place: Path) -> Row:
    """Run the commands, and judge them."""
    ready()
    attack, signed = case.attack, case.attack.attacker == SIGNED
    (place / "key").write_bytes(KEY)
    row = Row(kind=attack.kind, attacker=attack.attacker, codes=[], wrong=[], ends=[], sent=0, unasked=0, fooled=0)
    for file, words in commands(case):
        done = Child(partial(under_attack, attack, words), place, place / "said", CPU_S).go().wait(WALL_S)
        row.codes.append(done.code)
        row.ends += [f"exit {done.code}: {NUMBER.sub('N', done.last)[:80]}"] if done.code else []
        row.wrong += [*done.wrong((*CODES, NO_VEHICLE) if attack.early else CODES), *_told(row, place, file, words[0])]
    out = place / "out" / "calibration.json"
    row.wrong += partial_files(place / "out", row.codes[0])
    if signed or (attack.attacker == STRANGER and not attack.early):
        undisturbed = case.clean is None or same(out, case.clean / "calibration.json")
        row.wrong += [f"not as without: exit codes {row.codes}"] if any(row.codes) or not undisturbed else []
    return row


def _told(row: Row, place: Path, file: Path, command: str) -> Iterator[str]:
    """Yield what is wrong with the parameters that a command set, and with the calibration of a session."""
    if not (told := place / "told").exists():
        return
    found = json.loads(told.read_text())
    told.unlink()
    extra = not_asked(found["sets"], place / file)
    row.sent, row.unasked = row.sent + found["sent"], row.unasked + len(extra)
    yield from [f"{command} set {extra[0]}"] if extra else []
    if command == "session" and (place / file).exists():
        truth = found["truth"]
        of = judged(Calibration.load(place / file), (np.array(truth["D"]), np.array(truth["b_a"])))
        row.fooled += of.false
        if of.false and not (row.attacker == FORGED and row.kind in OF_SAMPLES):
            yield f"called {of.verdict}: {of.error:.3f} m/s^2, {of.claims:.1f} claims"


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


@cache
def undisturbed(attacker: str, firmware: str) -> tuple[Path, tuple[bytes, ...]]:
    """Return the results of a session without an attack, and packets of it."""
    place = lasting_folder()
    row = run_attack(Case(Attack("ids", attacker, firmware, 0, 0.0)), place)
    if row.wrong or any(row.codes):
        raise SystemExit(f"{firmware} undisturbed: {row}")
    records = read_capture(place / "out" / "capture.mcap").records
    packets = [record.data for record in records if isinstance(record, RawPacket)]
    return place / "out", tuple(packets[-MOST_HEARD // 2 :])


def of_attack(case: Case) -> Row:
    """Run an attack in a folder of its own."""
    with tempfile.TemporaryDirectory() as place:
        return run_attack(case, Path(place).resolve())


def scenarios(*, seeds: range, kinds: Annotated[Sequence[str], KINDS] = tuple(KINDS)) -> Iterator[Case]:
    """Yield the attacks of each kind, attacker, seed and firmware."""
    for kind, attacker, seed, firmware in product(kinds, ATTACKERS, seeds, FIRMWARES):
        clean, heard = undisturbed(SIGNED if attacker == SIGNED else STRANGER, firmware)
        yield Case(Attack(kind, attacker, firmware, seed, RATE, heard), clean)


def total(name: str) -> Column:
    """Return a column: the sum over the runs."""
    return lambda rows: sum(getattr(row, name) for row in rows)


COLUMNS: dict[str, Column] = {
    "runs": len,
    "packets": total("sent"),
    "sets not asked for": total("unasked"),
    "fooled": total("fooled"),
    "wrong": count("wrong"),
    "exits": lambda rows: frequencies(end for row in rows for end in row.ends) or "all 0",
}


main = Trial(__doc__, of_attack, scenarios, COLUMNS, ("kind", "attacker"), seeds="0:3")
