"""The command that flies a flight of a campaign."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import PurePosixPath
from typing import Any

from uav_bt.app.options import FlightOptions
from uav_bt.campaign.report.sources import FlightSet
from uav_bt.campaign.store import file_stem, key_of
from uav_bt.lab.lab import Lab
from uav_bt.lab.shipped import lab_address


def repeat_command(one: FlightSet, flight: Mapping[str, Any]) -> str:
    """Return the command that flies a flight of a set again."""
    scene = None if flight["scene"] is None else one.scene_path(flight["scene"])
    options = FlightOptions() if one.plan is None else one.plan.options
    out = PurePosixPath(flight.get("folder") or file_stem(key_of(flight))).name
    return fly_command(one.tree_path(), scene, flight, options, out=out)


def fly_command(
    tree: str, scene: str | None, flight: Mapping[str, Any], options: FlightOptions, *, out: str
) -> str:
    """Return the `uav-bt fly` command of a flight.

    `flight` has what was drawn or changed for it, by the names in a flight's line, and `options`
    say how its campaign was flown. Leaves that write files need the output folder.
    """
    drone, folders, limit_s = flight.get("drone"), options.tree_folders, options.judge.time_limit_s
    is_default_size = options.image_size_px == FlightOptions.image_size_px
    given: list[tuple[str, object]] = [
        ("--scene", scene),
        ("--seed", str(flight["seed"])),
        ("--exact-masks", bool(flight.get("exact_masks") or options.exact_masks)),
        ("--drone", None if drone == FlightOptions.drone else drone),
        ("--profile", flight.get("profile")),
        ("--vary-room", bool(flight.get("vary_room"))),
        ("--movers", flight.get("movers") or None),
        *(("--faults", fault) for fault in flight.get("faults") or ()),
        *(("--set", f"{name}={value}") for name, value in (flight.get("ports") or {}).items()),
        *(("--var", f"{name}={value}") for name, value in (flight.get("variables") or {}).items()),
        ("--image-size", None if is_default_size else "{}x{}".format(*options.image_size_px)),
        ("--time-limit", None if limit_s is None else f"{limit_s:g}"),
        ("--lab", lab_address(options.lab) if isinstance(options.lab, Lab) else None),
        ("--tree", options.tree_id),
        *(("--trees", folder) for folder in folders.trees),
        ("--include-root", folders.include_root),
        *(("--ros-pkg", f"{name}={folder}") for name, folder in folders.packages.items()),
        *(("--policy", f"{node}={name}") for node, name in options.policy_names.items()),
        *(("--leaves", file) for file in options.leaves),
        ("--out", out),
    ]
    words = ["uav-bt", "fly", tree]
    for name, value in given:
        if value is True:
            words.append(name)
        elif value is not None and value is not False:
            words += [name, str(value)]
    return shlex.join(words)
