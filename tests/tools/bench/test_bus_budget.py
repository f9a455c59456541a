import pytest

from tools.bench import bus_budget as budget

SHARES = {200: 0.08, 1000: 0.35, 4000: 0.62}


@pytest.mark.parametrize("number", range(5))
def test_the_bus_suffices_and_no_sample_is_lost(number):
    """The simulated chip's processor time is in it, so that is only printed."""
    model, rate_hz, late_s = budget.BUDGETS[number]
    recording, of_bus, _ = budget.run(model, rate_hz, 10.0, late_s)
    assert of_bus <= SHARES[rate_hz]
    assert budget.lost(recording) == 0
    assert not recording.gap.any()
    assert len(recording) > 9.9 * rate_hz


def test_spi_takes_a_small_part_of_its_bus():
    """1000 frames of 14 bytes at 20 MHz are 0.6 %; registers at 1 MHz take about as much again."""
    _, of_bus, _ = budget.run("mpu6500", 1000, 10.0, 0.010, share=budget.spi_share)
    assert 0.0056 < of_bus < 0.03


@pytest.mark.parametrize(("model", "late_s"), [("mpu6050", 0.020), ("mpu6500_512", 0.010)])
def test_a_host_that_is_too_late_loses_samples_and_the_tool_sees_it(model, late_s):
    recording, _, _ = budget.run(model, 1000, 5.0, 5 * late_s)
    assert budget.lost(recording) > 0
    assert recording.gap.any()


@pytest.mark.parametrize(("rate_hz", "rms_ppm"), [(1000, 20), (200, 60)])
def test_the_rate_is_known_after_ten_seconds(rate_hz, rms_ppm):
    assert budget.rate_error_ppm(rate_hz, 10, 2) < rms_ppm
