"""Classes of the landing mark in a class map."""

from __future__ import annotations

from uav_bt.lab.classes import LabClasses
from uav_bt.lab.shipped import load_lab
from uav_bt.types import ClassMap


def classes_of(class_map: ClassMap) -> LabClasses:
    """Return the classes that a class map's ids belong to.

    Args:
        class_map: The class map.
    """
    del class_map
    return load_lab().classes
