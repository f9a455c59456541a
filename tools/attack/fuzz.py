"""Fuzz readers and decoders with mutated bytes: they may raise only mpucal's own errors, within a second or two.

    python -m tools.attack fuzz --seconds 60 [TARGET ...]
    python -m tools.attack fuzz --guided --seconds 60 [TARGET ...]      # by coverage; needs atheris

Each target of fuzz_targets.py has a corpus of the fixtures, of files that are made here, or of one in a dialect
of lab/dialects.py, as rosbags, pyulog, pandas and others write it, and gets bytes of it that are damaged as in
lab/campaign_recordings.py, cut, joined, or with one piece in the place of another's. A line counts its executions.
An unexpected exception is printed with the seed that repeats it (--first SEED --seconds 0 TARGET).

Guided, libFuzzer keeps what reaches new branches of mpucal in build/fuzz/TARGET, goes on from there the next time, and
says how many branches were reached. Half of the mutants are those of above. What was wrong is kept in
build/fuzz/TARGET.wrong until it is mended.
"""

import hashlib
import io
import os
import re
import signal
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FrameType
from typing import Annotated

import numpy as np

ROOT = Path(__file__).parents[2]
KEPT = ROOT / "build" / "fuzz"
# seeds and what is drawn change by the day
TODAY = time.time_ns() // 86_400_000_000_000
LONGEST_S, LARGEST_MB = 20, 4096
MISSING = "fuzz.py: --guided needs atheris, which is not installed: pip install atheris (CPython 3.11 to 3.13)."
Run = Callable[[bytes], object]
Check = Callable[[bytes], str | None]


class TooLongError(BaseException):
    """Time limit of a reader exceeded; a BaseException, so that no reader catches it as an error of a library."""


def mutated(corpus: Sequence[bytes], seed: int) -> bytes:
    """Return a file of the corpus, damaged as the seed draws."""
    from ..lab.campaign_recordings import OF_BYTES  # noqa: PLC0415 - not before the package is instrumented

    rng = np.random.default_rng(seed)
    data = bytearray(corpus[int(rng.integers(len(corpus)))])
    if rng.random() < 0.2:
        data += corpus[int(rng.integers(len(corpus)))]
    for _ in range(rng.integers(1, 4)):
        if data:
            OF_BYTES[rng.integers(len(OF_BYTES))](data, rng)
    return bytes(data)


def checked(run: Run) -> Check:
    """Return a check of bytes: it returns the traceback of an unexpected exception, or None."""
    from mpucal.bridge.messages import MessageError  # noqa: PLC0415
    from mpucal.errors import MpucalError  # noqa: PLC0415 - as above
    from mpucal.result.blob import BlobError  # noqa: PLC0415

    def check(data: bytes) -> str | None:
        signal.setitimer(signal.ITIMER_VIRTUAL, LONGEST_S)
        try:
            run(data)
        except (MpucalError, BlobError, MessageError):
            pass
        except (Exception, TooLongError):
            return traceback.format_exc(limit=-4)
        return None

    return check


def blind(name: str, check: Check, corpus: Sequence[bytes], first: int, seconds: float) -> tuple[str, int]:
    """Run seed after seed; return a summary, and the number of unexpected exceptions."""
    until, seed, wrong = time.monotonic() + seconds, first, 0
    while True:
        if (trace := check(mutated(corpus, seed))) is not None:
            wrong += 1
            print(f"{name}, seed {seed}:\n{trace}", flush=True)
        seed += 1
        if time.monotonic() >= until:
            return f"{seed - first:>9} executions, seeds from {first} on", wrong


def by_coverage(name: str, check: Check, corpus: Sequence[bytes], first: int, seconds: float) -> tuple[str, int]:
    """Run libFuzzer in a process of its own, as it ends its process; return the same as `blind`."""
    folder = KEPT / re.sub(r"\W+", "_", name)
    wrong, log = folder.with_suffix(".wrong"), folder.with_suffix(".log")
    folder.mkdir(parents=True, exist_ok=True)
    for path in wrong.glob("*"):
        if check(path.read_bytes()) is None:
            path.unlink()
    for data in corpus:
        (folder / hashlib.sha1(data, usedforsecurity=False).hexdigest()).write_bytes(data)
    pid = os.fork()
    if not pid:
        _fuzz(name, check, folder, wrong, log, first, seconds)
    status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    count, branches = reached(log.read_text(errors="replace"))
    if status:
        print(f"{name}: ended with {status}; see {log}", flush=True)
    found = len(list(wrong.glob("*"))) + bool(status)
    return f"{count:>9} executions, {branches:>5} branches, seed {first}", found


def reached(said: str) -> list[str]:
    """Return the numbers of executions and of branches that libFuzzer says at its end."""
    return [
        (re.findall(pattern, said) or ["0"])[-1] for pattern in (r"number_of_executed_units: (\d+)", r" cov: (\d+)")
    ]


def _fuzz(name: str, check: Check, folder: Path, wrong: Path, log: Path, first: int, seconds: float) -> None:
    import atheris  # noqa: PLC0415 - only here

    seen: set[str] = set()

    def one(data: bytes) -> None:
        trace = check(data)
        where = "".join(re.findall(r"^  File.*", trace or "", re.M))
        if trace is None or where in seen:
            return
        seen.add(where)
        wrong.mkdir(exist_ok=True)
        path = wrong / hashlib.sha1(data, usedforsecurity=False).hexdigest()
        path.write_bytes(data)
        print(f"{name}, {path}:\n{trace}", flush=True)

    def mutate(data: bytes, most: int, seed: int) -> bytes:
        return mutated([data or b"\0"], seed)[:most] if seed % 2 else atheris.Mutate(data, most)

    os.dup2(os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 2)
    longest = max(path.stat().st_size for path in folder.iterdir())
    limits = {"max_total_time": max(round(seconds), 1), "timeout": 3 * LONGEST_S, "rss_limit_mb": LARGEST_MB}
    rest = {"max_len": 2 * longest, "len_control": 0, "seed": first % (1 << 31), "print_final_stats": 1}
    options = [f"-{key}={value}" for key, value in {**limits, **rest}.items()]
    atheris.Setup(["fuzz", *options, f"-artifact_prefix={wrong}.", str(folder)], one, custom_mutator=mutate)
    atheris.Fuzz()


def too_long(_signal: int, _frame: FrameType | None) -> None:
    """Raise TooLongError, as the handler of the timer's signal."""
    raise TooLongError(f"longer than {LONGEST_S} s of processor time")


def main(
    targets: Annotated[Sequence[str], "default: all"] = (),
    *,
    seconds: Annotated[float, "of each target"] = 60.0,
    budget: Annotated[float | None, "of all of them, in place of --seconds"] = None,
    first: int = TODAY * 10**7,
    guided: Annotated[bool, "by coverage"] = False,
) -> int:
    """Run the targets; return 1 after an unexpected exception."""
    if guided:
        try:
            import atheris  # noqa: PLC0415 - a person may do without
        except ImportError:
            sys.exit(MISSING)
        # code that the finder of an editable install loads cannot be instrumented: it is asked last
        sys.path.insert(0, str(ROOT))
        sys.meta_path.sort(key=lambda finder: not isinstance(finder, type))
        # instruments what is imported from here on, also by later imports of mpucal
        atheris.instrument_imports(include=["mpucal"]).__enter__()
    with redirect_stderr(io.StringIO() if guided else sys.stderr), TemporaryDirectory() as place:
        from . import fuzz_targets  # noqa: PLC0415 - see above

        of = fuzz_targets.targets(Path(place))
        signal.signal(signal.SIGVTALRM, too_long)
        bad = 0
        for name in targets or of:
            run, corpus = of[name]
            each_s = seconds if budget is None else budget / len(targets or of)
            did, wrong = (by_coverage if guided else blind)(name, checked(run), corpus, first, each_s)
            bad += wrong
            print(f"{name:<44}{did}: {wrong} wrong", flush=True)
    return int(bad > 0)
