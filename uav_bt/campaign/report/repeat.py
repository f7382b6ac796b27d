"""The command that flies a flight of a campaign again."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping
from pathlib import PurePosixPath
from typing import Any

from uav_bt.campaign.report.sources import FlightSet
from uav_bt.tree.loading.folders import TreeFolders


def repeat_command(one: FlightSet, flight: Mapping[str, Any]) -> str:
    """Return the command line of a flight.

    Args:
        one: The flights of its tree.
        flight: Its line.
    """
    plan = one.source.plan
    words = ["uav-bt", "fly", one.tree_path()]
    if flight["scene"] is not None:
        words += ["--scene", one.scene_path(flight["scene"])]
    words += ["--seed", str(flight["seed"])]
    if flight.get("exact_masks") or (plan is not None and plan.options.exact_masks):
        words.append("--exact-masks")
    words += _changes(flight)
    if plan is not None:
        width, height = plan.options.image_size_px
        words += ["--image-size", f"{width}x{height}"]
        if plan.options.tree_id is not None:
            words += ["--tree", plan.options.tree_id]
        words += _folder_words(plan.options.tree_folders)
        for node, policy in plan.options.policy_names.items():
            words += ["--policy", f"{node}={policy}"]
        for leaves in plan.options.leaves:
            words += ["--leaves", str(leaves)]
    return shlex.join(words)


def _changes(flight: Mapping[str, Any]) -> Iterator[str]:
    """Yield the options that were drawn or changed for the flight."""
    if flight.get("drone") not in (None, "twin"):
        yield from ("--drone", str(flight["drone"]))
    if isinstance(flight.get("profile"), str):
        yield from ("--profile", flight["profile"])
    if flight.get("vary_room"):
        yield "--vary-room"
    if flight.get("movers"):
        yield from ("--movers", str(flight["movers"]))
    for fault in flight.get("faults") or ():
        yield from ("--faults", fault)
    if flight.get("folder"):
        yield from ("--out", PurePosixPath(flight["folder"]).name)
    for port, value in (flight.get("ports") or {}).items():
        yield from ("--set", f"{port}={value}")
    for variable, value in (flight.get("variables") or {}).items():
        yield from ("--var", f"{variable}={value}")


def _folder_words(folders: TreeFolders) -> list[str]:
    words = [word for folder in folders.trees for word in ("--trees", str(folder))]
    if folders.include_root is not None:
        words += ["--include-root", str(folders.include_root)]
    for name, folder in folders.packages.items():
        words += ["--ros-pkg", f"{name}={folder}"]
    return words
