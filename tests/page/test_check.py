"""`mpucal check --page`: what a hand follows, and the verdict."""

import json
import subprocess
import sys
import urllib.request
from contextlib import closing

import numpy as np
import pytest

from mpucal.result.calibration import Calibration


@pytest.mark.slow
def test_the_page_shows_the_prompts_and_the_verdict(tmp_path):
    Calibration(np.eye(3), np.zeros(3), quality={"verdict": "good", "reasons": []}).save(tmp_path / "c.json")
    words = ["check", "c.json", "--bus", "sim:pace=fast,seed=3", "--rate", "100", "--page", "-o", "checked"]
    with subprocess.Popen(
        [sys.executable, "-m", "mpucal", *words], cwd=tmp_path, stdout=-1, stderr=-1, text=True
    ) as it:
        url = it.stderr.readline().split()[-1]
        with closing(urllib.request.urlopen(f"{url}events", timeout=60.0)) as events:
            told = [json.loads(line[5:]) for line in events if line.startswith(b"data:")]
        out, _ = it.communicate(timeout=60)
    prompts = [one["prompt"]["text"] for one in told if one.get("prompt")]
    assert any("Orientation" in prompt for prompt in prompts)
    (verdict,) = [one["verdict"] for one in told if "verdict" in one]
    assert out.lower().startswith(verdict)
    (results,) = [one["results"] for one in told if "results" in one]
    assert "check.json" in [result["name"] for result in results]
