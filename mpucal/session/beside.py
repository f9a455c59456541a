"""Process beside a session: a module of mpucal that reads its stdin and answers on its stdout; it has one thread."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import subprocess

# NumPy's libraries read these as they are loaded. Matrices are small here: a second thread would wait for the first,
# and take its core from the loop that reads the sensor.
ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def start_beside(module: str) -> subprocess.Popen[bytes]:
    """Start the process; it ends with this program, however that ends, because its stdin is closed then.

    Parameters
    ----------
    module : its name, for `python -m`.
    """
    import subprocess  # noqa: PLC0415 - a tenth of the start of a command that starts no process

    return subprocess.Popen(
        [sys.executable, "-P", "-m", module],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        # The process imports from the same places as this program.
        env={**os.environ, **ONE_THREAD, "PYTHONPATH": os.pathsep.join(sys.path)},
        # Ctrl-C reaches the session alone, which ends this process.
        process_group=0,
    )


def end_beside(process: subprocess.Popen[bytes]) -> None:
    """Kill the process, and close its pipes."""
    process.kill()
    process.wait()
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with suppress(OSError):
                pipe.close()


def describe_end(code: int) -> str:
    """Describe how a process ended, by its exit code: after `the process ...`."""
    return f"was killed by signal {-code}" if code < 0 else f"ended with exit code {code}"
