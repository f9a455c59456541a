"""Simulated hands and sensors with known truth: recordings of a scene, and families that verdicts are judged by."""
