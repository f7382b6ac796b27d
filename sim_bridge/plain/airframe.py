"""The drone's body without a physics engine: accelerations, tilt, and contacts that stop it.

In free flight it has the equations of motion of the twin's body: the demanded acceleration behind
a lag, wind, and a tilt with a critically damped response of second order.
`benchmarks/fit_airframe.py` compares the two. Contacts are inelastic, have friction and apply no
torque: in MuJoCo the body may tip over an edge, here it slides off level.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from sim_bridge.plain.contacts import Surface, Vector3, carries, stop
from sim_bridge.plain.gaps import clearance, find_near
from sim_bridge.plain.solids import Solids, solids_of
from sim_bridge.twin.body import (
    CONTROL_STEP_S,
    GRAVITY_MPS2,
    HULL_HALF_M,
    TILT_RADPS,
    Motion,
    Thrust,
    tilt_for,
)
from sim_bridge.twin.scene import Scene
from uav_bt.types import MoverState

_SUBSTEPS: Final = 0.75  # two steps of the twin move by v + 0.75 a, in units of a control step
_ROUND_M: Final = (
    0.005  # edges of the hull that touches are rounded: a direction for small overlaps
)
_TOUCH_M: Final = 0.001  # nearer solids are contacts
_NEAR_M: Final = 0.02  # reach of the search for solids, beyond twice the way of a step
_MOVER_MPS: Final = 1.0  # the fastest mover
_GRIP: Final = 1.0  # friction of a support: that of MuJoCo's geoms
_STEP_M: Final = 0.02  # a body may stand across the edge of a lower solid: the ground, a mat
_GRAVITY: Final = (0.0, 0.0, -GRAVITY_MPS2)

Vector = list[float]
_Near = tuple[int, float, Vector3]  # row of a solid, distance in m, direction


class PlainBody:
    """The drone's body among the solids of a lab; implements `Body`.

    Args:
        scene: the lab.
        lag_s: time constant from demanded to real acceleration, s.
        side_frictions: coefficients of friction at the side of a standing solid and of a mover.
            Fitted: the twin's body turns at a contact and rolls along the side.
    """

    def __init__(
        self, scene: Scene, *, lag_s: float, side_frictions: tuple[float, float] = (0.3, 0.0)
    ) -> None:
        self._solids: Solids = solids_of(scene)
        self._thrust, self._side_frictions = Thrust(lag_s), side_frictions
        self._half_m = np.array(HULL_HALF_M)
        self._core_m = self._half_m - _ROUND_M
        self._pose = np.zeros(6)
        self._found = np.zeros((len(self._solids.names), 5))
        self._mover_mps = [(0.0, 0.0)] * len(scene.movers)
        self._motors = False
        self._acceleration: Sequence[float] = _GRAVITY  # thrust and wind, world axes
        self._want = (0.0, 0.0)  # roll and pitch, rad
        self._turn_radps2 = 0.0
        self.place(0.0, 0.0, 0.0, 0.0)

    def place(self, x_m: float, y_m: float, z_m: float, yaw_rad: float) -> None:
        """Place the body at a pose, at rest and level."""
        self._at: Vector = [x_m, y_m, z_m]
        self._velocity: Vector = [0.0, 0.0, 0.0]
        self._tilt: Vector = [0.0, 0.0]  # roll and pitch, rad
        self._tilting: Vector = [0.0, 0.0]  # their rates, rad/s
        self._yaw, self._turning = yaw_rad, 0.0
        self._thrust.stop()
        self._find_near()

    def motion(self) -> Motion:
        """Return the present motion."""
        x, y, z = self._at
        vx, vy, vz = self._velocity
        roll, pitch = self._tilt
        return Motion(
            x_m=x,
            y_m=y,
            z_m=z,
            vx_mps=vx,
            vy_mps=vy,
            vz_mps=vz,
            roll_rad=roll,
            pitch_rad=pitch,
            yaw_rad=self._yaw,
            yaw_rate_radps=self._turning,
        )

    def fly(
        self,
        motion: Motion,
        demand_mps2: tuple[float, float, float],
        yaw_demand_radps2: float,
        wind_mps2: tuple[float, float, float],
    ) -> None:
        """Set the forces of the next control step; see `Body`."""
        ax, ay, az = self._thrust.follow(demand_mps2)
        self._motors = True
        self._want = tilt_for((ax, ay, az), motion.yaw_rad)
        self._acceleration = (ax + wind_mps2[0], ay + wind_mps2[1], az + wind_mps2[2])
        self._turn_radps2 = yaw_demand_radps2

    def drop(self) -> None:
        """Remove all forces: the motors are off. The body levels while it falls."""
        self._thrust.stop()
        self._motors, self._want, self._turn_radps2 = False, (0.0, 0.0), 0.0
        self._acceleration = _GRAVITY

    def place_movers(self, movers: Sequence[MoverState]) -> None:
        """Place the movers, in the order of the scene."""
        for number, mover in enumerate(movers):
            self._mover_mps[number] = mover.vx_mps, mover.vy_mps
        for row, part in enumerate(self._solids.moving, start=self._solids.first_mover):
            at = movers[part.mover].pose
            self._solids.table[row, :2] = at.x_m + part.beside_m[0], at.y_m + part.beside_m[1]

    def advance(self) -> None:
        """Advance the physics by one control step."""
        at, velocity, step_s = self._at, self._velocity, CONTROL_STEP_S
        change = [value * step_s for value in self._acceleration]
        carried = False
        if self._near:
            for axis in range(3):
                velocity[axis] += change[axis]
            carried = stop(velocity, self._surfaces())
            for axis in range(3):
                at[axis] += step_s * velocity[axis]
        else:
            for axis in range(3):
                at[axis] += step_s * (velocity[axis] + _SUBSTEPS * change[axis])
                velocity[axis] += change[axis]
        self._turn(carried=carried)
        self._find_near()

    def _turn(self, *, carried: bool) -> None:
        """Advance tilt and heading; a body that stands on something levels and does not turn."""
        step_s, rates, tilt, turning = CONTROL_STEP_S, self._tilting, self._tilt, self._turning
        want_roll, want_pitch = (0.0, 0.0) if carried else self._want
        stiff, damp = TILT_RADPS**2, 2.0 * TILT_RADPS
        roll, pitch = tilt
        # The loop damps the rates about the body's own axes, which a turn of a tilted body has too.
        rolling, pitching = (
            rates[0] + turning * math.sin(pitch),
            rates[1] - turning * math.sin(roll),
        )
        changes = (
            step_s * (stiff * (want_roll - roll) - damp * rolling),
            step_s * (stiff * (want_pitch - pitch) - damp * pitching),
        )
        for axis, change in enumerate(changes):
            tilt[axis] += step_s * (rates[axis] + _SUBSTEPS * change)
            rates[axis] += change
        change = step_s * self._turn_radps2
        if carried:
            change, turning = 0.0, 0.0
        yaw = self._yaw + step_s * (turning + _SUBSTEPS * change)
        self._yaw, self._turning = math.remainder(yaw, math.tau), turning + change

    def _surfaces(self) -> list[Surface]:
        """Return the surfaces that the body may reach in this step."""
        found, first = [], self._solids.first_mover
        for row, gap_m, normal in self._near:
            moves = first <= row < self._solids.obstacles
            mover = self._solids.moving[row - first].mover if moves else 0
            speed_mps = self._mover_mps[mover] if moves else (0.0, 0.0)
            if carries(normal):
                slope = None if self._motors else self._slope(row)
                surface = Surface(gap_m, slope or normal, 0.0 if slope else _GRIP, speed_mps)
            else:
                surface = Surface(gap_m, normal, self._side_frictions[moves], speed_mps)
            found.append(surface)
        return found

    def _slope(self, row: int) -> Vector3 | None:
        """Return the slope on which the body slides off a solid; None if its centre is above it."""
        x, y, half_x, half_y, _, top_m, cos, sin, is_round, *_ = self._solids.table[row].tolist()
        dx, dy = self._at[0] - x, self._at[1] - y
        u, v = cos * dx + sin * dy, cos * dy - sin * dx
        if is_round:
            share = max(0.0, 1.0 - half_x / max(math.hypot(u, v), half_x))
            u, v = u * share, v * share
        else:
            u, v = u - max(-half_x, min(half_x, u)), v - max(-half_y, min(half_y, v))
        out = math.hypot(u, v)
        if out == 0.0 or top_m < _STEP_M:
            return None
        share = math.sqrt(0.5) / out
        return share * (cos * u - sin * v), share * (sin * u + cos * v), math.sqrt(0.5)

    def _find_near(self) -> None:
        """Find the solids that the body may reach in the next step."""
        pose = self._pose
        pose[:] = (*self._at, *self._tilt, self._yaw)
        speed = max(map(abs, self._velocity)) + (_MOVER_MPS if self._mover_mps else 0.0)
        reach_m = _ROUND_M + _NEAR_M + 2.0 * CONTROL_STEP_S * speed
        solids = self._solids
        count = find_near(pose, self._core_m, (solids.table, solids.facets), reach_m, self._found)
        self._near: list[_Near] = [
            (int(row), gap_m - _ROUND_M, (nx, ny, nz))
            for row, gap_m, nx, ny, nz in self._found[:count].tolist()
        ]

    def contacts(self) -> tuple[str, ...]:
        """Return the names of the solids that the hull touches now, sorted."""
        if not self._near:
            return ()
        names = self._solids.names
        return tuple(sorted({names[row] for row, gap_m, _ in self._near if gap_m < _TOUCH_M}))

    def clearance_m(self) -> float:
        """Return the distance from the hull to the nearest obstacle; inf without any."""
        solids = self._solids
        table = solids.table[: solids.obstacles]
        return clearance(self._pose, self._half_m, (table, solids.facets))
