"""Simulated hands and sensors in families, by which `tools/families.py` judges the verdicts of calibrations."""
