"""Run the installed mpucal against simulated vehicles on real ports: sessions, then their parameters written.

    python tools/vehicle_trials.py                # all of them, in real time, three at once: about eight minutes
    python tools/vehicle_trials.py px4 tcp        # those with these words in their names

Each trial starts tools/sim_vehicle.py, runs `mpucal session` and then `mpucal write ... autopilot`, and says how both
ended, how far the parameters that the vehicle holds then are from its truth (offset m/s^2, scale), and whether the
exit codes are those that were expected.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mpucal.mavlink.parameters.names import place
from mpucal.mavlink.parameters.text import read_parameters_file
from mpucal.mavlink.simulated import Options, Vehicle
from mpucal.mavlink.truth import ARDUPILOT, PX4

HERE = Path(__file__).parent
MPUCAL = Path(sys.executable).parent / "mpucal"
AT_ONCE = 3
PATIENCE_S = 240


@dataclass(frozen=True)
class Trial:
    """What is tried: the vehicle's port and words, options of the tool and of mpucal, and the exit codes expected.

    `write` is None where there is nothing to write.
    """

    name: str
    port: str
    words: tuple[str, ...] = ()
    tool: tuple[str, ...] = ()
    session: int = 0
    write: int | None = 0


TRIALS = (
    Trial("ardupilot udp", "udp:127.0.0.1:24550"),
    Trial("px4 udp", "udp:127.0.0.1:24551", ("firmware=px4",)),
    Trial("ardupilot tcp, three IMUs", "tcp:127.0.0.1:0", ("imus=3",)),
    Trial("px4 tcp, board turned by 45 deg", "tcp:127.0.0.1:0", ("firmware=px4", "rotation=1")),
    Trial("ardupilot pty, no HIGHRES_IMU", "pty", ("highres=no",)),
    Trial("px4 pty", "pty", ("firmware=px4",)),
    Trial("ardupilot udp, one packet in five lost", "udp:127.0.0.1:24556", ("fault=loss",)),
    Trial("ardupilot udp, reordered and repeated", "udp:127.0.0.1:24557", ("fault=reorder", "fault=duplicate")),
    Trial("ardupilot udp, a stranger forges", "udp:127.0.0.1:24558", (), ("--stranger",)),
    Trial("ardupilot udp, a second station", "udp:127.0.0.1:24559", ("highres=no", "fault=second_station@25")),
    Trial("ardupilot udp, armed meanwhile", "udp:127.0.0.1:24560", ("fault=arm@40",), write=6),
    Trial("ardupilot udp, reboots meanwhile", "udp:127.0.0.1:24561", ("fault=reboot@8",), session=3, write=None),
    Trial("ardupilot udp, a parameter refused", "udp:127.0.0.1:24562", ("refuse=INS_ACC2SCAL_Y",), write=6),
    Trial("px4 udp, a parameter refused", "udp:127.0.0.1:24563", ("firmware=px4", "refuse=CAL_ACC1_YSCALE"), write=6),
    Trial("two vehicles", "udp:127.0.0.1:24564", (), ("--vehicles", "2"), session=2, write=None),
    Trial("a vehicle that signs", "udp:127.0.0.1:24565", (), ("--signing-key", "KEY"), session=3, write=None),
)


def main() -> int:
    """Run the trials asked for; 1 where one ended otherwise than expected."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("words", nargs="*")
    words = parser.parse_args().words
    chosen = [trial for trial in TRIALS if all(word in trial.name for word in words)]
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(AT_ONCE) as pool:
        work = [Path(folder) / str(n) for n in range(len(chosen))]
        results = list(pool.map(run, chosen, work))
    return 0 if all(results) else 1


def run(trial: Trial, folder: Path) -> bool:
    """Run one, print what came of it; whether that was expected."""
    folder.mkdir()
    key = folder / "key"
    key.write_bytes(bytes(range(32)))
    options = [str(key) if word == "KEY" else word for word in trial.tool]
    command = [sys.executable, str(HERE / "sim_vehicle.py"), trial.port, *trial.words, *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as vehicle:
        try:
            url = vehicle.stdout.readline().strip() if vehicle.stdout else ""
            lines, good = tried(trial, url, folder)
        finally:
            vehicle.terminate()
    print("\n  ".join([f"{'as expected' if good else 'NOT AS EXPECTED'}: {trial.name}", *lines]), flush=True)
    return good


def tried(trial: Trial, url: str, folder: Path) -> tuple[list[str], bool]:
    """What was said last, and whether the exit codes are those expected."""
    session = mpucal("session", "--mavlink", url, "--yes", "-o", str(folder / "session"))
    lines = [f"session: exit {session.returncode}, {last_line(session)}"]
    if trial.write is None:
        return lines, session.returncode == trial.session
    calibration = str(folder / "session" / "calibration.json")
    written = mpucal("write", calibration, "autopilot", "--mavlink", url, "--yes", "-o", str(folder))
    lines.append(f"write: exit {written.returncode}, {last_line(written)}")
    after = mpucal("write", calibration, "autopilot", "--mavlink", url, "--yes", "-o", str(folder / "again"))
    kept = sorted((folder / "again").glob("autopilot_old.*"))
    if kept and after.returncode == trial.write:
        lines.append(apart(trial, kept[0]))
    return lines, (session.returncode, written.returncode) == (trial.session, trial.write)


def apart(trial: Trial, file: Path) -> str:
    """How far what the vehicle holds, as the second write kept it in `file`, is from what its sensors need."""
    vehicle = Vehicle(Options.parse("sim:" + ",".join(trial.words) if trial.words else "sim"))
    firmware = PX4 if vehicle.firmware.bytewise else ARDUPILOT
    held = read_parameters_file(file)
    ids = {name: 1.0 for name in vehicle.firmware.store if name.endswith("_ID") and vehicle.firmware.store[name]}
    said = []
    for imu, truth in enumerate(vehicle.imus.truths, start=1):
        where = place(firmware, imu, ids)
        correction = None if where is None else where.correction(held)
        if correction is not None:
            offset = np.abs(correction.offset - truth.b_a).max()
            scale = np.abs(correction.scale - np.diag(np.linalg.inv(truth.D))).max()
            said.append(f"IMU {imu} {offset:.4f} and {scale:.5f}")
    return "held now, off the truth by: " + "; ".join(said)


def mpucal(*words: str) -> subprocess.CompletedProcess[str]:
    """Run the installed command; one that does not end is ended, and has exit code -1."""
    command = [str(MPUCAL), *words]
    try:
        return subprocess.run(
            command, capture_output=True, text=True, timeout=PATIENCE_S, check=False, stdin=subprocess.DEVNULL
        )
    except subprocess.TimeoutExpired:
        return subprocess.CompletedProcess(command, -1, "", f"it had not ended after {PATIENCE_S} s")


def last_line(done: subprocess.CompletedProcess[str]) -> str:
    """What it said last: of its result, or of why there is none."""
    said = [
        line.strip() for line in (done.stdout if done.returncode == 0 else done.stderr).splitlines() if line.strip()
    ]
    results = [line for line in said if line.startswith(("The calibration", "Done"))]
    return (results or said or ["nothing was said"])[-1]


if __name__ == "__main__":
    sys.exit(main())
