"""The segmentation network that a lab is flown with, and whether a flight has it."""

from __future__ import annotations

from perception.networks.weights_file import ANY, SHIPPED_UNET, TEACHER
from uav_bt.board import CLASS_MAP
from uav_bt.errors import InputError
from uav_bt.lab.flight_keys import NetworkKeys
from uav_bt.lab.lab import Lab
from uav_bt.lab.shipped import lab_address, load_lab
from uav_bt.tree import MissionTree


def network_of(lab: Lab) -> NetworkKeys:
    """Return the networks that a lab is flown with; empty for those that the tree names.

    They are the lab's own, else those for any room. A lab with the classes of the paper's lab is
    flown with the tree's networks: the shipped depth network has seen that lab only.

    Args:
        lab: The lab.
    """
    if _has_paper_classes(lab):
        return lab.network
    return {"model": ANY, "depth": ANY, **lab.network}


def _has_paper_classes(lab: Lab) -> bool:
    return lab.classes.names == load_lab().classes.names


def refuse_foreign_network(mission: MissionTree, lab: Lab | None, *, named: bool) -> None:
    """Refuse a mission that would segment with a shipped network of other classes.

    Args:
        mission: The tree, with the values of the lab.
        lab: Lab of the flight; None without one.
        named: Whether the options name the lab, and not only the scene.

    Raises:
        InputError: A leaf segments with a shipped network, which does not have the lab's classes.
    """
    if lab is None or _has_paper_classes(lab):
        return
    for leaf in mission.leaves():
        values = {port.name: leaf.initial_value(port) for port in leaf.ports}
        shipped = values.get("model") in (SHIPPED_UNET, TEACHER)
        if CLASS_MAP not in leaf.writes or not shipped or values.get("classes"):
            continue
        address = lab_address(lab)
        if not named:
            raise InputError(
                f"'{leaf.path}' segments with the network '{values['model']}', which does not have "
                f"the classes of the lab '{lab.name}': add --lab {address} for the lab's network"
            )
        raise InputError(
            f"'{leaf.path}' segments with the network '{values['model']}', which does not have "
            f"the classes of the lab '{lab.name}': set its model to '{ANY}', or make a network by "
            f"`uav-bt lab train {address}`"
        )
