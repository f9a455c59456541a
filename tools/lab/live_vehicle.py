"""A session with a simulator of an autopilot's own, turned by the simulated hand, and how near its result is to truth.

    arducopter --model JSON:127.0.0.1 --serial0 udpclient:127.0.0.1:14550 &          # ArduPilot's own program
    python -m tools.lab live_vehicle --mavlink udp:127.0.0.1:14550 --parameters tcp:127.0.0.1:5762 -- --yes

    PX4_SIM_MODEL=none_iris px4 &                                                     # PX4's own, again after a reboot
    python -m tools.lab live_vehicle --firmware PX4 --port 4560 --mavlink udp:127.0.0.1:14550 \
        --parameters udp:127.0.0.1:14540 -- --yes

The hand does what the session's prompts say; what the sensors measure there goes to the simulator: ArduPilot's through
its JSON interface (libraries/SITL/examples/JSON), PX4's as HIL_SENSOR. The errors of ArduPilot's sensors are its
SIM_ACCn_BIAS and SIM_ACCn_SCAL; those of PX4's are drawn here. They are what the session is to find. The vehicle takes
its level before. Words after `--` go to `mpucal session`; with --own, the autopilot calibrates itself in
the same hand instead. With --killed-at 6, the session is killed at its sixth prompt and resumed. With --folder, what
the session leaves is kept, and beside it `truth.json`: D and b_a of each IMU.
The line at the end: exit code, verdict, how far the vehicle's parameters were from the truth at worst, and of each IMU
how far they are now (offset [m/s^2], scale) and the rms over D and b_a of (estimate - truth) / standard uncertainty;
the time that was measured [s], and how far the attitude is off that level once the vehicle has been rebooted [deg].
"""

import json
import math
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import closing, suppress
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from mpucal.data import Vector
from mpucal.errors import NoAnswer
from mpucal.mavlink.firmwares import ARDUPILOT, PX4
from mpucal.mavlink.link import Link
from mpucal.mavlink.parameters.client import read_parameters, read_stream_parameters
from mpucal.mavlink.parameters.mounting import mounting
from mpucal.mavlink.parameters.slots import Correction, find_slot
from mpucal.mavlink.transports import Transport, open_transport
from mpucal.mavlink.url import parse_url
from mpucal.simulated.disturbance import ARMS
from mpucal.simulated.hands import HANDS

from . import own_calibration
from .bodies import SITL_ERRORS, Body, HilBody, JsonBody
from .judge import off, rms, z_of

OWN_SYSTEM = 255
PATIENCE_S = 30
SAID = ("prompt", "note", "decision", "caution", "error")

BODIES: dict[str, type[Body]] = {ARDUPILOT: JsonBody, PX4: HilBody}


def held(url: str) -> dict[str, float]:
    """Ask the vehicle at another of its ports for the parameters that it holds now, by name."""
    with closing(_locked(url)) as link:
        return read_parameters(link, SITL_ERRORS if link.vehicle.family == ARDUPILOT else ()) | read_stream_parameters(
            link
        )


def far(firmware: str, held: Mapping[str, float], needs: Mapping[int, Correction]) -> list[str]:
    """Return how far the parameters of each IMU are from the truth at worst: offset [m/s^2] and scale."""
    return ["{:.5f} {:.6f}".format(*off(find_slot(firmware, imu, held), held, true)) for imu, true in needs.items()]


def truth(firmware: str, held: Mapping[str, float], imu: int, true: Correction, skew: Vector) -> dict[str, Any] | None:
    """Return D and b_a of the stream of IMU `imu`, counted from 1, while these parameters are held; None: unknown."""
    where = find_slot(firmware, imu, held)
    R, own = (mounting(firmware, where, held), where.correction(held)) if where else (None, None)
    if where is None or R is None or own is None:
        return None
    own = where.effective(own)
    D, b_a = R @ np.diag(own.scale / true.scale) @ skew @ R.T, R @ (own.scale * (true.offset - own.offset))
    return {"D": D.tolist(), "b_a": b_a.tolist()}


def _locked(url: str) -> Link:
    link = Link(_opened(url), lambda _t_ns, _packet: None, own_system=OWN_SYSTEM)
    link.lock(link.listen()[0])
    return link


def _opened(url: str) -> Transport:
    """Open a transport; a SITL opens its ports some seconds after it began to step.

    Raises
    ------
    NoAnswer : it does not.
    """
    for _ in range(PATIENCE_S):
        with suppress(NoAnswer):
            return open_transport(parse_url(url))
        time.sleep(1.0)
    return open_transport(parse_url(url))


def main(
    words: Annotated[Sequence[str], "for mpucal session"] = (),
    *,
    mavlink: Annotated[str, "URL of the session"],
    parameters: Annotated[str, "another URL of the same simulator"],
    firmware: Annotated[str, BODIES] = ARDUPILOT,
    port: Annotated[int, "where the simulator looks for its sensors"] = 9002,
    hand: Annotated[str, HANDS] = "guided",
    arm: Annotated[str, ARMS] = "steady",
    seed: Annotated[int, "of the hand"] = 0,
    cross_axis: Annotated[float, "standard deviation, of the accelerometers"] = 0.0,
    own: Annotated[bool, "the autopilot calibrates itself"] = False,
    killed_at: Annotated[int, "kill the session at this prompt, counted from 1, and resume it"] = 0,
    folder: Annotated[Path | None, "keep what the session leaves"] = None,
) -> int:
    """Run one session, and print its line; return its exit code."""
    body, document = BODIES[firmware](port, hand, arm, seed, cross_axis), None
    before = held(parameters)
    needs = body.needs(before)
    first = find_slot(firmware, 1, before)
    if first is not None and (R_b := mounting(firmware, first, before)) is not None:
        body.mounting = R_b
    with closing(_locked(mavlink)) as link:
        if own:
            calibrate = own_calibration.calibrate_px4 if firmware == PX4 else own_calibration.calibrate
            done, took_s, level = calibrate(link, body)
            code = int(not done)
        else:
            level = own_calibration.set_level(link, body)
    if not own:
        levelled = held(parameters)
        truths = {imu: truth(firmware, levelled, imu, true, body.skew) for imu, true in needs.items()}
        with tempfile.TemporaryDirectory() as temporary:
            kept = folder or Path(temporary) / "session"
            code, document = session(body, ["--mavlink", mavlink, *words], killed_at, kept)
            if kept.is_dir():
                (kept / "truth.json").write_text(json.dumps(truths))
        took_s = document["fit"]["seconds"] if document else math.nan
    with closing(_locked(mavlink)) as link:
        angle = own_calibration.attitude_error_deg(link, body, level)
    now = held(parameters)
    found = {int(one["autopilot"]["imu"]): one for one in ([document, *document.get("others", [])] if document else [])}
    ends = []
    for imu, text in zip(needs, far(firmware, now, needs), strict=True):
        true = None if own else truths[imu]
        z = z_of(found[imu], true) if true and "accelerometer" in found.get(imu, {}) else ()
        ends.append(f"{text} z {rms(z):.2f}")
    verdict = document["quality"]["verdict"] if document else "none"
    end = f"took {took_s:.0f} s, attitude off {angle:.2f} deg"
    print(f"exit {code} {verdict}: was {max(far(firmware, before, needs))}, is {', '.join(ends)}, {end}")
    return code


def session(body: Body, words: list[str], killed_at: int, folder: Path) -> tuple[int, dict[str, Any] | None]:
    """Run `mpucal session`, and resume it if it was killed; return its exit code and its result."""
    code = _guided(body, [*words, "-o", str(folder)], killed_at)
    if code == -signal.SIGKILL:
        code = _guided(body, ["--resume", str(folder)])
    file = folder / "calibration.json"
    return code, json.loads(file.read_text()) if file.exists() else None


def _guided(body: Body, words: list[str], killed_at: int = 0) -> int:
    """Run `mpucal session`, pass its prompts to the hand, and print its output; return its exit code."""
    command, prompts = [sys.executable, "-m", "mpucal", "session", "--json-events", *words], 0
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True) as process:
        for text in process.stderr or ():
            event: dict[str, Any] = json.loads(text) if text.startswith("{") else {"event": "error", "text": text}
            if event["event"] == "prompt":
                body.hear(event["kind"], event["down"])
                prompts += 1
                if prompts == killed_at:
                    process.kill()
            said = [str(event[key]).strip() for key in ("text", "why", "what", "do") if event.get(key)]
            if said and event["event"] in SAID:
                print(f"{event['event']}: {' '.join(said)}", file=sys.stderr)
    return process.returncode
