"""Where things stand in a Rerun recording: entity paths, and the one timeline."""

from __future__ import annotations

from typing import Final

TIMELINE: Final = "flight"  # seconds since the first tick

WORLD: Final = "world"  # z up, the origin in the carpet's middle, metres
LAB: Final = f"{WORLD}/lab"
PATH: Final = f"{WORLD}/path"
BODY: Final = f"{WORLD}/drone"
CORRIDOR: Final = f"{WORLD}/corridor"  # in the heading-aligned frame: x forward, y left, z up
OBSTACLES: Final = f"{WORLD}/obstacles"
FIX: Final = f"{WORLD}/helipad_fix"
LENS: Final = f"{WORLD}/camera"  # image and overlays, in the image's pixels
DEPTH_LENS: Final = f"{WORLD}/depth"  # the same lens at the depth map's size
MASK: Final = "mask"
TREE: Final = "tree"
WORDS: Final = "words"
HEADING: Final = "plots/heading"
HEIGHT: Final = "plots/height"
FREE_DISTANCE: Final = "plots/free_distance"
TICK_TIME: Final = "plots/tick_time"
