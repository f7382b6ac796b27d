"""Faults of a flight: given as texts, or drawn from its seed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from uav_bt.app.drone_of_flight import make_drone
from uav_bt.app.options import FlightOptions
from uav_bt.board import PHASE
from uav_bt.errors import InputError, UnknownNameError
from uav_bt.protocols import Drone
from uav_bt.testing.fault_kinds import FAULTS
from uav_bt.testing.faults import RANDOM, START, Fault, FaultyDrone
from uav_bt.tree import MissionTree
from uav_bt.types import MissionPhase
from uav_bt.types.commands import Phase

# Faults after which nothing is flown, or no command can land the drone.
_HOPELESS: Final = frozenset(
    {"deaf", "link-lost", "motors-cut", "no-landing", "no-take-off", "pilot", "send-raises"}
)
_COUNTS: Final = (0, 1, 2, 3)  # equally probable numbers of faults
_MOVERS: Final = (0, 0, 1)  # equally probable numbers of movers
_PHASES: Final = (
    *[MissionPhase.EXPLORE] * 3,
    *[MissionPhase.LAND] * 2,  # short, and the most depends on it
    *(MissionPhase.TAKE_OFF, MissionPhase.APPROACH, MissionPhase.CENTER),
)
_DELAY_S: Final = {MissionPhase.EXPLORE: 30.0}  # longest delay after the phase's start
_OTHER_DELAY_S: Final = 2.0
_LASTS_S: Final = (0.5, 20.0)
_STAYS: Final = 0.3  # share of the faults that last to the end
_LEVELS: Final = (0.3, 1.5)  # times the kind's default level


def drawn(options: FlightOptions) -> FlightOptions:
    """Return the options; with `RANDOM` room, movers and faults come from the seed."""
    if RANDOM not in options.faults:
        return options
    # The same for each tree, so that trees can be compared.
    # The scene's name, because one file has many paths.
    scene = make_drone(options).scene
    name = None if scene is None else scene.name
    rng = np.random.default_rng([options.seed, *f"{RANDOM} {name}".encode()])
    movers = options.movers + int(rng.choice(_MOVERS))
    faults = [_drawn_fault(rng) for _ in range(int(rng.choice(_COUNTS)))]
    given = [text for text in options.faults if text != RANDOM]
    return replace(options, vary_room=True, movers=movers, faults=(*given, *faults))


def _drawn_fault(rng: np.random.Generator) -> str:
    kinds = [kind for kind in FAULTS.values() if kind.name not in _HOPELESS]
    kind = kinds[int(rng.integers(len(kinds)))]
    phase = _PHASES[int(rng.integers(len(_PHASES)))]
    times = float(rng.uniform(*_LEVELS))
    delay_s = float(rng.uniform(0.0, _DELAY_S.get(phase, _OTHER_DELAY_S)))
    lasts_s = float(rng.uniform(*_LASTS_S))
    fault = Fault(
        kind=kind,
        level=None if kind.level is None else float(f"{times * kind.level:.2g}"),
        phase=phase,
        delay_s=round(delay_s, 1),
        duration_s=np.inf if rng.random() < _STAYS else round(lasts_s, 1),
    )
    return str(fault)


def check_faults(texts: Sequence[str]) -> list[Fault]:
    """Return the faults of texts, without `RANDOM`."""
    return [Fault.parse(text) for text in texts if text != RANDOM]


def check_phases(mission: MissionTree, faults: Sequence[Fault]) -> None:
    """Refuse faults of phases that a mission cannot have."""
    members = {str(phase) for kind in Phase.__subclasses__() for phase in kind}
    # A moving leaf that writes no phase is one by its own name.
    leaves = {leaf.name for leaf in mission.leaves() if leaf.moves and PHASE not in leaf.writes}
    known = {name.replace("_", " ") for name in (START, *members, *leaves)}
    for fault in faults:
        if fault.phase.replace("_", " ") not in known:
            raise UnknownNameError(f"phase of the fault '{fault}':", fault.phase, known)


def with_faults(drone: Drone, texts: Sequence[str]) -> Drone:
    """Return an unconnected drone with faults."""
    faults = check_faults(texts)
    if faults and drone.live:
        raise InputError("faults are for simulated drones; a real one must not get them")
    for fault in faults:
        drone = FaultyDrone(drone, fault)
    return drone
