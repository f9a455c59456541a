import pytest

from tools.bench import bus_budget as budget

SHARES = {200: 0.08, 1000: 0.35}


@pytest.mark.parametrize("number", range(4))
def test_the_bus_suffices_and_no_sample_is_lost(number):
    """The share of a processor is only printed, as it includes the simulated chip's."""
    model, rate_hz, late_s = budget.BUDGETS[number]
    recording, of_bus, _ = budget.run(model, rate_hz, 5.0, late_s)
    assert of_bus <= SHARES[rate_hz]
    assert budget.lost(recording) == 0
    assert not recording.gap.any()
    assert len(recording) > 4.9 * rate_hz


def test_a_host_that_is_too_late_loses_samples_and_the_tool_sees_it():
    recording, _, _ = budget.run("mpu6500_512", 1000, 5.0, 0.050)
    assert budget.lost(recording) > 0
    assert recording.gap.any()


def test_the_rate_is_known_after_ten_seconds():
    assert budget.rate_error_ppm(200, 10, 2) < 60
