"""The environment that keeps linear algebra to one thread; it must be set before NumPy loads."""

from __future__ import annotations

# Environment variables that NumPy's libraries read as they are loaded. Matrices are small here: a second thread would
# wait for the first, and take its core from who reads the sensor.
ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
