"""Monitoring of trees by Groot2: live protocol and log files."""

from uav_bt.groot.watch import watched_live as watched_live
