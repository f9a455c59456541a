"""Simulated ArduPilot or PX4 vehicle in a simulated hand."""

from __future__ import annotations

from .options import VehicleOptions
from .vehicle import Sent, SimulatedVehicle

__all__ = ["Sent", "SimulatedVehicle", "VehicleOptions"]
