"""Rigid body of the simulated drone in MuJoCo.

Single rotors are not modelled. The body gets the force that a quadrotor with an attitude loop would
produce: the demanded acceleration behind a first-order lag. It tilts as that force requires.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import mujoco

from sim_bridge.twin.body import GRAVITY_MPS2, TILT_RADPS, Motion, Thrust, tilt_for
from sim_bridge.twin.builder import HULL_MASS_KG, STEPS_PER_CONTROL, LabModel
from uav_bt.types import MoverState, rotate
from uav_bt.types.pose import clamp

_FAR_M: Final = 100.0  # larger than any room, m


class FlyingBody:
    """The drone's body in MuJoCo; implements `Body`.

    Args:
        lab: the compiled scene.
        lag_s: time constant from demanded to real acceleration, s.
    """

    def __init__(self, lab: LabModel, *, lag_s: float) -> None:
        self._model = lab.model
        self.data: Any = mujoco.MjData(lab.model)
        self._position = self.data.qpos[:7]
        self._velocity = self.data.qvel[:6]
        self._wrench = self.data.xfrc_applied[lab.hull_body]
        self._inertia = [float(value) for value in lab.model.body_inertia[lab.hull_body]]
        self._hull = lab.hull_geom
        self._obstacles = lab.obstacle_geoms
        self._thrust = Thrust(lag_s)
        self._names = [lab.contact_name(index) for index in range(lab.model.ngeom)]

    def place(self, x_m: float, y_m: float, z_m: float, yaw_rad: float) -> None:
        """Place the body at a pose, at rest and level."""
        half = yaw_rad / 2.0
        self._position[:] = (x_m, y_m, z_m, math.cos(half), 0.0, 0.0, math.sin(half))
        self._velocity[:] = 0.0
        self._thrust.stop()
        mujoco.mj_forward(self._model, self.data)

    def motion(self) -> Motion:
        """Return the present motion."""
        x, y, z, qw, qx, qy, qz = self._position.tolist()
        vx, vy, vz, _, wy, wz = self._velocity.tolist()
        sine = clamp(2.0 * (qw * qy - qz * qx), 1.0)
        roll = math.atan2(2.0 * (qw * qx + qy * qz), 1.0 - 2.0 * (qx * qx + qy * qy))
        yaw = math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
        pitch_down = math.asin(sine)
        yaw_rate = (wy * math.sin(roll) + wz * math.cos(roll)) / max(0.1, math.cos(pitch_down))
        return Motion(
            x_m=x,
            y_m=y,
            z_m=z,
            vx_mps=vx,
            vy_mps=vy,
            vz_mps=vz,
            roll_rad=roll,
            pitch_rad=-pitch_down,
            yaw_rad=yaw,
            yaw_rate_radps=yaw_rate,
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
        want_roll, want_pitch = tilt_for((ax, ay, az), motion.yaw_rad)
        wx, wy = self._velocity[3:5].tolist()
        stiff, damp = TILT_RADPS**2, 2.0 * TILT_RADPS
        torque_x = self._inertia[0] * (stiff * (want_roll - motion.roll_rad) - damp * wx)
        torque_y = self._inertia[1] * (stiff * (motion.pitch_rad - want_pitch) - damp * wy)
        torque_z = self._inertia[2] * yaw_demand_radps2
        mass = HULL_MASS_KG
        self._wrench[:] = (
            mass * (ax + wind_mps2[0]),
            mass * (ay + wind_mps2[1]),
            mass * (az + GRAVITY_MPS2 + wind_mps2[2]),
            *rotate(torque_x, torque_y, motion.yaw_rad),
            torque_z,
        )

    def drop(self) -> None:
        """Remove all forces: the motors are off."""
        self._thrust.stop()
        self._wrench[:] = 0.0

    def place_movers(self, movers: Sequence[MoverState]) -> None:
        """Place the movers, in the order of the scene."""
        for row, mover in enumerate(movers):
            self.data.mocap_pos[row, :2] = mover.pose.x_m, mover.pose.y_m

    def advance(self) -> None:
        """Advance the physics by one control step."""
        mujoco.mj_step(self._model, self.data, nstep=STEPS_PER_CONTROL)

    def contacts(self) -> tuple[str, ...]:
        """Return the names of the objects that the hull touches now, sorted."""
        count = self.data.ncon
        if not count:
            return ()
        pairs = self.data.contact.geom[:count].tolist()
        hull = self._hull
        others = {self._names[a if b == hull else b] for a, b in pairs if hull in (a, b)}
        return tuple(sorted(others))

    def clearance_m(self) -> float:
        """Return the distance from the hull to the nearest obstacle; inf without any."""
        model, data, hull = self._model, self.data, self._hull
        mujoco.mj_kinematics(model, data)
        nearest = _FAR_M
        for geom in self._obstacles:
            nearest = min(nearest, mujoco.mj_geomDistance(model, data, hull, geom, nearest, None))
        return max(0.0, nearest) if self._obstacles else math.inf
