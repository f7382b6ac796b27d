"""Images of a lab without a flight, for training and evaluating networks."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sim_bridge.anafi import CAMERA_FORWARD_M, anafi_camera
from sim_bridge.twin.body import HULL_HALF_M
from sim_bridge.twin.camera import CameraPose, Optics
from sim_bridge.twin.model import build_model
from sim_bridge.twin.noise import child_seed
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.render import Renderer
from sim_bridge.twin.scene import Scene
from uav_bt.errors import ValueRangeError
from uav_bt.types import Pose2D

_HULL_RADIUS_M = math.hypot(HULL_HALF_M[0], HULL_HALF_M[1])
_MARGIN_M = 0.15  # from the hull to boxes, and from the body's centre to the ground's edge
_TRIES = 10_000
_LOWERED_DEG = (-60.0, -31.0)


@dataclass(frozen=True, kw_only=True)
class View:
    """One image with its ground truth."""

    image: NDArray[np.uint8]  # (H, W, 3) RGB
    ids: NDArray[np.uint8]  # (h, w) exact class ids of the same view
    depth: NDArray[np.float32]  # (h, w) metres along the optical axis
    pose: CameraPose


def render_views(
    scene: Scene,
    poses: Iterable[CameraPose],
    *,
    size_px: tuple[int, int] = (640, 360),
    truth_size_px: tuple[int, int] | None = None,
    profile: Profile | None = None,
    vary_light: bool = False,
    seed: int = 0,
) -> Iterator[View]:
    """Render a lab from given camera poses.

    Args:
        scene: the lab.
        poses: poses of the camera.
        size_px: width and height of the images, pixels, 16:9.
        truth_size_px: width and height of ids and depth; None: those of the images.
        profile: source of blur, exposure error and noise of the images; None: clean images.
        vary_light: change direction, strength and tint of the lamp from image to image.
        seed: seed of noise, exposure and light; the same seed gives the same images on one machine.
    """
    anafi_camera(*size_px)  # refuses other aspects
    truth_size = truth_size_px or size_px
    lab = build_model(scene)
    optics = Optics(profile, *size_px, seed) if profile is not None else None
    with Renderer(lab) as renderer:
        light = _Light(renderer, seed) if vary_light else None
        for index, pose in enumerate(poses):
            if light is not None:
                light.change(index)
            image = renderer.rgb(pose, *size_px)
            if optics is not None and profile is not None:
                error = np.random.default_rng(child_seed(seed, 7, index)).standard_normal()
                image = optics.degrade(image, index, 1.0 + profile.exposure_std * float(error))
            ids, depth = renderer.ids_and_depth(pose, *truth_size)
            yield View(image=image, ids=ids, depth=depth, pose=pose)


class _Light:
    """Varies the lamps of a renderer around their original values."""

    def __init__(self, renderer: Renderer, seed: int) -> None:
        self._lights = list(renderer.scene.lights[: renderer.scene.nlight])
        self._kept = [
            (np.array(light.dir), np.array(light.ambient), np.array(light.diffuse))
            for light in self._lights
        ]
        self._seed = seed

    def change(self, index: int) -> None:
        generator = np.random.default_rng(child_seed(self._seed, 8, index))
        strength = generator.uniform(0.75, 1.15)
        balance = generator.uniform(0.6, 1.4)  # balance between ambient light and lamps
        tint = 1.0 + generator.uniform(-0.03, 0.03, 3)
        for light, (direction, ambient, diffuse) in zip(self._lights, self._kept, strict=True):
            turned = direction + generator.normal(0.0, 0.25, 3)
            turned[2] = min(turned[2], -0.3)
            light.dir[:] = turned / np.linalg.norm(turned)
            light.ambient[:] = np.clip(ambient * strength * tint / balance**0.3, 0.0, 1.0)
            light.diffuse[:] = np.clip(diffuse * strength * tint * balance, 0.0, 1.0)


def sample_flight_poses(
    scene: Scene, generator: np.random.Generator, count: int, *, lowered: float = 0.0
) -> list[CameraPose]:
    """Return random camera poses like those of a flight.

    Six of seven are anywhere above the ground, mostly at 1.5 m, and look ahead and 25 to 30 degrees
    down. The seventh is near the mark and looks steeply down, as before a landing.

    The share `lowered` of the six has a further lowered camera, as at the ground's edge. The hull
    keeps clear of the objects.
    """
    has_pad = scene.helipad is not None
    poses = [
        _sample_pose(scene, generator, landing=has_pad and index % 7 == 6) for index in range(count)
    ]
    if lowered:  # sampled last, so that positions and headings do not depend on it
        chosen = generator.random(count) < lowered
        pitches_rad = np.radians(generator.uniform(*_LOWERED_DEG, count))
        for index in np.flatnonzero(chosen).tolist():
            if index % 7 != 6:
                poses[index] = replace(poses[index], pitch_rad=float(pitches_rad[index]))
    return poses


def _sample_pose(scene: Scene, generator: np.random.Generator, *, landing: bool) -> CameraPose:
    edge_m = _from_edge_m(scene)
    half_x, half_y = (side / 2 - edge_m for side in scene.ground.size_m)
    for _ in range(_TRIES):
        if landing:
            x, y = generator.normal(scene.pads[0].position_m, 0.3)
            z = generator.uniform(0.9, 2.0)
            pitch = math.radians(
                generator.uniform(-90.0, -55.0) if generator.random() < 0.5 else -90
            )
        else:
            x, y = generator.uniform((-half_x, -half_y), (half_x, half_y))
            usual = generator.random() < 0.75
            z = generator.normal(1.5, 0.05) if usual else generator.uniform(0.9, 1.7)
            pitch = math.radians(generator.uniform(-31.0, -24.0))
        yaw = generator.uniform(-math.pi, math.pi)
        lens = Pose2D(x_m=x, y_m=y, yaw_rad=yaw).to_world(CAMERA_FORWARD_M, 0.0)
        inside = abs(x) <= half_x and abs(y) <= half_y
        if scene.ground.outline_m:
            inside = scene.ground.margin_m(x, y) >= edge_m
        if inside and _is_free(scene, ((x, y), lens), z):
            return CameraPose(
                x_m=float(lens[0]),
                y_m=float(lens[1]),
                z_m=float(z),
                yaw_rad=float(yaw),
                pitch_rad=float(pitch),
            )
    raise ValueRangeError(f"scene '{scene.name}': the boxes leave no room to fly; remove some")


def _from_edge_m(scene: Scene) -> float:
    """Return the least distance of the body's centre from the edge of the ground.

    The hull may pass over the edge, unless walls stand there.
    """
    (wide_m, deep_m, _), (x_m, y_m) = scene.room_size_m, scene.ground.size_m
    beside_m = min(wide_m - x_m, deep_m - y_m) / 2
    return max(_MARGIN_M, _HULL_RADIUS_M + _MARGIN_M - beside_m)


def _is_free(scene: Scene, points: Sequence[tuple[float, float]], z_m: float) -> bool:
    reach = _HULL_RADIUS_M + _MARGIN_M
    (centre, lens) = points
    return all(
        z_m > block.top_m + reach
        or z_m < block.base_m - reach
        or (
            block.footprint.distance_m(*centre) > reach and block.footprint.distance_m(*lens) > 0.05
        )
        for item in scene.standing.values()
        for block in item.blocks
    )
