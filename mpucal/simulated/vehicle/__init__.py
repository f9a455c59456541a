"""Simulated ArduPilot or PX4 vehicle in a simulated hand, which `--mavlink sim` opens."""

from __future__ import annotations

from ...sources.kind import Request
from ...vehicle.source import OpenedVehicle, link_options
from .options import VehicleOptions
from .transport import SimulatedTransport
from .vehicle import SimulatedVehicle

__all__ = ["SimulatedVehicle", "VehicleOptions"]


def open_source(request: Request) -> OpenedVehicle:
    """Open the vehicle that `sim:key=value,...` describes, in the gravity of the plan; see VehicleOptions.parse.

    A command that opens it again passes the same dict `kept`: the vehicle then has the parameters that it had before.
    """
    options = link_options(request)
    wanted = VehicleOptions.parse(request.value, request.values.get("seed"))
    vehicle = SimulatedVehicle(wanted, request.plan.gravity, options["key"])
    vehicle.switch_on(request.values.get("kept", {}).setdefault(request.value, vehicle.firmware.store))
    transport = SimulatedTransport(vehicle)
    return OpenedVehicle(
        transport,
        request.plan,
        truth=vehicle.truth_document,
        real_time=transport.real_time,
        **options,
    )
