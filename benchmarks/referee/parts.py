"""The parts that are no table of command lines, each as answers by name."""

from __future__ import annotations

import json
import re
import shlex
import tomllib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from .program import Program, answer

Rows = Iterable[tuple[str, Any]]
Part = Callable[[Program, Path], Rows]
EXITS = Path(__file__).with_name("exits.txt").read_text().splitlines()


def traces(program: Program, inputs: Path) -> Rows:
    """Run the engine's traces."""
    file = inputs / "traces.jsonl"
    done = program.start(program.root / "tests/conformance.py", file, cwd=program.root)
    yield "exit", done.returncode
    for count, features in re.findall(r"(?m)^ *(\d+ of +\d+)  (.*)$", done.stdout):
        yield features, count


def check(program: Program, inputs: Path) -> Rows:
    """Check the held tree files and the shipped ones."""
    held = sorted(str(path.relative_to(inputs)) for path in inputs.glob("trees/**/*.xml"))
    shipped = shipped_trees(program)
    calls = [["check", "--format", "json", *files] for files in (held, shipped)]
    for done in program.many(calls, inputs):
        for line in done.stdout.splitlines():
            found = json.loads(line)
            yield found.pop("file").replace(f"{program.root}/", "shipped "), found


def trees(program: Program, inputs: Path) -> Rows:
    """Draw the shipped trees, and run them with scripted leaves."""
    calls = [["tree", "render", tree] for tree in shipped_trees(program)]
    for script in sorted(inputs.glob("scripts/*.yaml")):
        words = ["simulate", script.stem.partition("-")[0], "--script", f"scripts/{script.name}"]
        calls.append([*words, "--format", "json", "--ticks", "60"])
    for words, done in zip(calls, program.many(calls, inputs), strict=True):
        lines = None if words[0] == "simulate" else done.stdout.splitlines()
        yield " ".join(words[:4]), {**answer(done), "lines": lines}


def commands(program: Program, inputs: Path) -> Rows:
    """Read the options and defaults of all commands from their help."""
    level: list[list[str]] = [[]]
    while level:
        calls, level = level, []
        ends = program.many([[*words, "--help"] for words in calls], inputs)
        for words, done in zip(calls, ends, strict=True):
            name = " ".join(["uav-bt", *words])
            yield name, {**answer(done), "usage": re.findall(r"uav_bt (.*)", done.stdout)[:1]}
            for option, more in re.findall(r"(?m)^ {2}(-.*)\n((?: {5,}.*\n)*)", done.stdout):
                head, _, text = option.partition("  ")
                notes = re.findall(r"\[[^a-z]*(?:default|required|x|\d)[^\]]*\]", text + more)
                yield (
                    f"{name} {head.split()[0].strip(',')}",
                    [head, " ".join(" ".join(notes).split())],
                )
            lists = re.findall(r"(?m)^[A-Z][\w ]*ommands:\n((?: +.*\n)+)", done.stdout)
            found = re.findall(r"(?m)^ {2}([a-z][\w-]*)", "".join(lists))
            level += [[*words, command] for command in found]


def exits(program: Program, inputs: Path) -> Rows:
    """Run a table of command lines for their exit codes."""
    ends = program.many([shlex.split(line) for line in EXITS], inputs / "trees")
    yield from zip(EXITS, ({**answer(done), "printed": None} for done in ends), strict=True)


def ports(program: Program, inputs: Path) -> Rows:
    """List the nodes, their ports, board keys and answers."""
    (done,) = program.many([["tree", "nodes", "--format", "json"]], inputs)
    for node in json.loads(done.stdout):
        for port in node.pop("ports"):
            yield f"{node['node_id']} {port.pop('name')}", port
        yield node.pop("node_id"), node


def shipped_trees(program: Program) -> list[str]:
    """Return the shipped missions by the names that commands take."""
    files = program.root.glob("trees/**/*.xml")
    return sorted(file.stem for file in files if file.parent.name != "lib")


def _table(lines: dict[str, dict[str, str]]) -> list[tuple[str, Part]]:
    return [
        (part, lambda program, inputs, name=name, line=line: [(name, program.files(line, inputs))])
        for part, of_part in lines.items()
        for name, line in of_part.items()
    ]


TABLE = tomllib.loads(Path(__file__).with_name("table.toml").read_text())
QUICK = [(run.__name__, run) for run in (traces, check, trees, commands, exits, ports)]
QUICK += _table(TABLE["quick"])
WHOLE = _table(TABLE.get("whole", {}))
