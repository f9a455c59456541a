"""Simulated hands and sensors in families, by which `tools/lab/families.py` judges the verdicts of calibrations."""

from . import around, body, changes, chip, course, digits, family, faults, judge, sampling, table, timing

__all__ = ["around", "body", "changes", "chip", "course", "digits", "family", "faults", "judge", "sampling", "table"]
__all__ += ["timing"]
