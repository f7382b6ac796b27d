"""`uav-bt simulate`: a dry run of a mission file with scripted leaves."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

import click
from annotated_types import Gt, Le

from uav_bt.cli.declare import command
from uav_bt.cli.shared import (
    CheckedLab,
    Count,
    FlownRegistry,
    ParameterSets,
    refuse_in_lab,
    single,
)
from uav_bt.errors import MissionError
from uav_bt.lab.shipped import load_lab
from uav_bt.option import Option
from uav_bt.tree.dry_run import SimulatedTick, Simulation, read_script
from uav_bt.tree.loading.lookup import Folders, TreeId
from uav_bt.tree.shipped import resolve_tree


@command()
def simulate(
    tree: str,
    *,
    script: Annotated[Path, Option(path="read")],
    ticks: Count = 1000,
    tick_s: Annotated[float, Gt(0), Le(3600)] = 0.1,
    format_: Annotated[Literal["table", "json"], Option(form="--format")] = "table",
    tree_id: TreeId = None,
    registry: FlownRegistry,
    tree_folders: Folders,
    parameters: ParameterSets,
    lab: CheckedLab = None,
) -> None:
    """Tick a tree file with leaves that answer by a script.

    TREE is a file, or the name of a mission that ships with uav-bt. Nothing flies: this shows which
    leaves run when, which are halted, and the values of the variables. Exits with 0 when the root
    succeeds, with 1 when it fails, is skipped or does not end.

    \b
    The script is a YAML file, such as this answers.yaml:
      leaves: {TakeOff: RRS, Explore: (RRS), Avoid: F}  # by path, name or node id
      default: S                                        # for all other leaves
      outputs: {Measure: {depth_m: 1.5}}                # when it succeeds
      variables: {laps: 3}                              # --var takes precedence
      board: {phase: explore}

    R is running, S success, F failure, K skipped. The last answer stays; those in brackets are
    given over and over.

    Options:
        script: Answers of the leaves (YAML).
        ticks: Stop after this many ticks.
        tick_s: Seconds between two ticks, for timers.
        format_: json: one object with all ticks.
    """  # noqa: D301  (click needs the backspace)
    values, path = single(parameters), resolve_tree(tree)
    if lab is not None:
        place = load_lab(lab)
        refuse_in_lab(place, registry, path, [values], tree_id=tree_id, tree_folders=tree_folders)
    simulation = Simulation(
        path,
        read_script(script),
        registry,
        tick_s=tick_s,
        tree_id=tree_id,
        lookup=tree_folders.lookup(),
        parameters=values,
    )
    steps = simulation.run(ticks)
    if format_ == "json":
        done = list(steps)
        last, root = done[-1], done[-1].status.name
        report = {"tree": tree, "status": root, "ticks": [_as_json(step) for step in done]}
        click.echo(json.dumps(report, indent=2))
    else:
        last = _print_table(steps)
        root = last.status.name
        ended = "not ended" if root == "RUNNING" else root
        ticked = "1 tick" if last.tick == 1 else f"{last.tick} ticks"
        click.echo(f"{ended} after {ticked}, {last.time_s:.2f} s")
    if root != "SUCCESS":
        raise SystemExit(MissionError.exit_code)


def _print_table(steps: Iterator[SimulatedTick]) -> SimulatedTick:
    """Print a line for each tick, and one for all those that repeat the tick before."""
    click.echo(" tick     time  root     leaves")
    shown = last = next(steps)
    click.echo(_line(shown))
    for step in steps:
        same = (step.status, step.answers) == (shown.status, shown.answers)
        if not same or step.halted or step.changed:
            _print_repeats(shown, last)
            click.echo(_line(step))
            shown = step
        last = step
    _print_repeats(shown, last)
    return last


def _print_repeats(shown: SimulatedTick, last: SimulatedTick) -> None:
    if last.tick > shown.tick:
        click.echo(f"{'...':>5}  {last.time_s:>7.2f}  the same until tick {last.tick}")


def _line(step: SimulatedTick) -> str:
    parts = [", ".join(f"{leaf} {status.letter}" for leaf, status in step.answers)]
    if step.halted:
        parts.append(f"halted {', '.join(step.halted)}")
    texts = {n: "none" if v is None else _plain(v) for n, v in step.changed.items()}
    parts.append(", ".join(f"{name}={text}" for name, text in texts.items()))
    what = "; ".join(part for part in parts if part)
    return f"{step.tick:>5}  {step.time_s:>7.2f}  {step.status.name:<7}  {what}".rstrip()


def _plain(value: Any) -> Any:
    plain = value is None or isinstance(value, (bool, int, float, str))
    return value if plain else f"<{type(value).__name__}>"


def _as_json(step: SimulatedTick) -> dict[str, Any]:
    return {
        "tick": step.tick,
        "time_s": round(step.time_s, 6),
        "status": step.status.name,
        "leaves": [{"leaf": leaf, "status": status.name} for leaf, status in step.answers],
        "halted": list(step.halted),
        "changed": {name: _plain(value) for name, value in step.changed.items()},
    }
