"""State what changed between two installed programs, by their commands and files.

python -m benchmarks.referee make FOLDER --program EARLIER       # inputs and answers
python -m benchmarks.referee compare FOLDER --program LATER      # exit 1: something differs
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from .compare import compare, plain, write
from .inputs import make_inputs
from .parts import QUICK, WHOLE, Part
from .program import Program


def main() -> int:
    """Make a baseline, or compare a program with one."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.referee")
    parser.add_argument("action", choices=["make", "compare"])
    parser.add_argument("folder", type=Path, help="the baseline, outside the repository")
    parser.add_argument("--program", type=Path, required=True, help="root of a worktree")
    parser.add_argument("--python", default=sys.executable, help="the Python that runs it")
    parser.add_argument("--quick", action="store_true", help="only what takes a minute")
    parser.add_argument("--only", nargs="+", default=[], metavar="PART")
    parser.add_argument("--jobs", type=int, default=2, help="processes at a time")
    parser.add_argument("--traces", type=Path, help="make: traces of the engine, else a sample")
    parser.add_argument("--cases", type=Path, help="make: a folder with more tree files")
    given = parser.parse_args()
    jobs = QUICK if given.quick else QUICK + WHOLE
    jobs = [job for job in jobs if not given.only or job[0] in given.only]
    inputs, before = given.folder.resolve() / "inputs", given.folder / "answers"
    with tempfile.TemporaryDirectory() as scratch:
        program = Program(given.program, Path(scratch), given.python)
        after = before if given.action == "make" else Path(scratch, "answers")
        if given.action == "make":
            make_inputs(program, inputs, given.traces, given.cases)
        elif absent := {f"{part}.jsonl" for part, _ in jobs} - {
            one.name for one in before.glob("*")
        }:
            parser.error(f"{before} has no {', '.join(sorted(absent))}; call make for them")
        found: dict[str, dict[str, Any]] = {}
        with ThreadPoolExecutor(given.jobs) as pool:
            rows = pool.map(lambda job: answers(program, inputs, *job), jobs)
            for (part, _), some in zip(jobs, rows, strict=True):
                found.setdefault(part, {}).update(some)
        write(after, found)
        return 0 if after == before else compare(before, after, sorted(found))


def answers(program: Program, inputs: Path, part: str, run: Part) -> dict[str, Any]:
    """Return a program's answers; a failure of the part is one of them."""
    start = time.monotonic()
    try:
        rows = {row: plain(value) for row, value in run(program, inputs)}
    except (OSError, ValueError, LookupError, TypeError, subprocess.SubprocessError) as error:
        rows = {f"{part} failed": repr(error)}
    print(f"{part} {list(rows)[-1:]}: {time.monotonic() - start:.1f} s", file=sys.stderr)
    return rows


if __name__ == "__main__":
    sys.exit(main())
