"""Monitoring of trees by Groot2: live protocol and log files."""

from uav_bt.groot.btlog import BtlogWriter
from uav_bt.groot.groot_publisher import GrootPublisher
from uav_bt.groot.numbering import TreeNumbering
from uav_bt.groot.transitions import Transition, TransitionRecorder
from uav_bt.groot.watch import TreeWatch, watched_live

__all__ = [
    "BtlogWriter",
    "GrootPublisher",
    "Transition",
    "TransitionRecorder",
    "TreeNumbering",
    "TreeWatch",
    "watched_live",
]
