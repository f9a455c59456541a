"""Drivers that record captures: a row decodes and replays theirs, and an unknown one is named."""

import numpy as np
import pytest

from mpucal.chip.access import Transaction
from mpucal.chip.config import RateOnlyConfig
from mpucal.data import Recording
from mpucal.errors import CaptureError
from mpucal.files import load, recorders
from mpucal.files.capture_writer import CaptureWriter
from mpucal.sources.opening import open_source

META = {"driver": "pigeon 2", "plan": {"config": {"rate_hz": 50.0}}}


class Decoder:
    """Decoder that has a sample for each letter, as the module of a source has one."""

    def __init__(self, name):
        self._name, self._t = name, []

    def feed(self, access):
        self._t += [access.t_ns * 1e-9] * bool(access.data)

    def recording(self):
        n = len(self._t)
        return Recording.from_arrays(np.array(self._t), np.ones((n, 3)), np.zeros((n, 3)), name=self._name)


class Opened:
    """Source that returns what the module of a source opens."""

    @staticmethod
    def replayed(capture, line, plan, values, **how):
        return capture.name, line.read("loft", 1).data, plan.config, how["real_time"]


def test_a_row_decodes_and_replays_what_its_driver_recorded(tmp_path, monkeypatch):
    path = tmp_path / "letters.mcap"
    with CaptureWriter(path) as writer:
        writer.start(META)
        for i in range(5):
            writer.transaction(Transaction("read", "loft", 1, b"x", i * 1_000_000_000))
    with pytest.raises(CaptureError, match=r"by version pigeon 2 of the driver.*use the mpucal that recorded it"):
        load(path)
    known = recorders.RECORDERS
    for version in ("pigeon 2", "pigeon 3"):
        row = recorders.Recorder(version, RateOnlyConfig, f"{__name__}:Opened", f"{__name__}:Decoder")
        monkeypatch.setattr(recorders, "RECORDERS", [*known, row])
        assert load(path).t.tolist() == [0, 1, 2, 3, 4]
        if version == META["driver"]:
            assert open_source({"replay": path}) == ("letters.mcap", b"x", RateOnlyConfig(rate_hz=50.0), False)
    with pytest.raises(CaptureError, match=r"recorded by version pigeon 2 of the driver.*use `mpucal calibrate`"):
        open_source({"replay": path})
