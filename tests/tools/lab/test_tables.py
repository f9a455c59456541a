import io

import numpy as np
import pytest
from rich.console import Console

from mpucal.calibration.fit import Fit
from mpucal.calibration.parameters import B_A_NAMES, D_NAMES
from tools.lab import tables

NAN = (np.nan,) * 3


@pytest.fixture
def run():
    def make(sph_rms, failure=None, model="hand", z=1.0, roll=NAN, pitch=NAN):
        return tables.Run(0, model, failure, 5, 3.0, 0.1, z, 6, (0.8, 0.0, sph_rms), roll, pitch)

    return make


def printed(table):
    stream = io.StringIO()
    Console(file=stream, width=200).print(table)
    return stream.getvalue()


def test_a_failure_counts_in_all_runs_and_not_among_the_successful(run):
    document = tables.summary([run(0.1), run(0.3), run(8.0, failure="not converged")])
    assert document["failures"] == {"not converged": 1}
    assert document["failed_percent"] == pytest.approx(100 / 3)
    assert document["rows"]["calibrated"]["sph_rms"] == pytest.approx((0.2, 0.1))
    assert document["rows"]["calibrated, all runs"]["sph_rms"][0] == pytest.approx(2.8)
    assert document["worst_sph_rms"] == 0.3


def test_runs_that_all_failed_have_no_mean(run):
    document = tables.summary([run(np.nan, failure="refused", z=np.nan)])
    assert document["rows"]["calibrated"]["sph_rms"] == (None, None)
    assert document["z"] == {"median": None, "max": None}


@pytest.mark.parametrize(
    ("sph_rms", "failure", "met"),
    [(0.0039, None, "yes"), (0.0041, None, "no"), (0.0039, "not converged", "no")],
    ids=["below", "above", "one run failed"],
)
def test_a_goal_is_met_by_the_mean_of_runs_that_all_succeed(run, sph_rms, failure, met):
    document = tables.summary([run(sph_rms), run(sph_rms, failure=failure)])
    row = next(line for line in printed(tables.goals_table({"12 poses": document}, "")).splitlines() if "12 p" in line)
    assert row.split("│")[5].strip() == met


def test_the_papers_scenario_has_a_goal_for_each_angle(run):
    document = tables.summary([run(0.06, model="accel", roll=(15.0, 0.2, 0.33), pitch=(9.0, 0.2, 0.27))])
    rows = [line for line in printed(tables.goals_table({"paper": document}, "")).splitlines() if "deg" in line]
    assert [row.split("│")[5].strip() for row in rows if "│" in row] == ["yes", "no"]


def test_scenes_have_names_of_their_own():
    names = [scene.name for scene in tables.SCENES]
    assert len(set(names)) == len(names)


def test_the_papers_figures_stand_beside_its_own_scenario_alone(run):
    document = tables.summary([run(0.1)])
    assert "the paper" in printed(tables.accuracy_table(document, "", True))
    assert "the paper" not in printed(tables.accuracy_table(document, "", False))


def test_an_efficient_estimator_has_a_ratio_of_one():
    sd = np.linspace(0.1, 0.5, 12)
    rng = np.random.default_rng(0)
    covariance = np.diag(sd**2)

    def fit():
        return Fit(np.eye(3), np.zeros(3), np.zeros(3), np.eye(3), D_NAMES + B_A_NAMES, covariance, 3, True, 3.0, 0.0)

    document = tables.efficiency([(fit(), sd * rng.standard_normal(12)) for _ in range(2000)] + [None])
    assert document["failed"] == 1
    assert [row["ratio"] for row in document["parameters"].values()] == pytest.approx([1.0] * 12, abs=0.06)
