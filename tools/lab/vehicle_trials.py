"""Run the installed mpucal against simulated vehicles on real ports, from a session to the parameters they hold then.

    python -m tools.lab vehicle_trials                # all of them in real time, two at once: about fifteen minutes
    python -m tools.lab vehicle_trials px4 tcp        # those with these words in their names

Each trial starts tools/lab/sim_vehicle.py, runs `mpucal session --mavlink URL --yes`, asks the vehicle itself for its
parameters before and after, and says what mpucal said last. It is as expected where the exit code is, and the vehicle
holds what it should: parameters that make its sensors' truth (offsets to 0.01 m/s^2, scales to 0.001), or its old ones.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from mpucal.mavlink.firmwares import ARDUPILOT, PX4
from mpucal.mavlink.link import Link
from mpucal.mavlink.parameters.names import find_slot
from mpucal.mavlink.stream_parameters import read_stream_parameters
from mpucal.mavlink.transports import open_transport
from mpucal.mavlink.url import parse_url
from mpucal.mavlink.vehicle_source import choose_vehicle
from mpucal.simulated.vehicle import SimulatedVehicle, VehicleOptions

from .vehicle_truth import Off, needed, off

ROOT = Path(__file__).parents[2]
MPUCAL = Path(sys.executable).parent / "mpucal"
AT_ONCE = 2
FIRST_PORT = 24550
# of what mpucal said, where it is not as expected
LINES = 12
# a session takes little more than a minute, of a vehicle whose time stands still where the machine is busy
PATIENCE_S = 600
OFFSET_MPS2, SCALE = 0.01, 0.001
KEY, OTHER_KEY = bytes(range(32)), bytes(range(1, 33))


@dataclass(frozen=True)
class Trial:
    """What is tried: the vehicle's port and words, further words of the tool and of mpucal, and what is expected.

    Attributes
    ----------
    tool, session : KEY and OTHER_KEY are files. code : of mpucal. system : whose parameters are looked at, if any's.
    says : among what mpucal says on stderr.
    """

    name: str
    port: str
    words: tuple[str, ...] = ()
    tool: tuple[str, ...] = ()
    session: tuple[str, ...] = ()
    code: int = 0
    system: int | None = 1
    says: str = ""


UDP = "udp:127.0.0.1:{}"
FRESH = ("firmware=px4", "CAL_ACC0_ID=0", "CAL_ACC1_ID=0")
TRIALS = (
    Trial("ardupilot udp", UDP),
    Trial("px4 udp", UDP, ("firmware=px4",)),
    Trial("ardupilot tcp, three IMUs", "tcp:127.0.0.1:0", ("imus=3",)),
    Trial("px4 tcp, board turned by 45 deg", "tcp:127.0.0.1:0", ("firmware=px4", "rotation=1")),
    Trial("ardupilot pty, no HIGHRES_IMU", "pty", ("highres=no",)),
    Trial("px4 pty", "pty", ("firmware=px4",)),
    Trial("ardupilot udp, one packet in five lost", UDP, ("fault=loss",), says="loses"),
    Trial("ardupilot udp, reordered and repeated", UDP, ("fault=reorder", "fault=duplicate")),
    Trial("ardupilot udp, a stranger forges", UDP, (), ("--stranger",)),
    Trial("ardupilot udp, a second station", UDP, ("highres=no", "fault=second_station@25"), says="--streamrate=-1"),
    Trial("ardupilot udp, armed meanwhile", UDP, ("fault=arm@40",), code=6, says="is armed"),
    Trial("ardupilot udp, reboots before it is turned", UDP, ("fault=reboot@8",), says="is back"),
    Trial("ardupilot udp, reboots while it is turned", UDP, ("fault=reboot@45",), says="is back"),
    Trial("ardupilot pty, another device after a reboot", "pty:{folder}/usb", ("fault=reboot@45",), says="is back"),
    Trial("px4 udp, silent before it is turned", UDP, ("firmware=px4", "fault=silence@8"), (), (), 3, None, "nothing"),
    Trial("ardupilot udp, a parameter refused", UDP, ("refuse=INS_ACC2SCAL_Y",), code=6, says="are back"),
    Trial("px4 udp, a parameter refused", UDP, ("firmware=px4", "refuse=CAL_ACC1_YSCALE"), code=6, says="are back"),
    Trial("px4 udp, fresh from the factory", UDP, FRESH, code=6, says="nothing was measured"),
    Trial("px4 udp, fresh and prepared", UDP, FRESH, (), ("--prepare",), says="names its accelerometers now"),
    Trial("two vehicles", UDP, (), ("--vehicles", "2"), (), 2, None, "choose one with --system N"),
    Trial("the second of two vehicles", UDP, (), ("--vehicles", "2"), ("--system", "2"), 0, 2),
    Trial("a vehicle that signs, no key", UDP, (), ("--signing-key", "KEY"), (), 3, None, "--signing-key"),
    Trial(
        "a vehicle that signs, wrong key", UDP, (), ("--signing-key", "KEY"), ("--signing-key", "OTHER_KEY"), 3, None
    ),
    Trial("a vehicle that signs, its key", UDP, (), ("--signing-key", "KEY"), ("--signing-key", "KEY"), 0, None),
    Trial("no vehicle", UDP, ("fault=silence@0",), code=3, system=None, says="no autopilot's heartbeat"),
)


def main() -> int:
    """Run the trials asked for; 1 where one ended otherwise than expected."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("words", nargs="*")
    arguments = parser.parse_args()
    chosen = [(n, trial) for n, trial in enumerate(TRIALS) if all(word in trial.name for word in arguments.words)]
    with tempfile.TemporaryDirectory() as place, ThreadPoolExecutor(AT_ONCE) as pool:
        folders = [Path(place) / str(n) for n, _ in chosen]
        ports = [trial.port.format(FIRST_PORT + n, folder=Path(place) / str(n)) for n, trial in chosen]
        results = list(pool.map(run, [trial for _, trial in chosen], ports, folders))
    print(f"{sum(results)} of {len(results)} ended as expected")
    return 0 if all(results) else 1


def run(trial: Trial, port: str, folder: Path) -> bool:
    """Run one, print what came of it; whether that was expected."""
    folder.mkdir()
    keys = {"KEY": KEY, "OTHER_KEY": OTHER_KEY}
    for name, key in keys.items():
        (folder / name).write_bytes(key)
    tool, words = ([str(folder / w) if w in keys else w for w in part] for part in (trial.tool, trial.session))
    with vehicle(port, trial, tool) as url:
        old = held(trial, url)
        done = mpucal("session", "--mavlink", url, "--yes", "-o", str(folder / "session"), *words)
        new = held(trial, url)
    lines = [f"exit {done.returncode}: {last_line(done)}"]
    good = done.returncode == trial.code and trial.says in done.stderr
    if trial.system is not None and trial.code == 0:
        far = apart(trial, new)
        lines += [
            f"IMU {n}: {offset:.4f} m/s^2 and {scale:.5f} off the truth" for n, (offset, scale) in enumerate(far, 1)
        ]
        good &= all(offset < OFFSET_MPS2 and scale < SCALE for offset, scale in far)
    elif trial.system is not None:
        lines.append("it holds its old parameters" if new == old else "IT HOLDS OTHER PARAMETERS THAN BEFORE")
        good &= new == old
    if not good:
        lines += done.stderr.splitlines()[-LINES:]
    print("\n  ".join([f"{'as expected' if good else 'NOT AS EXPECTED'}: {trial.name}", *lines]), flush=True)
    return good


@contextmanager
def vehicle(port: str, trial: Trial, tool: list[str]) -> Iterator[str]:
    """The vehicle, and the URL at which it is."""
    command = [sys.executable, "-m", "tools.lab", "sim_vehicle", port, *trial.words, *tool]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
        try:
            yield process.stdout.readline().strip() if process.stdout else ""
        finally:
            process.terminate()


def held(trial: Trial, url: str) -> dict[str, float]:
    """The parameters that shape its streams, as the vehicle tells them."""
    if trial.system is None:
        return {}
    with closing(open_transport(parse_url(url))) as transport:
        link = Link(transport, lambda _t_ns, _packet: None)
        link.lock(choose_vehicle(link.listen(), trial.system))
        firmware = link.vehicle.family
        return read_stream_parameters(link, firmware)


def apart(trial: Trial, parameters: Mapping[str, float]) -> list[Off]:
    """How far the parameters of each IMU are from what its sensor needs."""
    options = VehicleOptions.parse("sim:" + ",".join(trial.words) if trial.words else "sim")
    second = (trial.system or options.system) - options.system
    simulated = SimulatedVehicle(replace(options, seed=options.seed + second))
    firmware = PX4 if simulated.firmware.bytewise else ARDUPILOT
    truths = enumerate(simulated.imus.truths, start=1)
    return [off(find_slot(firmware, imu, parameters), parameters, needed(truth)) for imu, truth in truths]


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
    said = [line.strip() for line in (done.stderr if done.returncode else done.stdout).splitlines() if line.strip()]
    return (said or ["nothing was said"])[-1]
