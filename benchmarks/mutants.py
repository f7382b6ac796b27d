"""Draw small mistakes by chance and put each into a copy of the program.

    python -m benchmarks.mutants --seed 64 --out /tmp/mutants

Writes a copy of the repository for each mistake and prints what was changed: the sign of a term, a
bound, a node's answer, or a default; five on each floor. What compares two programs, such as
`benchmarks.referee`, then shows whether it notices them.
"""

from __future__ import annotations

import argparse
import ast
import random
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from benchmarks.size import ROOT, tracked

APPS = ("app", "cli", "campaign", "learning", "display", "record")
COMPOSED = tuple(f"uav_bt/{name}" for name in APPS)
FLOORS = {
    "framework": ("uav_bt",),
    "leaves": ("perception", "behaviours"),
    "composition": COMPOSED,
    "drones": ("sim_bridge",),
}
SWAPPED = {ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Lt: ("<", ">"), ast.Gt: (">", "<")}
SWAPPED |= {ast.LtE: ("<=", ">="), ast.GtE: (">=", "<=")}
ANSWERS = {"SUCCESS": "FAILURE", "FAILURE": "SUCCESS", "RUNNING": "SUCCESS"}


class Mistake(NamedTuple):
    """One change of one line."""

    kind: str
    path: Path
    row: int  # from 1
    start: int  # byte in the row
    before: str
    after: str


def mistakes_in(path: Path) -> Iterator[Mistake]:
    """Find all mistakes that can be made in a module."""
    text = (ROOT / path).read_text(encoding="utf-8")
    rows = [b"", *(row.encode() for row in text.splitlines())]
    for node in ast.walk(ast.parse(text)):
        values: list[ast.expr | None] = []
        match node:
            case (
                ast.BinOp(left=left, op=sign, right=right)
                | ast.Compare(left=left, ops=[sign, *_], comparators=[right, *_])
            ) if type(sign) in SWAPPED and left.end_lineno == right.lineno:
                before, after = SWAPPED[type(sign)]
                start = left.end_col_offset or 0
                kind = "sign" if isinstance(node, ast.BinOp) else "bound"
                at = rows[right.lineno][start : right.col_offset].find(f" {before} ".encode())
                if at >= 0:
                    yield Mistake(kind, path, right.lineno, start + at + 1, before, after)
            case ast.Return(value=ast.Name(id=name) | ast.Attribute(attr=name) as value):
                start = (value.end_col_offset or 0) - len(name)
                if name in ANSWERS:
                    yield Mistake("answer", path, node.lineno, start, name, ANSWERS[name])
            case ast.arguments():
                values = [*node.defaults, *node.kw_defaults]
            case ast.AnnAssign():
                values = [node.value]
        for each in values:
            if isinstance(each, ast.Constant) and isinstance(given := each.value, (int, float)):
                after = repr(not given) if isinstance(given, bool) else repr(1.5 * given or 1.5)
                start, row = each.col_offset, each.lineno
                before = rows[row][start : each.end_col_offset].decode()
                yield Mistake("default", path, row, start, before, after)


def draw(seed: int, count: int) -> list[Mistake]:
    """Return mistakes drawn by chance: a number on each floor, each kind as likely."""
    generator, drawn = random.Random(seed), []  # noqa: S311  (no secret)
    for floor, folders in FLOORS.items():
        kinds: dict[str, list[Mistake]] = {}
        for path in tracked(*(f"{folder}/*.py" for folder in folders)):
            if floor == "framework" and path.as_posix().startswith(COMPOSED):
                continue
            for mistake in mistakes_in(path):
                kinds.setdefault(mistake.kind, []).append(mistake)
        drawn += [generator.choice(kinds[generator.choice(sorted(kinds))]) for _ in range(count)]
    return drawn


def plant(mistake: Mistake, folder: Path) -> None:
    """Write a copy of the repository with one mistake."""
    command = ["git", "-C", str(ROOT), "checkout-index", "--all", f"--prefix={folder.resolve()}/"]
    subprocess.run(command, check=True)  # noqa: S603
    rows = (ROOT / mistake.path).read_bytes().split(b"\n")
    row, end = rows[mistake.row - 1], mistake.start + len(mistake.before)
    rows[mistake.row - 1] = row[: mistake.start] + mistake.after.encode() + row[end:]
    (folder / mistake.path).write_bytes(b"\n".join(rows))


def main() -> None:
    """Choose mistakes at random, write a copy of the program with each, and print them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=5, help="on each floor")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    for number, mistake in enumerate(draw(given.seed, given.count), start=1):
        folder = given.out / f"{number:02}"
        plant(mistake, folder)
        line = (folder / mistake.path).read_text("utf-8").splitlines()[mistake.row - 1].strip()
        print(f"{folder.name} {mistake.kind} {mistake.path}:{mistake.row}: {line}")


if __name__ == "__main__":
    main()
