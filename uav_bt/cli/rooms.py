"""Our top-level folders carry plain names: make sure that Python finds ours and nobody else's."""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import uav_bt
from uav_bt.errors import InputError

__all__ = ["ROOMS", "check_rooms"]

ROOMS: Final = ("behaviours", "perception", "sim_bridge", "trees")


def check_rooms(home: Path | None = None, rooms: Sequence[str] = ROOMS) -> None:
    """Refuse to start where another folder stands before one of ours.

    Args:
        home: the folder that holds our packages; default: the one of `uav_bt`.
        rooms: the packages' names.

    Raises:
        InputError: a package is missing or is someone else's, with what to do.
    """
    home = Path(uav_bt.__file__).resolve().parents[1] if home is None else home
    for room in rooms:
        ours = home / room
        spec = importlib.util.find_spec(room)
        found = [] if spec is None else list(spec.submodule_search_locations or [])
        if any(Path(folder).resolve() == ours for folder in found):
            continue
        if not found and (spec is None or spec.origin is None):
            raise InputError(
                f"the package '{room}' that belongs to uav-bt is not installed; reinstall uav-bt"
            )
        theirs = found[0] if found else spec.origin if spec is not None else ""
        raise InputError(
            f"Python finds '{theirs}' where uav-bt needs its own '{ours}'; rename that "
            f"'{room}', start uav-bt from another folder, or take it off PYTHONPATH"
        )
