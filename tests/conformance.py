"""Run recorded traces of the BehaviorTree.CPP engine through ours and report, per feature set.

`python tests/conformance.py FILE` prints for each feature set how many trees agree. A tree
agrees if root status, order of leaf events and blackboard are equal in each tick. The exit code is
1 if any tree differs.

A trace file has one JSON object a line: the tree (`xml`), the variables before the first tick
(`blackboard`), variables written before tick k (`set`), ticks before which the tree is halted
(`halt`), and the reactions of the engine (`ticks`).
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    # Python puts a script's folder first on the path, where `tests/uav_bt` would hide the package.
    sys.path[0] = str(Path(__file__).resolve().parents[1])

from uav_bt.board.blackboard import Blackboard
from uav_bt.board.context import MissionContext, Proposals
from uav_bt.clock import ManualClock
from uav_bt.errors import UavBtError, UnknownNameError
from uav_bt.protocols import LeafPolicy
from uav_bt.tree import Leaf, MissionTree, NodeRegistry, Port, Status, parse_tree
from uav_bt.tree.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS

SAMPLE = Path(__file__).parent / "data" / "bt_traces_sample.jsonl"
_LETTERS = {"S": SUCCESS, "F": FAILURE, "R": RUNNING, "K": SKIPPED}
_NAMES = {SUCCESS: "SUCCESS", FAILURE: "FAILURE", RUNNING: "RUNNING", SKIPPED: "SKIPPED"}


class Scripted(Leaf):
    """Returns one letter of its script per tick, and repeats the last one."""

    answers = (SUCCESS, FAILURE, RUNNING, SKIPPED)
    ports = (Port("script", str, doc="S success, F failure, R running, K skipped"),)
    events: list[list[str]] = []  # noqa: RUF012  # shared on purpose: the order over all leaves

    _ticks = 0

    def update(self) -> Status:
        """Record the call and return the next status."""
        self.events.append(["running" if self.node_status is RUNNING else "start", self.name])
        script = self.port_value("script")
        letter = script[min(self._ticks, len(script) - 1)]
        self._ticks += 1
        return _LETTERS[letter]

    def terminate(self, new_status: Status) -> None:
        """Record a halt, except after an activation that returned SKIPPED."""
        if new_status is IDLE and self.node_status is RUNNING:
            self.events.append(["halt", self.name])


REGISTRY = NodeRegistry([Scripted])


def _no_policy(name: str) -> LeafPolicy:
    raise UnknownNameError("policy", name, ())


def _make_tree(trace: dict[str, Any]) -> MissionTree:
    tree = parse_tree(trace["xml"], REGISTRY, path=f"trace {trace['id']}")
    clock = ManualClock()
    tree.setup(
        MissionContext(
            board=Blackboard(clock, ()), clock=clock, proposals=Proposals(), policy=_no_policy
        )
    )
    for key, value in trace["blackboard"].items():
        tree.variables[key] = value
    return tree


def mismatch(trace: dict[str, Any]) -> str | None:
    """Return the first difference of our engine from a trace, None without a difference."""
    try:
        tree = _make_tree(trace)
        for index, expected in enumerate(trace["ticks"]):
            for key, value in trace["set"].get(str(index), {}).items():
                tree.variables[key] = value
            Scripted.events.clear()
            if index in trace["halt"]:
                tree.halt()
            actual = {
                "root": _NAMES[tree.tick()],
                "events": list(Scripted.events),
                "blackboard": {key: tree.variables.get(key) for key in expected["blackboard"]},
            }
            if actual != expected:
                return f"tick {index}: expected {expected}, got {actual}"
    except UavBtError as error:
        return str(error)
    return None


def read_traces(path: Path = SAMPLE) -> Iterator[dict[str, Any]]:
    """Iterate over the traces of a file."""
    with path.open(encoding="utf-8") as lines:
        for line in lines:
            if line.strip():
                yield json.loads(line)


def main(arguments: list[str]) -> int:
    """Run a trace file and print the report."""
    if len(arguments) != 1:
        sys.stderr.write("usage: python tests/conformance.py FILE\n")
        return 2
    total: Counter[str] = Counter()
    agreeing: Counter[str] = Counter()
    differing: list[str] = []
    for trace in read_traces(Path(arguments[0])):
        features = "+".join(trace["features"])
        total[features] += 1
        reason = mismatch(trace)
        if reason is None:
            agreeing[features] += 1
        else:
            differing.append(f"{trace['id']}: {reason}")
    for features in sorted(total):
        sys.stdout.write(f"{agreeing[features]:5d} of {total[features]:5d}  {features}\n")
    sys.stdout.write(f"{agreeing.total():5d} of {total.total():5d}  all\n")
    for line in differing[:20]:
        sys.stdout.write(f"  {line[:500]}\n")
    return 1 if differing else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
