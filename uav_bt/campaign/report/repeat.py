"""The command that flies a flight of a campaign."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping
from pathlib import PurePosixPath
from typing import Any

from uav_bt.app.options import FlightOptions
from uav_bt.campaign.flight_lines import file_stem, key_of
from uav_bt.campaign.report.sources import FlightSet
from uav_bt.lab.lab import Lab
from uav_bt.lab.shipped import lab_address
from uav_bt.tree.loading.lookup import TreeFolders


def repeat_command(one: FlightSet, flight: Mapping[str, Any]) -> str:
    """Return the command that flies a flight again.

    Args:
        one: The flights of its tree.
        flight: Its line.
    """
    scene = None if flight["scene"] is None else one.scene_path(flight["scene"])
    options = FlightOptions() if one.source.plan is None else one.source.plan.options
    folder = flight.get("folder")
    out = PurePosixPath(folder).name if folder else file_stem(key_of(flight))
    return fly_command(one.tree_path(), scene, flight, options, out=out)


def fly_command(
    tree: str, scene: str | None, flight: Mapping[str, Any], options: FlightOptions, *, out: str
) -> str:
    """Return the `uav-bt fly` command of a flight.

    Args:
        tree: The mission: a file or the name of a shipped one.
        scene: The scene file or the name of a shipped scene; None without one.
        flight: What was drawn or changed for the flight, by the names in a flight's line.
        options: How the campaign was flown.
        out: Its output folder. Leaves that write files need one, and have one in a campaign.
    """
    words = ["uav-bt", "fly", tree, *(() if scene is None else ("--scene", scene))]
    words += ["--seed", str(flight["seed"])]
    if flight.get("exact_masks") or options.exact_masks:
        words.append("--exact-masks")
    words += [*_changes(flight), *_shared(options), "--out", out]
    return shlex.join(words)


def _shared(options: FlightOptions) -> Iterator[str]:
    """Yield the options of a campaign that differ from the defaults."""
    if options.image_size_px != FlightOptions.image_size_px:
        yield from ("--image-size", "{}x{}".format(*options.image_size_px))
    if options.judge.time_limit_s is not None:
        yield from ("--time-limit", f"{options.judge.time_limit_s:g}")
    if isinstance(options.lab, Lab):
        yield from ("--lab", lab_address(options.lab))
    if options.tree_id is not None:
        yield from ("--tree", options.tree_id)
    yield from _folder_words(options.tree_folders)
    for node, policy in options.policy_names.items():
        yield from ("--policy", f"{node}={policy}")
    for leaves in options.leaves:
        yield from ("--leaves", str(leaves))


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
