"""Calibration of many recordings on dask.distributed: a table with a row for each, and a page about the fleet."""
