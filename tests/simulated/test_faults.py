"""Table of faults: the options accept it, and faults of the hand affect chip and vehicle."""

import numpy as np
import pytest

from mpucal.chip.config import Config
from mpucal.errors import UsageError
from mpucal.session.events import PromptKind
from mpucal.simulated.chip import ChipOptions, open_simulated
from mpucal.simulated.faults import FAULTS, OF_CHIP, OF_VEHICLE, Fault, Schedule, Where, fault_kinds
from mpucal.simulated.vehicle import SimulatedVehicle, VehicleOptions
from tools.lab.sessions import recorded

WORLDS = {ChipOptions: (*OF_CHIP, Where.DEFECT, Where.HAND), VehicleOptions: (*OF_VEHICLE, Where.HAND)}


@pytest.mark.parametrize("options", WORLDS)
def test_each_world_takes_its_own_faults_and_names_them(options):
    own = fault_kinds(*WORLDS[options])
    for name, kind in FAULTS.items():
        word = f"{name}@3" if kind.timed else name
        if name in own:
            assert [str(fault) for fault in options.parse(f"sim:fault={word}").fault] == [word]
            continue
        with pytest.raises(UsageError) as caught:
            options.parse(f"sim:fault={word}")
        assert set(own) <= set(str(caught.value).replace(",", " ").replace(";", " ").replace(":", " ").split())


def test_only_timed_faults_have_a_time():
    for word in ("arm", "loss@3", "nack@3"):
        with pytest.raises(UsageError):
            VehicleOptions.parse(f"sim:fault={word}")
    both = VehicleOptions.parse("sim:fault=loss,fault=arm@3/reorder").fault
    assert both == (Fault("loss"), Fault("arm", 3.0), Fault("reorder"))


def test_a_schedule_gives_each_once_in_order_and_the_recurring_again():
    schedule = Schedule((Fault("reboot", 5.0), Fault("second_station", 2.0), Fault("loss"), Fault("arm", 3.0)))
    seen = [[fault.name for fault in schedule.due(t * 1_000_000_000)] for t in (1, 4, 5, 16, 17, 32)]
    assert seen == [[], ["second_station", "arm"], ["reboot"], [], ["second_station"], ["second_station"]]


def measured(word):
    """Return the specific force of a board that lies flat, 10 s after the start."""
    bus = open_simulated(f"sim:seed=6,hand=still{word}")
    recording = recorded(bus, Config(), (PromptKind.LAY_FLAT, 13.0))
    return recording.acc[recording.t > 11.0].mean(0)


@pytest.mark.parametrize(("name", "least"), [("loose", 1.0), ("knock", 0.3), ("warming", 0.01)])
def test_faults_of_the_hand_affect_chip_and_vehicle(name, least):
    assert np.linalg.norm(measured(f",fault={name}@0") - measured("")) > least
    plain, disturbed = (
        SimulatedVehicle(VehicleOptions.parse("sim:imus=1,hand=still" + word)) for word in ("", f",fault={name}@0")
    )
    for vehicle in (plain, disturbed):
        vehicle.run_until(13_000_000)
    assert np.linalg.norm(disturbed.firmware.corrected[0, 0] - plain.firmware.corrected[0, 0]) > least / 2
