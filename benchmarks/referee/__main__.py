"""State what changed between two installed programs, by their commands and files."""

import argparse
import json
import random
import re
import shutil
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from functools import partial
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
    parts = given.only or list(table)
    if given.action == "make" and not given.only and before.exists():
        parser.error(f"{before} exists; name a new folder")
    absent = [part for part in parts if not (before / f"{part}.jsonl").exists()]
    if given.action == "compare" and absent:
        parser.error(f"{before} lacks {', '.join(absent)}; make the whole baseline")
    with tempfile.TemporaryDirectory() as scratch:
        program = Program(given.program, Path(scratch), given.python)
        if given.action == "make" and not given.only:
            make_inputs(program, inputs, given.traces)
            with ThreadPoolExecutor(given.jobs) as pool:
                lines = [] if given.quick else TABLE["make"]
                list(pool.map(partial(program.long, inputs, folder=inputs), lines))
        found: dict[str, Any] = {}
        with ThreadPoolExecutor(given.jobs) as pool:
            for part in parts:
                lines = [one for line in table[part] for one in program.lines(line)]
                jobs = [lines] if part in TABLE["short"] else lines
                run = program.long if jobs is lines else program.short
                found[part] = [(f"{job} failed", pool.submit(run, inputs, job)) for job in jobs]
        after = before if given.action == "make" else Path(scratch)
        for part, ends in found.items():
            with (after / f"{part}.jsonl").open("w") as file:
                for name, end in ends:
                    rows = {name: repr(end.exception())} if end.exception() else end.result()
                    file.writelines(json.dumps(row) + "\n" for row in rows.items())
        return 0 if given.action == "make" else compare(before, after, parts)


def make_inputs(program: Program, folder: Path, traces: Path | None) -> None:
    """Copy tree files, write mistakes into some, and write scripts for the shipped ones."""
    shutil.copytree(program.root / "trees", folder / "trees/shipped")
    shutil.copytree(program.root / "tests/data", folder / "trees/data")
    shutil.copy(traces or folder / "trees/data/bt_traces_sample.jsonl", folder / "traces.jsonl")
    draw = random.Random(0)  # noqa: S311
    for number in range(200):
        file = draw.choice(sorted((folder / "trees/shipped").rglob("*.xml")))
        wrong, new = draw.choice(TABLE["mistakes"])
        cut = draw.randrange(len(text := file.read_text()))
        text = text[:cut] + re.sub(wrong, new, text[cut:], count=1)
        (folder / f"trees/wrong-{number}-{file.name}").write_text(text)
    nodes = list(program.short(folder, TABLE["short"]["ports"]).values())[1:]
    answers = {node["node_id"]: node["answers"] for node in nodes if not node["builtin"]}
    drawings = program.short(folder, program.lines("tree render TREE")).values()
    for tree, drawing in zip(program.trees, drawings, strict=True):
        named = sorted(set(re.findall(r"-- (\w+)", str(drawing))))
        for number in range(6):
            drawn = {one: draw.choices(answers[one], k=6) for one in named if answers.get(one)}
            leaves = {one: "".join(word[0] for word in drawn[one]) for one in drawn}
            (folder / f"{tree}-{number}.yaml").write_text(json.dumps({"leaves": leaves}))


def difference(before: Any, after: Any, path: str) -> str:
    """Return the first difference of two values, empty if there is none."""
    one, other = (dict(enumerate(x)) if isinstance(x, list) else x for x in (before, after))
    if not isinstance(one, dict) or not isinstance(other, dict):
        return "" if str(one) == str(other) else f"{path}: before {before}, after {after}"
    pairs = ((key, one.get(key, "-"), other.get(key, "-")) for key in {**one, **other})
    return next(filter(None, (difference(*two, f"{path} {key}") for key, *two in pairs)), "")


def compare(before: Path, after: Path, parts: list[str]) -> int:
    """Print what differs between two folders of answers; return 1 if anything does."""
    differs = False
    for part in parts:
        texts = [(folder / f"{part}.jsonl").read_text() for folder in (before, after)]
        one, other = (dict(map(json.loads, text.splitlines())) for text in texts)
        both = [name for name in one if name in other]
        lines = [line for name in both if (line := difference(one[name], other[name], name))]
        shown = "".join(f"\n  {line:.300}" for line in lines[:8])
        print(f"{part}: {len(lines)} of {len(both)} differ{shown}")
        for words, some, rest in (("before", one, other), ("after", other, one)):
            alone = [name for name in some if name not in rest]
            heads = [name for name in alone if name.rpartition(" ")[0] not in alone]
            print(f"  only {words}: {', '.join(heads)}\n" if heads else "", end="")
            differs |= bool(alone or lines)
    return int(differs)


if __name__ == "__main__":
    sys.exit(main())
