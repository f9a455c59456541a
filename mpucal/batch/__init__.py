"""Calibration of many recordings on dask.distributed: a table with a row for each, and a page about the fleet.

import mpucal.batch
table = mpucal.batch.calibrate_many(["a.mcap", "s3://bucket/b.mcap"])
"""

from __future__ import annotations

from .many import calibrate_many

__all__ = ["calibrate_many"]
