"""Contacts of the drone's body: surfaces that stop it, without a bounce and with friction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from sim_bridge.twin.body import CONTROL_STEP_S

_PUSH_MPS: Final = 1.0  # fastest way out of an overlap: the speed of the fastest mover
_SUPPORT: Final = 0.7  # least upward share of the normal of a surface that carries the body
_SWEEPS: Final = 4  # over all surfaces in a step

Vector3 = tuple[float, float, float]


class Surface(NamedTuple):
    """The plane between the hull and a solid nearby."""

    gap_m: float  # negative where they overlap
    normal: Vector3  # from the solid to the hull, world axes
    grip: float  # coefficient of friction
    speed_mps: tuple[float, float] = (0.0, 0.0)  # of the solid, world x and y


def carries(normal: Vector3) -> bool:
    """Return whether a body stands on a surface with this normal."""
    return normal[2] > _SUPPORT


def stop(velocity_mps: list[float], surfaces: Sequence[Surface]) -> bool:
    """Change a velocity so that the body enters no surface in the next control step.

    Args:
        velocity_mps: of the body, world axes; changed in place.
        surfaces: the surfaces that it may reach.

    Returns:
        Whether a surface carries the body.
    """
    carried = False
    for _ in range(_SWEEPS):
        stopped = [surface for surface in surfaces if _stop_at(velocity_mps, surface)]
        carried = carried or any(carries(surface.normal) for surface in stopped)
        if not stopped:
            break
    return carried


def _stop_at(velocity: list[float], surface: Surface) -> bool:
    """Apply one surface; return whether it changed the velocity."""
    (nx, ny, nz), (mx, my) = surface.normal, surface.speed_mps
    vx, vy, vz = velocity[0] - mx, velocity[1] - my, velocity[2]
    away = nx * vx + ny * vy + nz * vz
    push = min(-surface.gap_m / CONTROL_STEP_S, _PUSH_MPS) - away
    if push <= 0.0:
        return False
    vx, vy, vz = vx - nx * away, vy - ny * away, vz - nz * away  # along the surface
    along = math.sqrt(vx * vx + vy * vy + vz * vz)
    kept = max(0.0, 1.0 - surface.grip * push / along) if along > 0.0 else 0.0
    velocity[0] = mx + kept * vx + (away + push) * nx
    velocity[1] = my + kept * vy + (away + push) * ny
    velocity[2] = kept * vz + (away + push) * nz
    return True
