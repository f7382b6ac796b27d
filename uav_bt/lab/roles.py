"""The four roles that a class can have for a mission."""

from __future__ import annotations

from typing import Final, Literal

RoleName = Literal["outside", "ground", "mark", "obstacle"]

OUTSIDE: Final = 0
GROUND: Final = 1
MARK: Final = 2
OBSTACLE: Final = 3

ROLE_NAMES: Final[tuple[RoleName, ...]] = ("outside", "ground", "mark", "obstacle")
"""Name of each role by its id.

outside   Nothing to fly over: walls, and the floor beyond the flight area.
ground    The plane that the drone flies over and by which depth is scaled.
mark      The landing mark and what carries it.
obstacle  Everything that the drone must not touch.

The roles are the four categories of Mocanu et al. (arXiv 2510.16624).
"""

NO_ROLE: Final = 255  # of a sample outside the image: neither a class nor a role
