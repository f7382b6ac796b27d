"""The classes of a lab: their names, roles and colours.

A class map holds class ids. What an id means is a property of the lab, so that code which flies
works on roles. Tables are arrays of 256 entries, indexed by class id.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Final, Literal, Self

import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import UnknownNameError, ValueRangeError

Colour = tuple[int, int, int]  # red, green, blue, 0 to 255

MAX_CLASSES: Final = 64
_ROLE_COLOURS: Final[dict[RoleName, Colour]] = {
    "outside": (40, 40, 48),
    "ground": (126, 158, 120),
    "mark": (255, 196, 0),
    "obstacle": (214, 39, 40),
}


@dataclass(frozen=True, kw_only=True)
class LabClass:
    """One class of a lab."""

    name: str  # in files, reports and messages
    role: RoleName
    colour: Colour  # in images of class maps
    top: str | None = None  # class of the level upper face, if that is another one
    # Largest distance between two legs of an object, from corner to corner; None: without legs.
    legs_m: float | None = None


class LabClasses:
    """The classes of a lab in the order of their ids; the first one, id 0, lies outside."""

    def __init__(self, classes: Iterable[LabClass]) -> None:
        self._classes = tuple(classes)
        self.names: Final = tuple(each.name for each in self._classes)
        self._check()

    @classmethod
    def by_role(cls) -> Self:
        """Return one class for each role, with the ids and names of the roles."""
        return cls(
            LabClass(name=each, role=each, colour=_ROLE_COLOURS[each]) for each in ROLE_NAMES
        )

    def __eq__(self, other: object) -> bool:
        return isinstance(other, LabClasses) and self._classes == other._classes

    def __hash__(self) -> int:
        return hash(self._classes)

    def __len__(self) -> int:
        return len(self._classes)

    def __iter__(self) -> Iterator[LabClass]:
        return iter(self._classes)

    def __repr__(self) -> str:
        return f"<{len(self)} classes>"

    def id_of(self, name: str) -> int:
        """Return the id of a class; a name that is none is refused with the closest one."""
        if name not in self.names:
            raise UnknownNameError("class", name, self.names)
        return self.names.index(name)

    def of_role(self, role: int) -> tuple[int, ...]:
        """Return the ids of the classes with a role."""
        return tuple(np.flatnonzero(self._roles[: len(self)] == role).tolist())

    @cached_property
    def colours(self) -> NDArray[np.uint8]:
        """(number of classes, 3) uint8 RGB: the colour of each class."""
        return np.array([each.colour for each in self._classes], dtype=np.uint8)

    @cached_property
    def top_of(self) -> NDArray[np.uint8]:
        """(number of classes,) uint8: the class of the upper face of each class; 0 without one."""
        ids = [0 if each.top is None else self.id_of(each.top) for each in self._classes]
        return np.array(ids, dtype=np.uint8)

    @cached_property
    def tops(self) -> tuple[int, ...]:
        """The ids of the classes of upper faces."""
        return tuple(sorted({int(each) for each in self.top_of if each}))

    @cached_property
    def standing(self) -> tuple[int, ...]:
        """The ids of the obstacles whose base meets the ground: all but upper faces."""
        return tuple(each for each in self.of_role(OBSTACLE) if each not in self.tops)

    @cached_property
    def legs_m(self) -> NDArray[np.float64]:
        """(number of classes,): largest distance between legs of an object, m; 0 without legs."""
        return np.array([each.legs_m or 0.0 for each in self._classes])

    @cached_property
    def mark_sides(self) -> int | None:
        """The id of the sides of the box that carries the mark; None without such a class."""
        return next((each for each in self.of_role(MARK) if self.top_of[each]), None)

    @cached_property
    def mark_top(self) -> int | None:
        """The id of the top of the landing mark; None without a class for it."""
        if self.mark_sides is not None:
            return int(self.top_of[self.mark_sides])
        return next(iter(self.of_role(MARK)), None)

    @cached_property
    def ground(self) -> int:
        """The id of the first class that is ground."""
        for first in self.of_role(GROUND):
            return first
        raise ValueRangeError("no class has the role ground")

    def with_one_ground(self, ids: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return class ids with the first ground class in place of all ground classes."""
        grounds = self.of_role(GROUND)
        if len(grounds) <= 1:
            return ids
        table = np.arange(256, dtype=np.uint8)
        table[list(grounds)] = grounds[0]
        return table[ids]

    def roles(self, ids: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return the roles of class ids, both uint8 of any shape; refuse an id without a class."""
        if ids.dtype != np.uint8:
            raise ValueRangeError(f"class ids must be uint8, got {ids.dtype}")
        roles = self._roles.take(ids)
        if roles.size and int(roles.max()) == NO_ROLE:
            raise ValueRangeError(f"class ids must be 0 to {len(self) - 1}, got {int(ids.max())}")
        return roles

    def colourise(self, ids: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return a class map, (H, W) uint8 ids, as a colour image, (H, W, 3) uint8 RGB."""
        self.roles(ids)  # refuses bad ids
        return self.colours[ids]

    @cached_property
    def _roles(self) -> NDArray[np.uint8]:
        """(256,) uint8: a bad id is found after the look-up, without a second pass over a map."""
        table = np.full(256, NO_ROLE, dtype=np.uint8)
        table[: len(self)] = [ROLE_NAMES.index(each.role) for each in self._classes]
        return table

    def _check(self) -> None:
        if not 1 <= len(self._classes) <= MAX_CLASSES:
            raise ValueRangeError(f"expected 1 to {MAX_CLASSES} classes, got {len(self._classes)}")
        twice = [name for name in self.names if self.names.count(name) > 1]
        if twice:
            raise ValueRangeError(f"the class '{twice[0]}' is listed twice")
        first, tops = self._classes[0], {each.top for each in self._classes}
        if first.role != "outside":
            got = f"'{first.name}' has the role {first.role}"
            raise ValueRangeError(f"the first class, of unknown pixels, must be outside; {got}")
        for each in self._classes:
            if each.legs_m is not None and (each.role != "obstacle" or each.name in tops):
                why = "only an obstacle that is no upper face can; remove its legs_m"
                raise ValueRangeError(f"'{each.name}' cannot stand on legs: {why}")
            top = each if each.top is None else self._classes[self.id_of(each.top)]
            if top.role != each.role or top.top is not None:
                why = "it must have the same role and no top"
                raise ValueRangeError(f"'{top.name}' cannot be the top of '{each.name}': {why}")


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
