"""Draw the paper's Figs. 1 to 4 with this estimator: sphere, magnitudes, Monte Carlo errors, efficiency.

python -m tools.lab figures -o figures                                        all, simulated
python -m tools.lab figures -o figures --seeds 1000 --format svg
python -m tools.lab figures -o figures --figure 2 --recording session.npz     magnitudes of real recordings

Needs matplotlib (pip install 'mpucal[plot]').
"""

from __future__ import annotations

import argparse
import sys
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import mpucal
from mpucal.data import STANDARD_GRAVITY_MPS2, Recording, Vector
from tools.lab.scenarios.motions import FLAT_S
from tools.lab.scenarios.recordings import GRAVITY_MPS2, hand_scenario, paper_scenario

from .monte_carlo import Efficiency, efficiency, fit_fixed
from .trials import command_line, in_parallel

BEFORE, AFTER, INK, FAINT = "#c8503c", "#2b6cb0", "#333333", "#b8b8b8"
STYLE = {
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.titlelocation": "left",
    "axes.edgecolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e8e8e8",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "lines.linewidth": 1.2,
    "svg.hashsalt": "mpucal",
    "savefig.dpi": 160,
}
ABOVE = {"loc": "lower right", "bbox_to_anchor": (1.01, 0.99), "borderaxespad": 0.0, "fontsize": 8}
SMOOTH_S = 0.1


class Sweep(NamedTuple):
    """A Monte Carlo run over time (n,): magnitudes (2, n) [m/s^2] and angular errors (2, n) [deg] before and after."""

    t: Vector
    magnitudes: Vector
    angles: Vector


def sweep(seed: int, model: str) -> Sweep | None:
    """A run of section 4.3; None where the fit was refused."""
    simulated = paper_scenario(seed)
    recording, ideal = simulated.recording, simulated.specific_force
    result = mpucal.calibrate(recording, model=model, gravity=GRAVITY_MPS2)
    if result.verdict == "refused":
        return None
    both = np.array([recording.acc, result.apply(recording.acc)])
    return Sweep(recording.t, np.linalg.norm(both, axis=2), np.array([angles(a, ideal) for a in both]))


def angles(a: Vector, b: Vector) -> Vector:
    """Angles [deg] between the rows of a and b, (n, 3) each: (n,)."""
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.sum(a * b, axis=1)))


def smoothed(x: Vector, size: int) -> Vector:
    """Running mean of (n,) over `size` samples, shorter at the ends."""
    ones = np.convolve(np.ones(len(x)), np.ones(size), "same")
    return np.asarray(np.convolve(x, np.ones(size), "same") / ones)


def sphere(plt: Any, recording: Recording, gravity: float) -> Any:
    """Fig. 1: samples before and after in three dimensions, and the sphere they belong on."""
    result = mpucal.calibrate(recording, gravity=gravity)
    some = slice(None, None, max(len(recording) // 1500, 1))
    y, y_cal = recording.acc[some], result.apply(recording.acc[some])
    figure = plt.figure(figsize=(8.0, 4.1))
    u, v = np.mgrid[0 : 2 * np.pi : 37j, 0 : np.pi : 19j]
    ball = gravity * np.array([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)])
    for k, (points, colour, title) in enumerate(((y, BEFORE, "uncalibrated"), (y_cal, AFTER, "calibrated"))):
        axes = figure.add_subplot(1, 2, 1 + k, projection="3d")
        axes.set_box_aspect((1, 1, 1), zoom=1.06)
        axes.plot_wireframe(*ball, color=FAINT, linewidth=0.35, rstride=2, cstride=2)
        axes.scatter(*points.T, s=3.0, color=colour, alpha=0.6, linewidths=0)
        axes.scatter([0], [0], [0], marker="+", color=INK, s=30)
        size = 1.05 * max(gravity, np.abs(y).max())
        axes.set(xlim=(-size, size), ylim=(-size, size), zlim=(-size, size))
        for name in "xyz":
            getattr(axes, f"set_{name}label")(name, labelpad=-7)
        axes.set_title(f"{title}: |a| = {_mean_and_sd(points)} m/s²")
        axes.tick_params(labelsize=6, pad=-3)
        axes.view_init(elev=18, azim=-50)
    figure.subplots_adjust(left=0.0, right=0.94, bottom=0.05, top=0.92, wspace=0.0)
    return figure


def magnitudes(plt: Any, recordings: list[Recording], gravity: float) -> Any:
    """Fig. 2: magnitudes over time, a recording a row."""
    figure, rows = plt.subplots(len(recordings), 1, figsize=(8.0, 2.1 * len(recordings) + 0.4), squeeze=False)
    for axes, recording in zip(rows[:, 0], recordings, strict=True):
        result = mpucal.calibrate(recording, gravity=gravity)
        size = max(round(SMOOTH_S * recording.rate_hz), 1)
        t = recording.t - recording.t[0]
        axes.axhline(gravity, color=INK, linewidth=0.8, label=f"‖g‖ = {gravity:g}")
        for acc, colour, label in (
            (recording.acc, BEFORE, "uncalibrated"),
            (result.apply(recording.acc), AFTER, f"calibrated, {result.fit['model']}"),
        ):
            a = np.linalg.norm(acc, axis=1)
            axes.plot(t, smoothed(a, size), color=colour, label=f"{label}: {_mean_and_sd(acc)}", linewidth=0.9)
        near = np.quantile(np.linalg.norm(recording.acc, axis=1), [0.02, 0.98])
        axes.set(ylabel="|a|, m/s²", title=recording.name, xlim=(0, t[-1]))
        axes.set_ylim(min(near[0], gravity) - 0.7, max(near[1], gravity) + 0.7)
        axes.legend(**ABOVE, ncols=3)
    rows[-1, 0].set_xlabel("time, s")
    figure.tight_layout()
    return figure


def errors_over_time(plt: Any, sweeps: list[Sweep], failed: int) -> Any:
    """Fig. 3: magnitude and angular error over time, mean and standard deviation of the runs."""
    figure, (top, bottom) = plt.subplots(2, 1, figsize=(8.0, 5.0), sharex=True)
    t = sweeps[0].t
    top.axhline(GRAVITY_MPS2, color=INK, linewidth=0.8)
    for axes, runs in ((top, [run.magnitudes for run in sweeps]), (bottom, [run.angles for run in sweeps])):
        for k, (colour, label) in enumerate(((BEFORE, "uncalibrated"), (AFTER, "calibrated"))):
            values = np.array([run[k] for run in runs])
            mean, sd = values.mean(0), values.std(0)
            axes.fill_between(t, mean - sd, mean + sd, color=colour, alpha=0.18, linewidth=0)
            axes.plot(t, mean, color=colour, label=f"{label}: {values.mean():.2f}, sd {sd.mean():.2f}", linewidth=1.0)
        axes.legend(**ABOVE, ncols=2)
        for k, name in enumerate(("flat", "turn about x", "turn about y", "turn about z")):
            axes.axvline(FLAT_S * k, color=FAINT, linewidth=0.6)
            at = {"xycoords": ("data", "axes fraction"), "fontsize": 7, "color": INK, "ha": "center", "va": "top"}
            axes.annotate(name, (FLAT_S * (k + 0.5), 0.98), **at)
    top.set(ylabel="|a|, m/s²", title=f"{len(sweeps)} simulated sensors, {failed} refused")
    top.margins(y=0.1)
    bottom.margins(y=0.1)
    bottom.set(ylabel="angular error, deg", xlabel="time, s", xlim=(t[0], t[-1]))
    bottom.set_ylim(bottom=0.0)
    figure.tight_layout()
    return figure


def bound(plt: Any, parameters: dict[str, Efficiency], runs: int) -> Any:
    """Fig. 4: root mean square errors beside the square root of the Cramér-Rao bound."""
    figure, axes = plt.subplots(figsize=(8.0, 3.2))
    names = [f"${letter}_{{{','.join(index)}}}$" for letter, *index in (n.split("_") for n in parameters)]
    rmse, crlb = np.array(list(parameters.values())).T
    x = np.arange(len(names))
    axes.bar(x - 0.2, crlb, 0.38, color=FAINT, label="√CRLB")
    axes.bar(x + 0.2, rmse, 0.38, color=AFTER, label="RMSE")
    for at, ratio, top in zip(x, rmse / crlb, np.maximum(rmse, crlb), strict=True):
        axes.annotate(f"{ratio:.2f}", (at, top), ha="center", va="bottom", fontsize=7)
    axes.set_xticks(x, [f"{k + 1}\n{name}" for k, name in enumerate(names)])
    axes.set(ylabel="D: 1; b: m/s²", title=f"RMSE and √CRLB of {runs} runs with one sensor; their ratio above")
    axes.grid(axis="x", visible=False)
    axes.margins(y=0.12)
    axes.legend(**ABOVE, ncols=2)
    figure.tight_layout()
    return figure


def _mean_and_sd(acc: Vector) -> str:
    a = np.linalg.norm(acc, axis=1)
    return f"{a.mean():.2f} ± {a.std():.2f}"


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = command_line(__doc__, seeds="0:100")
    parser.add_argument("-o", "--output", type=Path, default=Path("figures"), help="folder for the pictures")
    parser.add_argument("--figure", type=int, action="append", choices=(1, 2, 3, 4), help="only this one; repeatable")
    parser.add_argument("--recording", type=Path, action="append", help="for Figs. 1 and 2, instead of simulated ones")
    parser.add_argument("--gravity", type=float, default=STANDARD_GRAVITY_MPS2, help="m/s^2, of the recordings")
    parser.add_argument("--model", default="accel", choices=("accel", "paper"), help="of Figs. 3 and 4")
    parser.add_argument("--format", action="append", choices=("png", "svg", "pdf"), help="repeatable; png")
    return parser.parse_args()


def draw(plt: Any, number: int, options: argparse.Namespace) -> Any:
    """One of the paper's figures."""
    gravity = options.gravity
    recordings = [mpucal.load(path) for path in options.recording or ()]
    if not recordings and number in (1, 2):
        gravity = GRAVITY_MPS2
    if number == 1:
        return sphere(plt, recordings[0] if recordings else paper_scenario(4).recording, gravity)
    if number == 2:
        simulated = (hand_scenario(2, motion).recording for motion in ("pose6", "continuous"))
        return magnitudes(plt, recordings or list(simulated), gravity)
    if number == 3:
        done = list(in_parallel(partial(sweep, model=options.model), options.seeds, options.jobs, "Fig. 3"))
        good = [run for run in done if run is not None]
        return errors_over_time(plt, good, len(done) - len(good))
    one = partial(fit_fixed, model=options.model)
    fits = list(in_parallel(one, options.seeds, options.jobs, "Fig. 4"))
    return bound(plt, efficiency(fits), len(fits))


def main() -> int:
    """Draw and save; the exit code."""
    options = arguments()
    try:
        import matplotlib as mpl  # noqa: PLC0415 - optional
    except ImportError:
        print("figures need matplotlib: pip install 'mpucal[plot]'.", file=sys.stderr)
        return 2
    mpl.use("Agg")
    from matplotlib import pyplot as plt  # noqa: PLC0415 - after the choice of back end

    options.output.mkdir(parents=True, exist_ok=True)
    with plt.rc_context(STYLE):
        for number in options.figure or (1, 2, 3, 4):
            figure = draw(plt, number, options)
            for suffix in options.format or ("png",):
                path = options.output / f"figure_{number}.{suffix}"
                figure.savefig(path)
                print(path)
            plt.close(figure)
    return 0
