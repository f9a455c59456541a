"""Numbers with their standard uncertainties, as report and terminal show them."""

import numpy as np

from mpucal.report.units import ParameterRow


def test_a_number_of_which_nothing_is_known_is_not_shown():
    row = ParameterRow("scale factor error", "%", np.array([6058.0, 2.1, 0.3]), np.array([812.0, 19.0, 0.02]))
    assert row.cells == ["not observable", "+2 ± 19", "+0.300 ± 0.020"]
