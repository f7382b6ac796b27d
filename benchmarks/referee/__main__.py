"""State what changed between two installed programs, by their commands and files."""

import argparse
import csv
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

from .inputs import make_inputs
from .program import HERE, TABLE, Program, Rows, plain

Job = tuple[str, Callable[[Path], Rows]]


def main() -> int:
    """Make a baseline with the earlier program, or compare the later one with it."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.referee")
    parser.add_argument("action", choices=["make", "compare"])
    parser.add_argument("folder", type=Path, help="the baseline, outside the repository")
    parser.add_argument("--program", type=Path, required=True, help="root of a worktree")
    parser.add_argument("--quick", action="store_true", help="only what takes a minute")
    parser.add_argument("--traces", type=Path, help="make: traces of the engine, else a sample")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        program = Program(given.program.resolve(), Path(scratch), sys.executable)
        before, inputs = given.folder.resolve(), given.folder.resolve() / "inputs"
        after = before if given.action == "make" else Path(scratch)
        if given.action == "make":
            make_inputs(program, given.program, inputs, given.traces)
            for line in [] if given.quick else TABLE["make"]:
                list(program.long(inputs, line, inputs))
        found: dict[str, dict[str, Any]] = {}
        jobs = parts(program, quick=given.quick)
        with ThreadPoolExecutor(2) as pool:
            for (part, _), rows in zip(jobs, pool.map(partial(answers, inputs), jobs), strict=True):
                found.setdefault(part, {}).update(rows)
        for part, rows in found.items():
            lines = [json.dumps([name, rows[name]]) + "\n" for name in sorted(rows)]
            (after / f"{part}.jsonl").write_text("".join(lines))
        return 0 if given.action == "make" else compare(before, after, list(found))


def parts(program: Program, *, quick: bool) -> list[Job]:
    """Return the parts by name; one of long commands has an entry for each."""
    jobs: list[Job] = [] if quick else [("loopback", program.loopback)]
    for part, lines in TABLE["short"].items():
        jobs.append((part, partial(program.short, lines=program.lines(lines))))
    rows = csv.DictReader((HERE / "found_by_faults.csv").read_text().splitlines())
    slow = {**TABLE["slow"], "faults": [TABLE["fault"].format(**row) for row in rows]}
    for part, lines in {**TABLE["quick"], **({} if quick else slow)}.items():
        jobs += [(part, partial(program.long, line=line)) for line in program.lines(lines)]
    return jobs


def answers(inputs: Path, job: Job) -> dict[str, Any]:
    """Return the answers of a part by name; that it failed is one of them."""
    try:
        return {name: plain(value) for name, value in job[1](inputs)}
    except (OSError, ValueError, LookupError, TypeError, subprocess.SubprocessError) as error:
        return {"failed": repr(error)}


def difference(before: Any, after: Any, path: str) -> str:
    """Return the first difference of two values, empty if there is none."""
    one, other = (dict(enumerate(x)) if isinstance(x, list) else x for x in (before, after))
    if not isinstance(one, dict) or not isinstance(other, dict):
        return "" if str(one) == str(other) else f"{path}: before {before}, after {after}"
    keys = [key for key in {**one, **other} if key != "said"]
    found = (difference(one.get(key, "-"), other.get(key, "-"), f"{path} {key}") for key in keys)
    return next(filter(None, found), "")


def read(file: Path) -> dict[str, Any]:
    """Return the answers in a file by name; none if a part has none."""
    return dict(map(json.loads, file.read_text().splitlines())) if file.exists() else {}


def compare(before: Path, after: Path, parts_: list[str], shown: int = 8) -> int:
    """Print what differs between two folders of answers; return 1 if anything does."""
    differs = False
    for part in parts_:
        one, other = (read(folder / f"{part}.jsonl") for folder in (before, after))
        both = [name for name in one if name in other]
        lines = [line for name in both if (line := difference(one[name], other[name], name))]
        print(f"{part}: {len(lines)} of {len(both)} differ" if lines else f"{part}: equal")
        print(*(f"  {line:.300}\n" for line in lines[:shown]), sep="", end="")
        for words, some, rest in (("before", one, other), ("after", other, one)):
            alone = [name for name in some if name not in rest]
            heads = [name for name in alone if name.rpartition(" ")[0] not in alone]
            print(f"  only {words}: {', '.join(heads)}\n" if heads else "", end="")
            differs |= bool(alone or lines)
    return int(differs)


if __name__ == "__main__":
    sys.exit(main())
