"""Run the installed mpucal against simulated vehicles on real ports, from a session to the parameters they hold then.

    python -m tools.lab vehicle_trials --jobs 2       # all of them in real time: about fifteen minutes
    python -m tools.lab vehicle_trials px4 tcp        # those with these words in their names

Each trial starts tools/lab/sim_vehicle.py, runs `mpucal session --mavlink URL --yes`, asks the vehicle itself for its
parameters before and after, and says what mpucal said last. It is as expected where the exit code is, and the vehicle
holds what it should: parameters that make its sensors' truth (offsets to 0.01 m/s^2, scales to 0.001), or its old ones.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from mpucal.mavlink.firmwares import ARDUPILOT, PX4
from mpucal.mavlink.link import Link
from mpucal.mavlink.parameters.names import find_slot
from mpucal.mavlink.stream_parameters import read_stream_parameters
from mpucal.mavlink.transports import open_transport
from mpucal.mavlink.url import parse_url
from mpucal.mavlink.vehicle_source import choose_vehicle
from mpucal.simulated.vehicle import SimulatedVehicle, VehicleOptions

from .judge import needed, off
from .runner import Program, option

ROOT = Path(__file__).parents[2]
MPUCAL = Path(sys.executable).parent / "mpucal"
FIRST_PORT = 24550
# of what mpucal said, where it is not as expected
LINES = 12
# a session takes little more than a minute, of a vehicle whose time stands still where the machine is busy
PATIENCE_S = 600
OFFSET_MPS2, SCALE = 0.01, 0.001
KEY, OTHER_KEY = bytes(range(32)), bytes(range(1, 33))


@dataclass(frozen=True)
class Trial:
    """A trial: the vehicle's port and words, further words of sim_vehicle and of mpucal, and what is expected.

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


SIGNS = ("--signing-key", "KEY")
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
    Trial("px4 udp, fresh and prepared", UDP, FRESH, (), ("--prepare",), says="assigns accelerometer ids now"),
    Trial("two vehicles", UDP, (), ("--vehicles", "2"), (), 2, None, "choose one with --system N"),
    Trial("the second of two vehicles", UDP, (), ("--vehicles", "2"), ("--system", "2"), 0, 2),
    Trial("a vehicle that signs, no key", UDP, (), SIGNS, (), 3, None, "--signing-key"),
    Trial("a vehicle that signs, wrong key", UDP, (), SIGNS, ("--signing-key", "OTHER_KEY"), 3, None),
    Trial("a vehicle that signs, its key", UDP, (), SIGNS, SIGNS, 0, None),
    Trial("no vehicle", UDP, ("fault=silence@0",), code=3, system=None, says="no autopilot's heartbeat"),
)


def tried(number: int) -> tuple[bool, str]:
    """Run a trial; return True if it ended as expected, and what came of it."""
    trial = TRIALS[number]
    keys = {"KEY": KEY, "OTHER_KEY": OTHER_KEY}
    with TemporaryDirectory() as place:
        folder = Path(place)
        for name, key in keys.items():
            (folder / name).write_bytes(key)
        tool, words = ([str(folder / w) if w in keys else w for w in part] for part in (trial.tool, trial.session))
        with vehicle(trial.port.format(FIRST_PORT + number, folder=folder), trial, tool) as url:
            old = held(trial, url)
            done = mpucal("session", "--mavlink", url, "--yes", "-o", str(folder / "session"), *words)
            new = held(trial, url)
    # of its result, or of why there is none
    said = (done.stderr if done.returncode else done.stdout).split("\n")
    lines = [
        f"exit {done.returncode}: {next((line.strip() for line in said[::-1] if line.strip()), 'nothing was said')}"
    ]
    good = done.returncode == trial.code and trial.says in done.stderr
    if trial.system is not None and trial.code == 0:
        for n, (offset, scale) in enumerate(apart(trial, new), 1):
            lines.append(f"IMU {n}: {offset:.4f} m/s^2 and {scale:.5f} off the truth")
            good &= offset < OFFSET_MPS2 and scale < SCALE
    elif trial.system is not None:
        lines.append("it holds its old parameters" if new == old else "IT HOLDS OTHER PARAMETERS THAN BEFORE")
        good &= new == old
    if not good:
        lines += done.stderr.splitlines()[-LINES:]
    return good, "\n  ".join([f"{'as expected' if good else 'NOT AS EXPECTED'}: {trial.name}", *lines])


@contextmanager
def vehicle(port: str, trial: Trial, tool: list[str]) -> Iterator[str]:
    """Run the vehicle meanwhile, and yield the URL at which it is."""
    command = [sys.executable, "-m", "tools.lab", "sim_vehicle", port, *trial.words, *tool]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
        try:
            yield process.stdout.readline().strip() if process.stdout else ""
        finally:
            process.terminate()


def held(trial: Trial, url: str) -> dict[str, float]:
    """Return the parameters that shape its streams, as the vehicle tells them."""
    if trial.system is None:
        return {}
    with closing(open_transport(parse_url(url))) as transport:
        link = Link(transport, lambda _t_ns, _packet: None)
        link.lock(choose_vehicle(link.listen(), trial.system))
        return read_stream_parameters(link, link.vehicle.family)


def apart(trial: Trial, parameters: Mapping[str, float]) -> list[tuple[float, float]]:
    """Return how far the parameters of each IMU are from what its sensor needs."""
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


def report(done: list[tuple[bool, str]], _asked: object) -> int:
    """Print how many ended as expected; return 1 where one did not."""
    good = sum(each for each, _ in done)
    print(f"{good} of {len(done)} ended as expected")
    return int(good < len(done))


main = Program(
    __doc__,
    tried,
    items=lambda asked: [n for n, trial in enumerate(TRIALS) if all(word in trial.name for word in asked.words)],
    report=report,
    options=(option("words", nargs="*"),),
    line=lambda row: row[1],
)
