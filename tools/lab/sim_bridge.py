"""A simulated chip behind an emulated bridge on a pseudo-terminal, for trying `mpucal session --serial` without one.

    python -m tools.lab sim_bridge hand=random,chip=mpu6500      # says which device

It prints the device on its first line, then runs until it is stopped. The text is that of `--bus sim:KEY=VALUE,...`;
no prompt reaches the hand. It takes a real-time priority if it may, as a microcontroller is never busy. Bytes for which
the terminal has no room are lost.
"""

import os
import time
from contextlib import suppress

from mpucal.simulated.chip import open_simulated

from .bridge import EmulatedBridge
from .sim_vehicle import CHUNK, STEP_S, PtyPort


def main(text: str = "hand=random") -> None:
    """Run the bridge."""
    with suppress(OSError, AttributeError):
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(2))
    port, bridge = PtyPort(), EmulatedBridge(open_simulated(f"sim:pace=real,{text}"), time.monotonic_ns)
    print(port.name, flush=True)
    with suppress(KeyboardInterrupt):
        while True:
            time.sleep(STEP_S)
            bridge.receive(port.recv(CHUNK))
            port.write(bridge.work())
