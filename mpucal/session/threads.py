"""Environment that limits linear algebra to one thread; it must be set before NumPy loads."""

from __future__ import annotations

# NumPy's libraries read these as they are loaded. Matrices are small here: a second thread would wait for the first,
# and take its core from the loop that reads the sensor.
ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
