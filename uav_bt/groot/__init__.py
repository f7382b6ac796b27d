"""Monitoring of trees by Groot2: live protocol and log files."""

from uav_bt.groot.btlog import BtlogReader, BtlogWriter
from uav_bt.groot.groot_publisher import GrootConfig, GrootPublisher
from uav_bt.groot.numbering import TreeNumbering
from uav_bt.groot.transitions import Transition, TransitionRecorder
from uav_bt.groot.watch import TreeWatch, watched_live

__all__ = [
    "BtlogReader",
    "BtlogWriter",
    "GrootConfig",
    "GrootPublisher",
    "Transition",
    "TransitionRecorder",
    "TreeNumbering",
    "TreeWatch",
    "watched_live",
]
