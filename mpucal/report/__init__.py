"""The report: a calibration and its recording as one HTML page."""

from .html import render

__all__ = ["render"]
