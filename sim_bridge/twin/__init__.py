"""The MuJoCo twin of the lab: a simulated ANAFI among patterned boxes.

Heavy modules are imported when a drone is made. `views` renders images without a flight.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sim_bridge.twin.drone import TwinDrone

__all__ = ["DEFAULT_SCENE", "TwinConfig"]

DEFAULT_SCENE = "train-a"


@dataclass(frozen=True, kw_only=True)
class TwinConfig:
    """Settings of a flight in the twin; the entry point `twin` registers this class.

    Attributes:
        scene: name of a shipped scene, or path of a scene file.
        seed: random seed of the whole flight, 0 or more.
        profile: name of the limits and imperfections: ideal, lab or harsh.
        image_size_px: width and height of the video, pixels, 16:9.
        realtime: run at wall-clock speed instead of as fast as possible.
        movers: number of random people and carts to add to the movers of the scene.
        vary_room: whether the boxes' places and sizes, and the light, are random.
    """

    scene: str = DEFAULT_SCENE
    seed: int = 0
    profile: str = "lab"
    image_size_px: tuple[int, int] = (640, 360)
    realtime: bool = False
    movers: int = 0
    vary_room: bool = False

    def create(self) -> TwinDrone:
        """Return a twin. Its `connect` builds the scene.

        Raises:
            InputError: the scene, the profile, the image size or the machine's OpenGL is unusable.
        """
        from sim_bridge.twin import profile, scene_file, variation  # noqa: PLC0415  (heavy imports)

        limits, scene = profile.Profile.named(self.profile), scene_file.load_scene(self.scene)
        scene = variation.varied(scene, self.seed, room=self.vary_room, movers=self.movers)
        from sim_bridge.twin import drone, gl  # noqa: PLC0415  (import MuJoCo)

        gl.choose_gl()
        return drone.TwinDrone(
            scene,
            profile=limits,
            seed=self.seed,
            image_size_px=self.image_size_px,
            realtime=self.realtime,
        )
