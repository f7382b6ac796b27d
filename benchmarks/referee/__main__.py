"""State what changed between two installed programs, by their commands and files."""

import argparse
import json
import random
import re
import shutil
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from .program import TABLE, Program


def main() -> int:
    """Make a baseline with the earlier program, or compare the later one with it."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.referee")
    parser.add_argument("action", choices=["make", "compare"])
    parser.add_argument("folder", type=Path, help="the baseline, outside the repository")
    parser.add_argument("--program", type=Path, required=True, help="root of a worktree")
    parser.add_argument("--python", default=sys.executable, help="the Python that runs it")
    parser.add_argument("--quick", action="store_true", help="only what takes a minute")
    parser.add_argument("--only", nargs="+", metavar="PART", help="only these parts")
    parser.add_argument("--jobs", type=int, default=2, help="processes at a time")
    parser.add_argument("--traces", type=Path, help="make: traces of the engine, else a sample")
    given = parser.parse_args()
    before, inputs = given.folder.resolve(), given.folder.resolve() / "inputs"
    table = {**TABLE["short"], **TABLE["long"], **({} if given.quick else TABLE["slow"])}
    with tempfile.TemporaryDirectory() as scratch:
        program = Program(given.program, Path(scratch), given.python)
        if given.action == "make" and not given.only:
            make_inputs(program, inputs, given.traces)
            for line in [] if given.quick else TABLE["make"]:
                list(program.long(inputs, line, inputs))
        jobs: list[tuple[str, Any]] = []
        for part in given.only or table:
            lines = [one for line in table[part] for one in program.lines(line)]
            jobs += [(part, lines)] if part in TABLE["short"] else [(part, one) for one in lines]
        with ThreadPoolExecutor(given.jobs) as pool:
            answers = list(pool.map(lambda job: program.answers(inputs, job[1]), jobs))
        after = before if given.action == "make" else Path(scratch)
        for part in given.only or table:
            found = [rows for (of, _), rows in zip(jobs, answers, strict=True) if of == part]
            lines = [json.dumps(row) + "\n" for rows in found for row in rows.items()]
            (after / f"{part}.jsonl").write_text("".join(lines))
        return 0 if given.action == "make" else compare(before, after, given.only or list(table))


def make_inputs(program: Program, folder: Path, traces: Path | None) -> None:
    """Copy tree files, write mistakes into some, and write scripts for the shipped ones."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(program.root / "trees", folder / "trees/shipped")
    shutil.copytree(program.root / "tests/data", folder / "trees/data")
    shutil.copy(traces or folder / "trees/data/bt_traces_sample.jsonl", folder / "traces.jsonl")
    draw = random.Random(0)  # noqa: S311
    files = sorted((folder / "trees/shipped").rglob("*.xml"))
    for number in range(200):
        text = (file := draw.choice(files)).read_text()
        wrong, new = draw.choice(TABLE["mistakes"])
        cut = draw.randrange(len(text))
        text = text[:cut] + re.sub(wrong, new, text[cut:], count=1)
        (folder / f"trees/wrong-{number}-{file.name}").write_text(text)
    nodes = [node for _, node in program.short(folder, TABLE["short"]["ports"])][1:]
    answers = {node["node_id"]: node["answers"] for node in nodes if not node["builtin"]}
    drawings = program.short(folder, program.lines("tree render TREE"))
    for tree, (_, drawing) in zip(program.trees, drawings, strict=True):
        named = sorted(set(re.findall(r"-- (\w+)", str(drawing))))
        for number in range(6):
            drawn = {one: draw.choices(answers[one], k=6) for one in named if answers.get(one)}
            leaves = {one: "".join(word[0] for word in drawn[one]) for one in drawn}
            script = {"leaves": leaves, "default": "S"}
            (folder / f"{tree}-{number}.yaml").write_text(json.dumps(script))


def difference(before: Any, after: Any, path: str) -> str:
    """Return the first difference of two values, empty if there is none."""
    one, other = (dict(enumerate(x)) if isinstance(x, list) else x for x in (before, after))
    if not isinstance(one, dict) or not isinstance(other, dict):
        return "" if str(one) == str(other) else f"{path}: before {before}, after {after}"
    keys = [key for key in {**one, **other} if key != "said"]
    found = (difference(one.get(key, "-"), other.get(key, "-"), f"{path} {key}") for key in keys)
    return next(filter(None, found), "")


def compare(before: Path, after: Path, parts: list[str]) -> int:
    """Print what differs between two folders of answers; return 1 if anything does."""
    differs = False
    for part in parts:
        texts = [(folder / f"{part}.jsonl").read_text() for folder in (before, after)]
        one, other = (dict(map(json.loads, text.splitlines())) for text in texts)
        both = [name for name in one if name in other]
        lines = [line for name in both if (line := difference(one[name], other[name], name))]
        print(f"{part}:", f"{len(lines)} of {len(both)} differ" if lines else f"equal, {len(both)}")
        print(*(f"  {line:.300}\n" for line in lines[:8]), sep="", end="")
        for words, some, rest in (("before", one, other), ("after", other, one)):
            alone = [name for name in some if name not in rest]
            heads = [name for name in alone if name.rpartition(" ")[0] not in alone]
            print(f"  only {words}: {', '.join(heads)}\n" if heads else "", end="")
            differs |= bool(alone or lines)
    return int(differs)


if __name__ == "__main__":
    sys.exit(main())
