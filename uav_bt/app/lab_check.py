"""Whether a mission can be flown in a lab: settings, ceiling and area, without a drone."""

from __future__ import annotations

from uav_bt.app.loading import Mission, check_ceiling, read_mission
from uav_bt.app.options import FlightOptions
from uav_bt.app.rules import area_of, rules_of
from uav_bt.app.site import Site
from uav_bt.errors import TreeError
from uav_bt.lab.lab import Lab
from uav_bt.tree import MissionTree, NodeRegistry
from uav_bt.tree.loading.before_flight import findings_at, refused_by_lab
from uav_bt.tree.loading.uses import Uses
from uav_bt.types.place import PlaceFrame


def check_in_lab(
    tree: Mission, options: FlightOptions, registry: NodeRegistry | None = None
) -> MissionTree:
    """Load a mission with the settings of a lab, and refuse it where they do not fit.

    Args:
        tree: The mission.
        options: With the lab.
        registry: The nodes that may occur; default: all installed.

    Raises:
        InputError: The tree was refused, its leaves cannot take a setting of the lab or name what
            it does not have, it flies above the ceiling of the lab, or the areas of rules and lab
            do not fit together.
    """
    mission = read_mission(tree, options, registry)
    site, rules = options.place or Site(), rules_of(mission)
    check_ceiling(mission, site.limits)
    corners = [*(rules.area or ()), *(site.area or ())]
    # Without a take-off pose the scene may still know where the drone stands in the drawing.
    if site.take_off_pose is not None or all(each.frame is PlaceFrame.START for each in corners):
        area_of(rules, site, site.take_off_pose)
    if isinstance(lab := options.lab, Lab):
        uses = Uses(mission)
        if found := list(findings_at(uses, refused_by_lab(uses, lambda: lab))):
            raise TreeError(mission.path, found)
    return mission
