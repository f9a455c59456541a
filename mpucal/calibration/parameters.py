"""The parameters of the model: names, places in a vector, and where the kernel keeps them."""

from __future__ import annotations

import numpy as np

D_NAMES = tuple(f"D_{i}{j}" for i in "xyz" for j in "xyz")

B_A_NAMES = tuple(f"b_a_{i}" for i in "xyz")

B_OMEGA_NAMES = tuple(f"b_omega_{i}" for i in "xyz")

TILT_NAMES = ("tilt_0", "tilt_1")

K_NAMES = ("K_xx", "K_xy", "K_xz", "K_yy", "K_yz", "K_zz")

R_NAMES = ("r_x", "r_y", "r_z")

NAMES = (*D_NAMES, *B_A_NAMES, *TILT_NAMES, *B_OMEGA_NAMES, *K_NAMES, "tau", *R_NAMES)

PLACES = {"D": (0, 9), "b_a": (9, 12), "b_omega": (14, 17), "K": (17, 23), "tau": (23, 24), "r": (24, 27)}

# where the kernel keeps each of them (Lanes in kernel/filter.hpp)
LANES = np.array([0, 1, 2, 4, 5, 6, 8, 9, 10, 3, 7, 11, 15, 16, 12, 13, 14, *range(17, 27)])

# lane groups of the exact filter that hold the first so many parameters
GROUPS = {17: 5, 23: 6}
