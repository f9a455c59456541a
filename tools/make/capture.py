"""Turn a recording of others into a register capture, as if mpucal's driver had made it.

    python -m tools.make capture RECORDING.npz -o capture.mcap
    mpucal session --replay capture.mcap

The recording's int16 counts lie in a simulated chip, which fills its FIFO with them at the recording's rate; a session
runs on that chip to the recording's end, and what crosses the bus becomes the capture. Counts are taken as they are
from `acc_raw` and `gyr_raw` (with `acc_scale` in m/s^2 and `gyr_scale` in rad/s a count); a recording without them is
rounded to the counts of the smallest range that holds it. The chip has taken a few samples before its FIFO is on: they
are lost, as they would be on a board. The temperature reads 25 C throughout.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mpucal.chip import registers as reg
from mpucal.chip.config import Config
from mpucal.cli.running import running
from mpucal.data import STANDARD_GRAVITY_MPS2, Recording, Vector
from mpucal.errors import Abandoned, MpucalError, OutputError, RecordingError
from mpucal.files import load
from mpucal.files.npz import load_npz
from mpucal.session.plan import Plan
from mpucal.simulated.chip import open_recorded
from mpucal.sources.chip import OpenedChip
from mpucal.terminal.console import console

# a count of the recording is one of the chip's where they differ by less than this
SAME_SCALE = 0.01
# the nearest rate that the chip has may differ so much: its clock then counts as fast or slow
FARTHEST_RATE = 0.055
FULL_SCALE_COUNT = 32767


@dataclass(frozen=True)
class Counts:
    """What one of the chip's two sensors delivers: (n, 3) int16 values, and the code of their full scale."""

    counts: Vector
    code: int


def main() -> int:
    """Make the capture; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", metavar="RECORDING.npz", type=Path)
    parser.add_argument("-o", dest="capture", metavar="CAPTURE.mcap", type=Path, required=True)
    parser.add_argument("--gravity", type=float, default=STANDARD_GRAVITY_MPS2, help="where it was recorded [m/s^2]")
    parser.add_argument("--model", default="auto", help="what the session shall estimate")
    parser.add_argument("--poll", type=float, help="time between two looks into the FIFO [s]; default: the driver's")
    arguments = parser.parse_args()
    try:
        print(make_capture(arguments.recording, arguments.capture, arguments.gravity, arguments.model, arguments.poll))
    except MpucalError as error:
        print(f"capture: {error}", file=sys.stderr)
        return error.exit_code
    return 0


def make_capture(file: Path, capture: Path, gravity: float, model: str, poll_s: float | None = None) -> str:
    """Make it; returns what was made, in a sentence.

    Raises
    ------
    RecordingError : the recording does not fit the chip. OutputError : the capture cannot be written.
    """
    if capture.exists():
        raise OutputError(f"{capture} is there already", "choose another file with -o")
    recording = load_npz(file)
    acc, gyr = counts_of(file, recording)
    recorded_hz = (len(recording) - 1) / float(recording.t[-1] - recording.t[0])
    rate_hz = nominal_rate_hz(recorded_hz)
    config = Config(reg.ACCEL_RANGES_G[acc.code], reg.GYRO_RANGES_DPS[gyr.code], rate_hz, poll_s=poll_s)
    bus = open_recorded(
        acc.counts,
        gyr.counts,
        rate_hz,
        config.accel_range_g,
        config.gyro_range_dps,
        rate_error_ppm=1e6 * (recorded_hz / rate_hz - 1),
    )
    plan = Plan(config, gravity, model, until_end=True)
    try:
        with running(OpenedChip(bus, plan), capture, console(quiet=True)) as runner:
            runner.measure()
        note = ""
    except Abandoned as error:
        note = f"\nA session that replays it is abandoned, as this one was: {error.what}; `mpucal calibrate` reads it."
    served = load(capture)
    return (
        f"{capture}: {len(served)} of {len(recording)} samples, ±{config.accel_range_g} g, ±{config.gyro_range_dps}"
        f" deg/s, {rate_hz:g} Hz nominal, {served.rate_hz:.4f} Hz measured, {recorded_hz:.4f} Hz recorded.{note}"
    )


def counts_of(file: Path, recording: Recording) -> tuple[Counts, Counts]:
    """The recording's counts of accelerometer and gyroscope: its own where it has them."""
    acc_scales = [reg.mps2_per_lsb(code) for code in range(4)]
    gyr_scales = [reg.rad_s_per_lsb(code) for code in range(4)]
    with np.load(file, allow_pickle=False) as archive:
        if all(f"{name}_{what}" in archive for name in ("acc", "gyr") for what in ("raw", "scale")):
            return (
                as_recorded(archive["acc_raw"], float(archive["acc_scale"]), acc_scales, "m/s^2"),
                as_recorded(archive["gyr_raw"], float(archive["gyr_scale"]), gyr_scales, "rad/s"),
            )
    return rounded(recording.acc, acc_scales, "m/s^2"), rounded(recording.gyr, gyr_scales, "rad/s")


def as_recorded(raw: Vector, scale: float, scales: list[float], unit: str) -> Counts:
    """`raw` counts of `scale`, which must be one of the chip's `scales`."""
    code = int(np.argmin(np.abs(np.log(np.array(scales) / scale))))
    if not np.isclose(scale, scales[code], rtol=SAME_SCALE):
        raise RecordingError(
            f"a count of the recording is {scale:g} {unit}, and none of the chip's is",
            "leave the counts out, and it is rounded to those of the chip",
        )
    return Counts(raw, code)


def rounded(values: Vector, scales: list[float], unit: str) -> Counts:
    """`values` in counts of the smallest range that holds them all."""
    largest = float(np.abs(values).max())
    for code, scale in enumerate(scales):
        if largest <= FULL_SCALE_COUNT * scale:
            return Counts(np.rint(values / scale), code)
    raise RecordingError(
        f"the recording reaches {largest:g} {unit}, beyond every range of the chip", "cut it to a part that fits"
    )


def nominal_rate_hz(recorded_hz: float) -> float:
    """The rate that the chip is set to: the nearest that it has."""
    base = reg.base_rate_hz(Config().dlpf)
    nominal = base / max(round(base / recorded_hz), 1)
    if abs(recorded_hz / nominal - 1) > FARTHEST_RATE:
        raise RecordingError(
            f"the recording has {recorded_hz:.4g} samples a second, far from the chip's nearest rate, {nominal:.4g}",
            "resample it to a rate that the chip has",
        )
    return nominal
