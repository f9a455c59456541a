"""The runner of the trials, by the cheapest of them at their smallest size."""

import json
from pathlib import Path

import pytest

from tools.lab import monte_carlo, noise_trials, strangers

SESSION = str(Path(__file__).parents[3] / "fixtures" / "sessions" / "mpu6050.mcap")


@pytest.mark.parametrize(
    ("trial", "words", "said"),
    [
        (noise_trials, ["--hours", "0.01", "--seeds", "1"], "gyroscope, restless"),
        (strangers, [SESSION], "good (hand)"),
        (monte_carlo, ["--scenes", "12 poses", "--seeds", "1:2", "--methods", "six*;ell*"], "no rest with"),
    ],
    ids=["noise", "strangers", "monte_carlo"],
)
def test_a_trial_prints_its_table_and_writes_its_rows(trial, words, said, tmp_path, capsys):
    assert trial.main([*words, "--jobs", "1", "--json", str(tmp_path / "rows.json")]) == 0
    assert said in capsys.readouterr().out
    assert json.loads((tmp_path / "rows.json").read_text())


def test_unknown_options_are_refused(capsys):
    with pytest.raises(SystemExit):
        noise_trials.main(["--hour"])
    assert "usage" in capsys.readouterr().err
