"""Helpers of the twin's tests: flights without images, and a ray caster as independent truth."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.drone import TwinDrone
from sim_bridge.twin.scene import Scene
from uav_bt.types import Command, Movement, Observation
from uav_bt.types.ground import Footprint


def fly(drone: TwinDrone, movement: Movement, duration_s: float) -> Observation:
    """Send a movement at each tick for a time, without images; return the last observation."""
    end = drone.clock.now() + duration_s
    while drone.clock.now() < end - 1e-6:
        drone.send(Command(movement=movement))
        drone.clock.sleep_until(drone.clock.now() + 0.1)
    return drone.observe()


def cast_rays(
    scene: Scene, pose: CameraPose, pixels: NDArray[np.float64], size_px: tuple[int, int]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return class id and depth along the optical axis for pixels (N, 2), from geometry only."""
    camera = anafi_camera(*size_px)
    axis, up = (np.array(v) for v in pose.axes())
    right = np.cross(axis, up)
    origin = np.array((pose.x_m, pose.y_m, pose.z_m))
    ids = np.zeros(len(pixels), np.int64)
    depth = np.full(len(pixels), np.inf)
    for index, (u, v) in enumerate(pixels):
        ray = (
            axis
            + right * (u - camera.cx_px) / camera.fx_px
            - up * (v - camera.cy_px) / camera.fy_px
        )
        ids[index], depth[index] = _cast(scene, origin, ray)
    return ids, depth


def _cast(scene: Scene, origin: NDArray[np.float64], ray: NDArray[np.float64]) -> tuple[int, float]:
    half = np.array(scene.room_size_m[:2]) / 2
    best, found = math.inf, 0
    walls = [(half[k] * np.sign(ray[k]) - origin[k]) / ray[k] for k in (0, 1) if ray[k]]
    best = min(walls, default=math.inf)
    if ray[2] > 0.0:
        best = min(best, (scene.room_size_m[2] - 0.004 - origin[2]) / ray[2])
    else:
        best = min(best, (-0.004 - origin[2]) / ray[2])
        t = -origin[2] / ray[2]
        x, y = (origin + t * ray)[:2]
        if scene.ground_plan.contains(x, y) and t < best:
            best, found = t, 1
    pad = scene.helipad
    things = [
        (each.footprint, each.standing.height_m, each.shape.class_id, each.shape.top_class)
        for each in scene.placed
    ]
    things.append((pad.footprint, pad.size_m[2], 3, 2))
    for footprint, height, side_id, top_id in things:
        t, local = _enter_box(footprint, height, origin, ray)
        if t < best:
            best = t
            on_top = abs((origin + t * ray)[2] - height) < 1e-6
            found = top_id if on_top else side_id
            if top_id == 2 and on_top:
                within = np.abs(local) <= 0.8 * np.array(pad.size_m[:2]) / 2
                found = 2 if within.all() else 3
    return found, best


def _enter_box(
    footprint: Footprint, height: float, origin: NDArray[np.float64], ray: NDArray[np.float64]
) -> tuple[float, NDArray[np.float64]]:
    start = np.array((*footprint.to_body(origin[0], origin[1]), origin[2]))
    tip = np.array((*footprint.to_body(*(origin + ray)[:2]), (origin + ray)[2]))
    step = tip - start
    low = np.array((-footprint.half_x_m, -footprint.half_y_m, 0.0))
    high = np.array((footprint.half_x_m, footprint.half_y_m, height))
    with np.errstate(divide="ignore"):
        a, b = (low - start) / step, (high - start) / step
    enter, leave = np.minimum(a, b).max(), np.maximum(a, b).min()
    if enter > leave or enter <= 0.0:
        return math.inf, start[:2]
    return float(enter), (start + enter * step)[:2]
