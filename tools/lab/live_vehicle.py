"""A session with a running ArduPilot SITL, turned by the simulated hand, and how near its result comes to the truth.

    arducopter --model JSON:127.0.0.1 --serial0 udpclient:127.0.0.1:14550 &          # ArduPilot's own program
    python -m tools.lab live_vehicle --mavlink udp:127.0.0.1:14550 --parameters tcp:127.0.0.1:5762 -- --yes

The hand does what the session's prompts say; where it brings the vehicle goes to the SITL through its JSON interface
(ArduPilot's libraries/SITL/examples/JSON). What the SITL makes of it, SIM_ACCn_BIAS and SIM_ACCn_SCAL, is what the
session is to find. The vehicle takes its level before. Words after `--` go to `mpucal session`; with --own, ArduPilot
calibrates itself in the same hand instead. With --killed-at 6, the session is killed at its sixth prompt and resumed.
With --folder, what the session leaves is kept, and beside it `truth.json`: D and b_a of each IMU.
The line at the end: exit code, verdict, how far the vehicle's parameters were from the truth at worst, and of each IMU
how far they are now (offset [m/s^2], scale) and the rms over D and b_a of (estimate - truth) / standard uncertainty;
the time that was measured [s], and how far the attitude is off that level once the vehicle has been rebooted [deg].
"""

from __future__ import annotations

import json
import math
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import closing, suppress
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from mpucal.data import STANDARD_GRAVITY_MPS2, Vector
from mpucal.errors import NoAnswer
from mpucal.mavlink.firmwares import ARDUPILOT
from mpucal.mavlink.link import Link
from mpucal.mavlink.parameters.client import read_parameters, read_stream_parameters
from mpucal.mavlink.parameters.mounting import mounting
from mpucal.mavlink.parameters.slots import AXES, Correction, ardupilot_slot
from mpucal.mavlink.texts import ReceivedPrompt
from mpucal.mavlink.transport import Transport
from mpucal.mavlink.transports import open_transport
from mpucal.mavlink.url import parse_url
from mpucal.simulated.disturbance import ARMS
from mpucal.simulated.hands import HANDS
from mpucal.simulated.motion import Motion
from mpucal.simulated.rotation import up_in_board
from mpucal.simulated.vehicle.imus import FROM_HAND, to_hand_axes

from . import own_calibration
from .judge import off, rms, z_of

# header of a message of the SITL for each step: magic number, steps a second, number of the step
HEAD, MAGIC = struct.Struct("<HHI"), (18458, 29569)
BLOCK = 20
TURNED_RAD_S = 0.1
OWN_SYSTEM = 255
IMUS = 3
PATIENCE_S = 30
SAID = ("prompt", "note", "decision", "caution", "error")
KINDS_OF_ERROR = ("BIAS", "SCAL")


class Body:
    """Body of the vehicle in the hand: answers each step of the SITL with the measurements of its sensors.

    Parameters
    ----------
    port : of UDP, where the SITL sends its steps. hand, arm : its kind, and how it is held.
    seed : of the hand and of the skew.
    cross_axis : standard deviation of the accelerometers' cross-axis sensitivities.

    Attributes
    ----------
    t_s : time of the motion. up : (3,) unit vector in the vehicle's axes. skew : (3, 3) of the accelerometers.
    """

    def __init__(self, port: int, hand: str, arm: str, seed: int, cross_axis: float) -> None:
        of_hand, of_motion, of_skew = np.random.default_rng(seed).spawn(3)
        self.skew = np.where(np.eye(3, dtype=bool), 1.0, of_skew.normal(0.0, cross_axis, (3, 3)))
        self._motion = Motion(HANDS[hand](of_hand), of_motion, STANDARD_GRAVITY_MPS2, disturbance=ARMS[arm])
        self._lock = threading.Lock()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", port))
        self.t_s = self._booted_s = self._moved_s = 0.0
        self.up = np.array([0.0, 0.0, -1.0])
        self._ahead: deque[tuple[float, dict[str, Any]]] = deque()
        # R_b, from the axes of the sensors, in which the SITL's body is, to those of the vehicle
        self.mounting = np.eye(3)
        threading.Thread(target=self._serve, daemon=True).start()

    def hear(self, kind: str, down: tuple[float, float, float] | None) -> None:
        """Hear a prompt, whose `down` is in the vehicle's axes."""
        with self._lock:
            self._motion.hear(ReceivedPrompt(kind, None if down is None else to_hand_axes(down)), self.t_s)

    @property
    def still_s(self) -> float:
        """Time for which it has not been turned."""
        return self.t_s - self._moved_s

    def _serve(self) -> None:
        answer, last = b"", -1
        while True:
            data, sitl = self._socket.recvfrom(1024)
            magic, rate_hz, count = HEAD.unpack_from(data)
            if magic not in MAGIC:
                continue
            # a repeated request gets the same answer
            if count != last or not answer:
                # the clock of a SITL starts with the program
                self._booted_s = self.t_s if count < last else self._booted_s
                answer = self._next(rate_hz)
            last = count
            self._socket.sendto(answer, sitl)

    def _next(self, rate_hz: int) -> bytes:
        if not self._ahead:
            self._ahead.extend(self._steps(rate_hz))
        self.t_s, step = self._ahead.popleft()
        step["timestamp"] = self.t_s - self._booted_s
        # its parser wants no space after a colon
        return f"\n{json.dumps(step, separators=(',', ':'))}\n".encode()

    def _steps(self, rate_hz: int) -> Iterator[tuple[float, dict[str, Any]]]:
        with self._lock:
            edges = self.t_s + np.arange(BLOCK + 1) / rate_hz
            force, rate = (means @ FROM_HAND @ self.mounting for means in self._motion.means(edges))
            attitude = self._motion.attitude(float(edges[-1]))
        self.up = up_in_board(attitude) @ FROM_HAND
        if np.abs(rate).max() > TURNED_RAD_S:
            self._moved_s = float(edges[-1])
        w, x, y, z = attitude.tolist()
        at = {"position": [0, 0, 0], "velocity": [0, 0, 0], "quaternion": [w, x, -y, -z]}
        for t_s, felt, turn in zip(edges[1:].tolist(), (force @ self.skew.T).tolist(), rate.tolist(), strict=True):
            yield t_s, {"imu": {"gyro": turn, "accel_body": felt}, **at}


def held(url: str) -> dict[str, float]:
    """Ask the vehicle at another of its ports for the parameters that it holds now, by name."""
    names = [f"SIM_ACC{imu}_{kind}_{a}" for imu in range(1, IMUS + 1) for kind in KINDS_OF_ERROR for a in AXES]
    with closing(_locked(url)) as link:
        return read_parameters(link, ["SIM_IMU_COUNT", *names]) | read_stream_parameters(link)


def needed(held: Mapping[str, float], imu: int) -> Correction:
    """Return the parameters that IMU `imu`, counted from 1, needs."""
    bias, scale = (np.array([held[f"SIM_ACC{imu}_{kind}_{a}"] for a in AXES]) for kind in KINDS_OF_ERROR)
    # the vehicle takes a scale of 0 as 1
    return Correction(bias, np.where(scale == 0, 1.0, scale))


def imus(held: Mapping[str, float]) -> range:
    """Return the numbers of the IMUs, from 1."""
    return range(1, round(held["SIM_IMU_COUNT"]) + 1)


def far(held: Mapping[str, float]) -> list[str]:
    """Return how far the parameters of each IMU are from the truth at worst: offset [m/s^2] and scale."""
    return ["{:.5f} {:.6f}".format(*off(ardupilot_slot(imu), held, needed(held, imu))) for imu in imus(held)]


def truth(held: Mapping[str, float], imu: int, skew: Vector) -> dict[str, Any] | None:
    """Return D and b_a of the stream of IMU `imu`, counted from 1, while these parameters are held; None: unknown."""
    where, true = ardupilot_slot(imu), needed(held, imu)
    R, own = mounting(ARDUPILOT, where, held), where.correction(held)
    if R is None or own is None:
        return None
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
    words: Annotated[list[str], "for mpucal session"] = (),
    *,
    mavlink: Annotated[str, "URL of the session"],
    parameters: Annotated[str, "another URL of the same SITL"],
    port: Annotated[int, "where the SITL looks for its JSON model"] = 9002,
    hand: Annotated[str, HANDS] = "guided",
    arm: Annotated[str, ARMS] = "steady",
    seed: Annotated[int, "of the hand"] = 0,
    cross_axis: Annotated[float, "standard deviation, of the accelerometers"] = 0.0,
    own: Annotated[bool, "ArduPilot calibrates itself"] = False,
    killed_at: Annotated[int, "kill the session at this prompt, counted from 1, and resume it"] = 0,
    folder: Annotated[Path | None, "keep what the session leaves"] = None,
) -> int:
    """Run one session, and print its line; return its exit code."""
    body, document = Body(port, hand, arm, seed, cross_axis), None
    before = held(parameters)
    if (R_b := mounting(ARDUPILOT, ardupilot_slot(1), before)) is not None:
        body.mounting = R_b
    with closing(_locked(mavlink)) as link:
        if own:
            done, took_s, level = own_calibration.calibrate(link, body)
            code = int(not done)
        else:
            level = own_calibration.set_level(link, body)
    if not own:
        with tempfile.TemporaryDirectory() as temporary:
            kept = folder or Path(temporary) / "session"
            code, document = session(body, ["--mavlink", mavlink, *words], killed_at, kept)
            truths = {imu: truth(before, imu, body.skew) for imu in imus(before)}
            (kept / "truth.json").write_text(json.dumps(truths))
        took_s = document["fit"]["seconds"] if document else math.nan
    with closing(_locked(mavlink)) as link:
        angle = own_calibration.attitude_error_deg(link, body, level)
    now = held(parameters)
    found = {int(one["autopilot"]["imu"]): one for one in ([document, *document.get("others", [])] if document else [])}
    ends = []
    for imu, text in zip(imus(now), far(now), strict=True):
        true = truth(before, imu, body.skew)
        z = z_of(found[imu], true) if true and "accelerometer" in found.get(imu, {}) else ()
        ends.append(f"{text} z {rms(z):.2f}")
    verdict = document["quality"]["verdict"] if document else "none"
    end = f"took {took_s:.0f} s, attitude off {angle:.2f} deg"
    print(f"exit {code} {verdict}: was {max(far(before))}, is {', '.join(ends)}, {end}")
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
