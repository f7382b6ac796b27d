"""The MuJoCo twin of the lab: a simulated ANAFI among patterned boxes.

Nothing heavy is imported before a drone is made; `views` makes images without flying.
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
    """A flight of the twin; what the entry point `twin` registers.

    Attributes:
        scene: a shipped scene's name, or a scene file.
        seed: of everything random, 0 or more.
        profile: limits and imperfections: ideal, lab, harsh, lab-instant or harsh-instant.
        image_size_px: width and height of the video, 16:9.
        realtime: keep pace with the wall clock instead of running as fast as it can.
        movers: how many people and carts, drawn from the seed, move in the scene beside its own.
    """

    scene: str = DEFAULT_SCENE
    seed: int = 0
    profile: str = "lab"
    image_size_px: tuple[int, int] = (640, 360)
    realtime: bool = False
    movers: int = 0

    def create(self) -> TwinDrone:
        """Make a twin; nothing is built before its `connect`.

        Raises:
            InputError: the scene, the profile, the size or the machine's OpenGL cannot be used.
        """
        from sim_bridge.twin.profile import Profile  # noqa: PLC0415  (heavy imports wait)
        from sim_bridge.twin.scene_file import load_scene  # noqa: PLC0415  (heavy imports wait)
        from sim_bridge.twin.variation import with_movers  # noqa: PLC0415  (heavy imports wait)

        scene, profile = load_scene(self.scene), Profile.named(self.profile)
        if self.movers:
            scene = with_movers(scene, self.movers, self.seed)
        from sim_bridge.twin.drone import TwinDrone  # noqa: PLC0415  (imports MuJoCo)

        return TwinDrone(
            scene,
            profile=profile,
            seed=self.seed,
            image_size_px=self.image_size_px,
            realtime=self.realtime,
        )
