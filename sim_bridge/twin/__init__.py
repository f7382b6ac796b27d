"""The MuJoCo twin of the lab: a simulated ANAFI among patterned boxes.

Nothing heavy is imported before a drone is made; `create_drone` is the entry point, `views` makes
pictures without flying.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from uav_bt.protocols import DroneOptions

if TYPE_CHECKING:
    from sim_bridge.twin.drone import TwinDrone

__all__ = ["DEFAULT_SCENE", "create_drone"]

DEFAULT_SCENE = "train-a"


def create_drone(options: DroneOptions) -> TwinDrone:
    """Make a twin; nothing is built before its `connect`.

    Args:
        options: scene (name or file), seed, profile, image size and pace.

    Raises:
        InputError: the scene, the profile, the size or the machine's OpenGL cannot be used.
    """
    from sim_bridge.twin.profile import Profile  # noqa: PLC0415  (heavy imports wait)
    from sim_bridge.twin.scene_file import load_scene  # noqa: PLC0415  (heavy imports wait)

    scene = load_scene(options.scene if options.scene is not None else DEFAULT_SCENE)
    profile = Profile.named(options.profile)
    from sim_bridge.twin.drone import TwinDrone  # noqa: PLC0415  (imports MuJoCo)

    return TwinDrone(
        scene,
        profile=profile,
        seed=options.seed,
        image_size_px=options.image_size_px,
        realtime=options.realtime,
    )
