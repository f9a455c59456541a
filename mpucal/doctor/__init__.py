"""Diagnosis of a chip and its bus: examinations, step by step, and their findings on one page."""
