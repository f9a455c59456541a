"""Arithmetic of the register map against the data sheets' figures."""

import math

import pytest

from mpucal.chip import registers as reg


@pytest.mark.parametrize(("fs_sel", "lsb_per_dps"), [(0, 131), (1, 65.5), (2, 32.8), (3, 16.4)])
def test_gyroscope_scale(fs_sel, lsb_per_dps):
    assert lsb_per_dps * reg.rad_s_per_lsb(fs_sel) == pytest.approx(math.radians(1), rel=2e-3)


@pytest.mark.parametrize(
    ("rate_hz", "dlpf_cfg", "divider"),
    [
        pytest.param(200, 3, 4, id="the default"),
        pytest.param(1000, 1, 0, id="the fastest"),
        pytest.param(1000, 0, 7, id="from 8 kHz"),
        pytest.param(1000 / 256, 6, 255, id="the slowest"),
        pytest.param(333.33333, 3, 2, id="a third"),
    ],
)
def test_divider_of_a_rate_and_back(rate_hz, dlpf_cfg, divider):
    assert reg.sample_rate_divider(rate_hz, dlpf_cfg) == divider
    assert reg.sample_rate_hz(divider, dlpf_cfg) == pytest.approx(rate_hz)
