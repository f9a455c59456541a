"""What Monte Carlo runs amount to, as documents and as tables for a person."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich.table import Table

from mpucal.calibration.fit import Fit
from mpucal.calibration.parameters import B_A_NAMES, D_NAMES
from mpucal.data import Vector

PAPER = {"uncalibrated": "8.3 (7.1) / 8.3 (6.9)", "calibrated": "0.32 (0.40) / 0.33 (0.43)", "iterations": "<= 6 (10)"}


@dataclass(frozen=True)
class Run:
    """One simulated calibration; errors are (uncalibrated, true D and b_a, estimated).

    z : rms over D and b_a of the errors in units of their claimed standard deviations; 1 where those are honest.
    known_K : how many of K's six elements the fit claims to know.
    """

    seed: int
    model: str
    failure: str | None
    iterations: int
    nis: float
    seconds: float
    z: float
    known_K: int
    sph_rms: tuple[float, ...]
    roll_deg: tuple[float, ...]
    pitch_deg: tuple[float, ...]


@dataclass(frozen=True)
class Scene:
    """A scenario of `--all` and what is wanted of its runs' means.

    sph_rms : m/s^2. roll_deg, pitch_deg : deg. None: nothing was set.
    """

    name: str
    scenario: str
    sph_rms: float | None = None
    roll_deg: float | None = None
    pitch_deg: float | None = None
    tremble: bool = False
    delay_ms: float = 0.0


SCENES = (
    Scene("paper", "paper", roll_deg=0.345, pitch_deg=0.265),
    Scene("12 poses", "pose12", 0.004),
    Scene("12 poses, trembling", "pose12", 0.007, tremble=True),
    Scene("9 poses", "pose9"),
    Scene("7 poses", "pose7"),
    Scene("six faces", "pose6", 0.21),
    Scene("three turns", "turns", 0.12),
    Scene("continuous", "continuous", 0.037),
    Scene("continuous, 1 ms late", "continuous", 0.037, delay_ms=1.0),
    Scene("wobbling by 30 %", "wobble30", 0.10),
    Scene("wobbling by 100 %", "wobble100", 0.135),
    Scene("calm, 3 jerks/s", "calm jerks", 0.0022),
)


def spread(values: Sequence[float]) -> tuple[float, float] | tuple[None, None]:
    """Mean and standard deviation of those that are numbers."""
    numbers = np.array(values, float)
    numbers = numbers[np.isfinite(numbers)]
    return (float(numbers.mean()), float(numbers.std())) if len(numbers) else (None, None)


def summary(runs: list[Run]) -> dict[str, Any]:
    """Means and standard deviations, over the successful runs and over all."""
    good = [run for run in runs if run.failure is None]
    failures: dict[str, int] = {}
    for run in runs:
        if run.failure:
            failures[run.failure] = failures.get(run.failure, 0) + 1
    rows = {
        "uncalibrated": (runs, 0),
        "true D, b_a": (runs, 1),
        "calibrated": (good, 2),
        "calibrated, all runs": (runs, 2),
    }
    z = [run.z for run in good if np.isfinite(run.z)]
    return {
        "failures": failures,
        "failed_percent": 100.0 * (len(runs) - len(good)) / len(runs),
        "iterations": {
            "mean": spread([run.iterations for run in good])[0],
            "max": max((run.iterations for run in good), default=0),
        },
        "nis": [f([run.nis for run in good], default=None) for f in (min, max)],
        "z": {"median": float(np.median(z)), "max": max(z)} if z else {"median": None, "max": None},
        "known_K": spread([run.known_K for run in good])[0],
        "worst_sph_rms": max((run.sph_rms[2] for run in good), default=None),
        "seconds_each": spread([run.seconds for run in runs])[0],
        "models": {name: sum(run.model == name for run in runs) for name in sorted({run.model for run in runs})},
        "rows": {
            label: {key: spread([getattr(run, key)[k] for run in of]) for key in ("roll_deg", "pitch_deg", "sph_rms")}
            for label, (of, k) in rows.items()
        },
    }


def accuracy_table(document: dict[str, Any], title: str, of_the_paper: bool) -> Table:
    """The summary of one scenario; `of_the_paper` where the paper's figures belong beside it."""
    table = Table("", "roll deg (sd)", "pitch deg (sd)", "sph_rms m/s² (sd)", title=title)
    if of_the_paper:
        table.add_column("the paper: roll / pitch")
    for label, row in document["rows"].items():
        cells = [
            "" if row[key][0] is None else f"{row[key][0]:.4g} ({row[key][1]:.2g})"
            for key in ("roll_deg", "pitch_deg", "sph_rms")
        ]
        table.add_row(label, *cells, *([PAPER.get(label, "")] if of_the_paper else []))
    iterations = document["iterations"]
    theirs = f"; the paper {PAPER['iterations']}" if of_the_paper else ""
    table.caption = (
        f"failed {document['failed_percent']:.1f} % {document['failures'] or ''}; "
        f"iterations {iterations['mean'] or 0:.2f} (max {iterations['max']}{theirs}); "
        f"claimed sd: z {number(document['z']['median'])} (worst {number(document['z']['max'])}); "
        f"{document['seconds_each']:.3f} s a calibration; models {document['models']}"
    )
    return table


def goals_table(documents: dict[str, dict[str, Any]], title: str) -> Table:
    """All scenarios on one page, each mean beside what is wanted of it."""
    table = Table("scenario", title=title)
    for column in ("error", "worst", "goal", "met", "failed", "z (worst)", "K known", "ms", "models"):
        table.add_column(column, justify="left" if column == "models" else "right")
    for scene in SCENES:
        if scene.name in documents:
            document = documents[scene.name]
            models = ", ".join(f"{name} {count}" for name, count in document["models"].items())
            for error, worst, goal, met in _against(scene, document):
                table.add_row(
                    scene.name,
                    *(error, worst, goal, {None: "", True: "yes", False: "[red]no[/red]"}[met]),
                    f"{document['failed_percent']:.1f} %",
                    f"{number(document['z']['median'])} ({number(document['z']['max'])})",
                    f"{number(document['known_K'])} of 6",
                    f"{1e3 * document['seconds_each']:.0f}",
                    models,
                )
    table.caption = "errors: sph_rms in m/s² unless in deg; z: errors in units of the claimed standard deviations, rms"
    return table


def _against(scene: Scene, document: dict[str, Any]) -> list[tuple[str, str, str, bool | None]]:
    """Error, the worst run's, goal and whether it was met: of sph_rms, or of roll and pitch where those have goals."""
    row = document["rows"]["calibrated"]
    whole = document["failed_percent"] == 0.0
    lines = []
    for key, goal in (("roll_deg", scene.roll_deg), ("pitch_deg", scene.pitch_deg)):
        if goal is not None:
            mean = row[key][0]
            name = key.removesuffix("_deg")
            met = whole and mean is not None and mean <= goal
            lines.append((f"{name} {number(mean)} deg", "", f"{goal:.3g} deg", met))
    if not lines:
        mean, goal = row["sph_rms"][0], scene.sph_rms
        met = None if goal is None else whole and mean is not None and mean <= goal
        lines.append((number(mean), number(document["worst_sph_rms"]), "" if goal is None else f"{goal:.3g}", met))
    return lines


def number(value: float | None) -> str:
    """Three digits, or a dash where nobody knows."""
    return "-" if value is None or not np.isfinite(value) else f"{value:.3g}"


def efficiency(fits: list[tuple[Fit, Vector] | None]) -> dict[str, Any]:
    """RMSE against the Cramér-Rao bound of the mean Fisher information, of the 12 parameters."""
    good = [pair for pair in fits if pair is not None]
    # of D and b_a alone: the other parameters' meaning may change with the run (tilts about an estimated axis)
    fisher = np.mean([np.linalg.inv(fit.covariance[:12, :12]) for fit, _ in good], axis=0)
    bound = np.sqrt(np.diag(np.linalg.inv(fisher)))
    rmse = np.sqrt(np.mean([error**2 for _, error in good], axis=0))
    names = (*D_NAMES, *B_A_NAMES)
    return {
        "failed": len(fits) - len(good),
        "parameters": {
            name: {"rmse": r, "sqrt_crlb": c, "ratio": r / c}
            for name, r, c in zip(names, rmse.tolist(), bound.tolist(), strict=True)
        },
    }


def efficiency_table(document: dict[str, Any], title: str) -> Table:
    """The efficiency as a person reads it; the paper shows it as Fig. 4."""
    table = Table("parameter", "RMSE", "√CRLB", "RMSE / √CRLB", title=title)
    for name, row in document["parameters"].items():
        table.add_row(name, f"{row['rmse']:.3g}", f"{row['sqrt_crlb']:.3g}", f"{row['ratio']:.3f}")
    table.caption = f"{document['failed']} failed"
    return table
