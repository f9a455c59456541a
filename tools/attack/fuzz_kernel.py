"""The compiled modules under AddressSanitizer and UBSan: every function with odd arrays and numbers, in each build.

    python -m tools.attack fuzz_kernel --seconds 60
    python -m tools.attack fuzz_kernel --seconds 0 --first SEED     # one again

A function must refuse unsuitable arguments by an exception. An access out of bounds or an undefined operation ends the
process, and its seed is printed. Lengths are 0 to 70, around the filters' lanes of four. Arrays have other lengths,
shapes, types, strides and values than they should, one in three of them. Then the modules' own tests run once.
"""

import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from typing import Annotated, Any

import numpy as np

from . import sanitized
from .fuzz import TODAY

TESTS = ("kernel", "files/test_own_formats.py", "files/test_mcap.py", "chip/test_bit_flips.py")
REFUSED = (TypeError, ValueError, OverflowError, MemoryError)
ODD = (np.nan, np.inf, -np.inf, 5e-324, -0.0, 0.0, 1e308, -1e308, 1e-300, -1.0)
ODD_NUMBERS = (0, 1, -1, 2, 3, 7, 63, 1 << 31, 1 << 62, (1 << 63) - 1, 1 << 63, (1 << 64) - 1, 6148914691236517206, 0.5)
ODD_TYPES = ("f4", ">f8", "i8", "u1", "?", "c16", "O", "M8[ns]", "f2")
Rng = np.random.Generator


def shaped(array: Any, rng: Rng) -> Any:
    """Return the array in another length or shape."""
    longer = np.resize(array, max(0, array.size + int(rng.integers(-4, 5))))
    shapes = [array.ravel(), array.T, array[None], array[..., None], array[:0], np.zeros((0, 1 << 40))]
    return longer if rng.random() < 0.5 else shapes[rng.integers(6)]


def typed(array: Any, rng: Rng) -> Any:
    """Return the array as another type."""
    with np.errstate(all="ignore"):
        return array.astype(ODD_TYPES[rng.integers(len(ODD_TYPES))])


def strided(array: Any, rng: Rng) -> Any:
    """Return the same numbers elsewhere in memory: backwards, with gaps, by columns, not aligned, or read-only."""
    frozen = array.copy()
    frozen.flags.writeable = False
    ways = [
        array[::-1].copy()[::-1] if array.ndim else array,
        np.repeat(array, 2, axis=0)[::2] if array.ndim else array,
        np.asfortranarray(array),
        np.frombuffer(b"\0" + array.tobytes(), array.dtype, offset=1).reshape(array.shape),
        frozen,
    ]
    return ways[rng.integers(len(ways))]


def valued(array: Any, rng: Rng) -> Any:
    """Return the array with values that no sensor gives."""
    if array.dtype.kind != "f" or not array.size:
        return rng.integers(-3, 80, array.shape) if rng.random() < 0.7 else array.astype(int) + ((1 << 62) - 7)
    array = array.copy()
    array.flat[rng.integers(0, array.size, rng.integers(1, 4))] = ODD[rng.integers(len(ODD))]
    return array


ODDITIES = (shaped, shaped, typed, strided, valued)


def odd(value: Any, rng: Rng) -> Any:
    """Return the value, or in one of three cases an odd one in its place."""
    if rng.random() > 1 / 3:
        return value
    if isinstance(value, np.ndarray):
        return None if rng.random() < 0.05 else ODDITIES[rng.integers(len(ODDITIES))](value, rng)
    if isinstance(value, bytes):
        return bytes(rng.integers(0, 256, rng.integers(0, 80), np.uint8))
    if isinstance(value, list):
        return [int(each) for each in rng.integers(-1, 12, rng.integers(0, 9))]
    return ODD_NUMBERS[rng.integers(len(ODD_NUMBERS))] if isinstance(value, int | float) else value


def functions() -> dict[Callable[..., Any], Callable[[int, Rng], tuple[Any, ...]]]:
    """Return the functions, each with a function that makes valid arguments of n samples."""
    from mpucal.calibration.likelihood import USED  # noqa: PLC0415 - not before the modules are those of build/asan
    from mpucal.calibration.theta import Theta  # noqa: PLC0415
    from mpucal.chip import _flips  # noqa: PLC0415
    from mpucal.files import _packed, _text  # noqa: PLC0415
    from mpucal.kernel import _kernel  # noqa: PLC0415

    theta = Theta.start(np.eye(3), np.zeros(3), np.zeros(3), np.array([0.1, -0.2, 0.97]))
    constants = np.array([9.81, *[0.01] * 3, *[1e-3] * 3, 0.1, 0.2, 9.7, 100.0])
    of_hand = np.concatenate((constants, [3.0, 1.0, 2.0]))

    def some(n: int, rng: Rng, *columns: int) -> Any:
        return rng.normal(0.5, 1.0, (n, *columns))

    def maybe(n: int, rng: Rng, *columns: int) -> Any:
        return abs(some(n, rng, *columns)) if rng.random() < 0.7 else None

    def series(n: int, rng: Rng) -> tuple[Any, ...]:
        samples = (some(n, rng, 3), some(n, rng, 3), abs(some(n, rng)) * 0.01)
        return (*samples, maybe(n, rng), maybe(n, rng), maybe(n, rng))

    def hand(n: int, rng: Rng) -> tuple[Any, ...]:
        turning = [some(n, rng, 3), some(n, rng, 3)] if rng.random() < 0.7 else [None, None]
        return (*series(n, rng), *turning, maybe(n, rng), maybe(n, rng), maybe(n, rng), maybe(n, rng, 3))

    def ends(n: int, rng: Rng) -> Any:
        return np.sort(np.append(rng.integers(0, n + 1, rng.integers(0, 4)), n)) if rng.random() < 0.5 else None

    def runs(n: int, rng: Rng) -> Any:
        return np.sort(rng.integers(0, n + 1, (3, 2)), axis=1)

    def lines(n: int, rng: Rng) -> bytes:
        return b"".join(b"%.3f,%d, %g\n" % tuple(row) for row in some(n, rng, 3))

    exact, whole = theta.packed_exact, theta.packed
    return {
        _kernel.evaluate: lambda n, rng: (
            (exact, constants, int(rng.choice([0, *USED.values()])), *series(n, rng), ends(n, rng))
        ),
        _kernel.evaluate_hand: lambda n, rng: (whole, of_hand, bool(rng.integers(2)), *hand(n, rng), ends(n, rng)),
        _kernel.trace_hand: lambda n, rng: (whole, of_hand, *hand(n, rng)),
        _kernel.moments: lambda n, rng: (np.zeros(3), *series(n, rng)[:4]),
        _kernel.turn: lambda n, rng: (some(n, rng, 3), runs(n, rng), maybe(n, rng, 3)),
        _kernel.statistics: lambda n, rng: (some(n, rng, 3), runs(n, rng)),
        _kernel.moving_mean: lambda n, rng: (some(n, rng, 3), int(rng.integers(0, 80))),
        _kernel.moving_statistics: lambda n, rng: (some(n, rng, 3), int(rng.integers(0, 80))),
        _kernel.squared_differences: lambda n, rng: (some(n, rng, 3), int(rng.integers(0, 80)), np.array([1, 16])),
        _kernel.mean_rates: lambda n, rng: (some(n + 1, rng, 3), np.zeros(3), some(n, rng)),
        _kernel.noise_variance: lambda n, rng: (some(n, rng, 3), int(rng.integers(0, 80))),
        _kernel.spikes: lambda n, rng: (some(n, rng, 3), some(n, rng, 3)),
        _kernel.stuck_odds: lambda n, rng: (
            rng.integers(-(1 << 15), 1 << 15, (n, 3)).astype(np.int32),
            rng.random(n) < 0.1,
            np.sort(rng.integers(0, n + 1, 4)),
            0.1,
            0.98,
        ),
        _text.lines: lambda n, rng: (some(n, rng, int(rng.integers(0, 5))),),
        _text.numbers: lambda n, rng: (lines(n, rng), 3, [0, 2]),
        _packed.packed: lambda n, rng: (rng.integers(0, 1 << 63, n, np.uint64, endpoint=True),),
        _packed.unpacked: lambda n, rng: (bytes(rng.integers(0, 140, n, np.uint8)),),
        _packed.frames: lambda n, rng: (bytes(rng.integers(0, 128, 7 * n, np.uint8)), 7),
        _flips.until_jumps: lambda n, rng: (
            rng.integers(-(1 << 15), 1 << 15, (n, 7)).astype(np.int16),
            np.sort(rng.integers(2, n + 3, 4)),
            np.full(7, 8.0),
        ),
    }


def fuzz(first: int, seconds: float, last: int) -> int:
    """Run one seed after the other; each is written to the file `last` before it is run."""
    from mpucal.kernel import _kernel  # noqa: PLC0415 - as above

    table, until, seed, counts = functions(), time.monotonic() + seconds, first, Counter[str]()
    each = list(table.items())
    builds = (_kernel.instruction_set(), "portable")
    while True:
        os.pwrite(last, b"%d" % seed, 0)
        rng = np.random.default_rng(seed)
        function, make = each[rng.integers(len(each))]
        _kernel.use_instruction_set("best" if rng.random() < 0.7 else "portable")
        arguments = [odd(value, rng) for value in make(int(rng.integers(0, 71)), rng)]
        try:
            function(*arguments)
            counts[f"{function.__name__}"] += 1
        except REFUSED:
            counts[f"{function.__name__}, refused"] += 1
        seed += 1
        if time.monotonic() >= until:
            break
    for name, _ in table.items():
        done, refused = counts[name.__name__], counts[f"{name.__name__}, refused"]
        print(f"{name.__name__:<20}{done + refused:>9} calls, {refused} refused")
    print(f"{seed - first} calls with seeds from {first} on, in the builds {' and '.join(builds)}", flush=True)
    return 0


def main(
    *,
    seconds: float = 60.0,
    first: int = TODAY * 10**7,
    last: Annotated[int | None, "the descriptor of a file for the seed; without one it starts itself with one"] = None,
) -> int:
    """Build, fuzz and test; return 1 if something was found."""
    if last is not None:
        return fuzz(first, seconds, last)
    sanitized.build()
    environment = sanitized.environment()
    path = sanitized.BUILT / "last"
    with path.open("wb") as file:
        options = ["--seconds", seconds, "--first", first, "--last", file.fileno()]
        words = [sys.executable, "-W", "ignore", "-m", "tools.attack", "fuzz_kernel", *map(str, options)]
        done = subprocess.run(words, env=environment, cwd=sanitized.ROOT, check=False, pass_fds=[file.fileno()])
    if done.returncode:
        print(f"seed {path.read_text()} ended it with {done.returncode}")
        return 1
    if not seconds:
        return 0
    plugins = [f"-p{name}" for name in ("tools.attack.sanitized", "no:xdist", "no:cacheprovider")]
    words = [sys.executable, "-m", "pytest", "-q", *plugins, *(str(sanitized.ROOT / "tests" / name) for name in TESTS)]
    return subprocess.run(words, env=environment, check=False).returncode
