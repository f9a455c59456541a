"""The processor time of a session, and of its replay, by what takes it: python -m tools.bench session_time.

Each runs in a process of its own, as `mpucal session` does, in the simulated world as fast as it goes. The time of a
part is that of its functions without what they call of another part. The median of several runs counts.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median
from typing import Annotated

from tools.lab.table import plain_table, show

from .shares import IMPORTS, PARTS, REST, WHOLE


def measure(folder: Path, *words: str) -> dict[str, float]:
    """Return the shares of a command in a process of its own."""
    into = folder / "shares.json"
    code = "import sys; from tools.bench.shares import run; run(*sys.argv[1:])"
    subprocess.run([sys.executable, "-c", code, into, *words], check=True, capture_output=True)
    return dict(json.loads(into.read_text()))


def main(*, runs: int = 5, seed: Annotated[int, "of the simulated sensor and hand"] = 1) -> None:
    """Measure and print."""
    rows: dict[str, list[dict[str, float]]] = {"session": [], "replay": []}
    for _ in range(runs):
        with tempfile.TemporaryDirectory() as named:
            folder = Path(named)
            source = ("--bus", "sim", "--seed", f"{seed}")
            rows["session"].append(measure(folder, "session", *source, "--yes", "-o", f"{folder / 'board'}"))
            capture = ("--replay", f"{folder / 'board' / 'capture.mcap'}")
            rows["replay"].append(measure(folder, "session", *capture, "--yes", "-o", f"{folder / 'again'}"))
    parts = [IMPORTS, *PARTS, REST, WHOLE]
    table = [
        {"part": part, **{f"{name} ms": 1e3 * median(each.get(part, 0.0) for each in rows[name]) for name in rows}}
        for part in parts
    ]
    show(plain_table(table, "processor time"))
