"""A simulated drone without images, for mission tests and many flights.

Physics, autopilot, telemetry, movers and noise are the twin's. Class maps, depth and the motion
over the ground come from ray casting, with the errors of the networks. OpenGL is not needed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sim_bridge.plain.drone import PlainDrone
    from sim_bridge.twin.scene import Scene

__all__ = ["PlainConfig"]


@dataclass(frozen=True, kw_only=True)
class PlainConfig:
    """Settings of a flight without images; the entry point `plain` registers this class.

    They are those of `TwinConfig`; the scene may also be a `Scene`.
    """

    scene: str | Scene = "train-a"
    seed: int = 0
    profile: str = "lab"
    realtime: bool = False
    movers: int = 0
    vary_room: bool = False

    def create(self) -> PlainDrone:
        """Return a drone. Its `connect` builds the scene.

        Raises:
            InputError: the scene or the profile is unusable.
        """
        from sim_bridge.twin import profile, scene_file, variation  # noqa: PLC0415  (heavy imports)

        limits, scene = profile.Profile.named(self.profile), self.scene
        if isinstance(scene, str):
            scene = scene_file.load_scene(scene)
        scene = variation.varied(scene, self.seed, room=self.vary_room, movers=self.movers)
        from sim_bridge.plain import drone  # noqa: PLC0415  (imports MuJoCo)

        return drone.PlainDrone(
            scene,
            profile=limits,
            seed=self.seed,
            image_size_px=drone.SIZE_PX,
            realtime=self.realtime,
        )
