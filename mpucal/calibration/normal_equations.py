"""Inverses and solutions of normal equations, whose unknowns differ in unit by many powers of ten."""

from __future__ import annotations

import numpy as np

from ..data import Vector


def inverse(H: Vector) -> Vector:
    """Return H^-1 (..., p, p), scaled to a unit diagonal; directions without information get huge variances."""
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(H, axis1=-2, axis2=-1), 1e-300))
    scale = scale[..., :, None] * scale[..., None, :]
    scaled = H * scale
    try:
        result = np.linalg.inv(scaled)
    except np.linalg.LinAlgError:
        result = np.linalg.pinv(scaled, hermitian=True)
    return np.asarray(result * scale)


def solve(H: Vector, g: Vector) -> Vector:
    """Return H^-1 g with H scaled to a unit diagonal; zero along directions without information."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(H), 1e-300))
    scaled = H * np.outer(scale, scale)
    try:
        x = np.linalg.solve(scaled, g * scale)
    except np.linalg.LinAlgError:
        x = np.linalg.lstsq(scaled, g * scale, rcond=1e-12)[0]
    return np.asarray(x * scale)
