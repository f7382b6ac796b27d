"""Faults of drones, to test how missions react to them."""

from uav_bt.testing.faults.drone import FaultyDrone, find_faulty_drones
from uav_bt.testing.faults.fault import RANDOM, Fault
from uav_bt.testing.faults.table import FAULTS, FaultKind, FaultMoment, InjectedError

__all__ = [
    "FAULTS",
    "RANDOM",
    "Fault",
    "FaultKind",
    "FaultMoment",
    "FaultyDrone",
    "InjectedError",
    "find_faulty_drones",
]
