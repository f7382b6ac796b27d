"""Short descriptions of flights, commands and readings."""

from __future__ import annotations

import math
from pathlib import Path

from uav_bt import types
from uav_bt.mission.flight_report import FlightReport

_NOTHING = 5e-3  # m and m/s; smaller parts are not shown
_NO_TURN_RAD = math.radians(0.5)
_WHOLE: dict[type[types.Movement], str] = {
    types.TakeOff: "take off",
    types.Land: "land",
    types.Hover: "hover",
    types.CutMotors: "cut the motors",
    types.Release: "released to the pilot",
}
_DIRECTIONS = (("forward", "back"), ("right", "left"), ("down", "up"))


def describe_flight(tree: str, *, scene: str | None, drone: str, seed: int) -> str:
    """Return the mission and where it is flown; a real drone has no scene."""
    mission = Path(tree).stem
    return f"{mission} with {drone}" if scene is None else f"{mission} in {scene}, seed {seed}"


def lands_on_mark(report: FlightReport, mark: types.LandingMark) -> bool:
    """Return whether a flight searched or reached the mark."""
    error_m = report.landing_error_m
    on_pad = error_m is not None and error_m <= mark.radius_m
    return on_pad or report.time_to_find_mark_s is not None


def describe_movement(movement: types.Movement) -> str:
    """Return a movement in words; small parts are omitted."""
    match movement:
        case types.MoveBy():
            verb, unit, turn = "move", "m", "deg"
            along = (movement.forward_m, movement.right_m, movement.down_m)
            yaw_rad = movement.yaw_rad
        case types.Velocity():
            verb, unit, turn = "fly", "m/s", "deg/s"
            along = (movement.forward_mps, movement.right_mps, movement.down_mps)
            yaw_rad = movement.yaw_rate_radps
        case _:
            return _WHOLE[type(movement)]
    steps = ", ".join(
        f"{abs(value):.2f} {unit} {names[value < 0]}"
        for value, names in zip(along, _DIRECTIONS, strict=True)
        if abs(value) >= _NOTHING
    )
    words = [f"{verb} {steps}"] if steps else []
    if abs(yaw_rad) >= _NO_TURN_RAD:
        side = "right" if yaw_rad > 0 else "left"
        words.append(f"turn {abs(math.degrees(yaw_rad)):.0f} {turn} {side}")
    return ", ".join(words) or "hold"


def describe_fix(fix: types.MarkFix | None, age_s: float) -> str:
    """Return where a mark is, and whether it is seen or carried."""
    if fix is None:
        return "none" if math.isinf(age_s) else f"none for {age_s:.0f} s"
    bearing_deg = math.degrees(fix.bearing_rad)
    side = "right" if bearing_deg >= 0 else "left"
    source = "seen" if fix.detected else f"carried {age_s:.1f} s"
    return f"{fix.range_m:.2f} m, {abs(bearing_deg):.0f} deg {side}, {source}"


def describe_corridor(corridor: types.Corridor) -> str:
    """Return the side and the distance of the nearest intrusion into the corridor."""
    if corridor.nearest_side is None:
        return "corridor clear"
    return f"intrusion {corridor.nearest_side}, {corridor.nearest_m:.2f} m"


def describe_free(corridor: types.Corridor) -> str:
    """Return the free distance ahead."""
    if math.isinf(corridor.free_distance_m):
        return "nothing ahead"
    words = f"free {corridor.free_distance_m:.2f} m ahead"
    if math.isfinite(corridor.time_to_impact_s):
        words += f", impact in {corridor.time_to_impact_s:.1f} s"
    return words
