"""The MuJoCo twin of the lab: a simulated ANAFI among patterned boxes.

Heavy modules are imported when a drone is made. `views` renders images without a flight.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from sim_bridge.twin.drone import TwinDrone
    from sim_bridge.twin.scene import Scene
    from sim_bridge.twin.simulated_drone import SimulatedDrone

__all__ = ["DEFAULT_SCENE", "SimulatedConfig", "TwinConfig"]

DEFAULT_SCENE = "train-a"
Made = TypeVar("Made", bound="SimulatedDrone")


@dataclass(frozen=True, kw_only=True)
class SimulatedConfig:
    """Settings of a flight in the simulated lab.

    Attributes:
        scene: name of a shipped scene, path of a scene file, or a `Scene`.
        seed: random seed of the whole flight, 0 or more.
        profile: name of the limits and imperfections: ideal, lab or harsh.
        realtime: run at wall-clock speed instead of as fast as possible.
        movers: number of random people and carts to add to the movers of the scene.
        vary_room: whether the boxes' places and sizes, and the light, are random.
    """

    scene: str | Scene = DEFAULT_SCENE
    seed: int = 0
    profile: str = "lab"
    realtime: bool = False
    movers: int = 0
    vary_room: bool = False

    def make(self, kind: type[Made], image_size_px: tuple[int, int]) -> Made:
        """Return a drone of a kind; InputError if the scene or another setting is unusable."""
        from sim_bridge.twin import profile, scene_file, variation  # noqa: PLC0415  (heavy imports)

        limits, scene = profile.Profile.named(self.profile), self.scene
        if isinstance(scene, str):
            scene = scene_file.load_scene(scene)
        return kind(
            variation.varied(scene, self.seed, room=self.vary_room, movers=self.movers),
            profile=limits,
            seed=self.seed,
            image_size_px=image_size_px,
            realtime=self.realtime,
        )


@dataclass(frozen=True, kw_only=True)
class TwinConfig(SimulatedConfig):
    """Settings of a flight in the twin; the entry point `twin` registers this class.

    Attributes:
        image_size_px: width and height of the video, pixels, 16:9.
    """

    image_size_px: tuple[int, int] = (640, 360)

    def create(self) -> TwinDrone:
        """Return a twin. Its `connect` builds the scene.

        Raises:
            InputError: the scene, the profile, the image size or the machine's OpenGL is unusable.
        """
        from sim_bridge.twin import drone, gl  # noqa: PLC0415  (import MuJoCo)

        twin = self.make(drone.TwinDrone, self.image_size_px)
        gl.choose_gl()
        return twin
