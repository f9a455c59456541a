"""A simulated ArduPilot or PX4 vehicle in a simulated hand. Knows no session and no estimate."""

from __future__ import annotations

from .options import Options
from .vehicle import Sent, Vehicle

__all__ = ["Options", "Sent", "Vehicle"]
