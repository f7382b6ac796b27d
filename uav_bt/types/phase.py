"""Phases of a mission: what the report, the films and the status line tell apart."""

from __future__ import annotations

import enum


class Phase(enum.StrEnum):
    """Base of all phases; a plug-in derives an enumeration with members of its own from it.

    Example:
        >>> class SurveyPhase(Phase):
        ...     MAP = "map"
    """


class MissionPhase(Phase):
    """The phases of the missions that ship; the flight report takes its times from them."""

    TAKE_OFF = "take-off"
    EXPLORE = "explore"
    SEARCH = "search"  # exploration is over, the landing mark is not in view yet
    APPROACH = "approach"  # the landing mark was found
    CENTER = "center"
    LAND = "land"
    LOOK = "look"
    HOVER = "hover"
    EMERGENCY_LANDING = "emergency landing"
