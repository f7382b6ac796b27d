"""The report's table of a campaign's origin: its plan, its versions, its machine."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from uav_bt.app.drone_of_flight import draws_images
from uav_bt.app.options import FlightOptions
from uav_bt.campaign.report.sources import Provenance
from uav_bt.campaign.report.table import Table
from uav_bt.mission.judge import JudgeConfig


def origin_table(source: Provenance) -> Table:
    """Return plan, versions, commits and machines of a folder or file of flights."""
    rows: list[tuple[str, str]] = []
    plan = source.plan
    if plan is not None:
        images = draws_images(plan.options)
        last = plan.seed_from + plan.flights - 1
        for tree in plan.trees:
            values = "".join(f", {name}={text}" for name, text in tree.values.items())
            rows.append((f"tree {tree.name}", f"SHA-256 {tree.sha256}{values}"))
        rows += [(f"scene {file.name}", f"SHA-256 {file.sha256}") for file in plan.scenes]
        weights = plan.weights if images else {}  # without images no network sees
        rows += [(f"weights {name}", f"SHA-256 {digest}") for name, digest in weights.items()]
        rows += [
            (f"leaves {Path(file).name}", f"SHA-256 {digest}")
            for file, digest in plan.leaves_sha256.items()
        ]
        rows += [
            ("seeds", f"{plan.seed_from} to {last}"),
            *_flown(plan.options, images=images),
            *(("policy", f"{node}={name}") for node, name in plan.options.policy_names.items()),
            *(("port", f"{name}={value}") for name, value in plan.options.ports.items()),
            *(("variable", f"{name}={value}") for name, value in plan.options.variables.items()),
            ("time limit", _time_limit(plan.options.judge)),
            ("versions", ", ".join(f"{name} {version}" for name, version in plan.versions.items())),
        ]
    rows += [
        (f"run {run.get('began', '')}", f"{run.get('backend', '')}, code {run.get('code', '')}")
        for run in source.runs
    ]
    machines = dict.fromkeys(run.get("hardware") or "not recorded" for run in source.runs)
    rows += [("machine", name) for name in machines]
    if not rows:
        rows.append(("file", "a plain file of flights, without a plan"))
    return Table(name="origin", title=str(source.path), columns=("what", "which"), rows=tuple(rows))


def _flown(options: FlightOptions, *, images: bool) -> Iterator[tuple[str, str]]:
    """Yield drone, images, room and faults; a default of drone, room or faults has no row."""
    if options.drone != FlightOptions.drone:
        yield "drone", options.drone_name
    yield "profile", options.profile
    if images:
        yield "images", "{}x{}".format(*options.image_size_px)
        yield "masks", "exact, from the referee" if options.exact_masks else "the network's"
    if options.movers:
        yield "movers", str(options.movers)
    if options.vary_room:
        yield "room", "boxes placed and sized by the seed"
    if options.faults:
        yield "faults", ", ".join(options.faults)


def _time_limit(judge: JudgeConfig) -> str:
    limit_s = judge.time_limit_s
    return f"the mission's, or {judge.limit_s:g} s" if limit_s is None else f"{limit_s:g} s"
