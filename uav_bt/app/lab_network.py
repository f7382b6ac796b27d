"""Whether a flight in a lab has a segmentation network for the classes there."""

from __future__ import annotations

from perception.networks.named import SHIPPED_UNETS, TEACHER
from uav_bt.board import CLASS_MAP
from uav_bt.errors import InputError
from uav_bt.lab.lab import Lab
from uav_bt.lab.shipped import lab_address, load_lab
from uav_bt.tree import MissionTree


def refuse_foreign_network(mission: MissionTree, lab: Lab | None, *, named: bool) -> None:
    """Refuse a mission that would segment with a shipped network of other classes.

    Args:
        mission: The tree, with the values of the lab.
        lab: Lab of the flight; None without one.
        named: Whether the options name the lab, and not only the scene.

    Raises:
        InputError: A leaf segments with a shipped network, which does not have the lab's classes.
    """
    if lab is None or lab.classes.names == load_lab().classes.names:
        return
    for leaf in mission.leaves():
        values = {port.name: leaf.initial_value(port) for port in leaf.ports}
        shipped = values.get("model") in (*SHIPPED_UNETS, TEACHER)
        if CLASS_MAP not in leaf.writes or not shipped or values.get("classes"):
            continue
        address = lab_address(lab)
        if not named and lab.network:
            raise InputError(
                f"'{leaf.path}' segments with the network '{values['model']}', which does not have "
                f"the classes of the lab '{lab.name}': add --lab {address} for the lab's network"
            )
        raise InputError(
            f"the lab '{lab.name}' has no segmentation network, and the shipped "
            f"'{values['model']}' does not have its classes: `uav-bt lab train {address}` makes "
            "one; in the twin --exact-masks flies without it"
        )
