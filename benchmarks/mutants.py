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

_COMPOSED = tuple(
    f"uav_bt/{n}" for n in ("app", "cli", "campaign", "learning", "display", "record")
)
FLOORS = {
    "framework": ("uav_bt",),
    "leaves": ("perception", "behaviours"),
    "composition": _COMPOSED,
    "drones": ("sim_bridge",),
}
_SWAPPED = {ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Lt: ("<", ">"), ast.Gt: (">", "<")}
_SWAPPED |= {ast.LtE: ("<=", ">="), ast.GtE: (">=", "<=")}
_ANSWERS = {"SUCCESS": "FAILURE", "FAILURE": "SUCCESS", "RUNNING": "SUCCESS"}


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
    rows = text.splitlines()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.BinOp) and type(node.op) in _SWAPPED:
            yield from _between(path, rows, node.left, node.op, node.right)
        elif isinstance(node, ast.Compare) and type(node.ops[0]) in _SWAPPED:
            yield from _between(path, rows, node.left, node.ops[0], node.comparators[0])
        elif isinstance(node, ast.Return) and isinstance(node.value, (ast.Name, ast.Attribute)):
            name = node.value.id if isinstance(node.value, ast.Name) else node.value.attr
            if name in _ANSWERS and node.value.end_col_offset is not None:
                start = node.value.end_col_offset - len(name)
                yield Mistake("answer", path, node.lineno, start, name, _ANSWERS[name])
        elif isinstance(node, ast.arguments):
            for default in (*node.defaults, *node.kw_defaults):
                yield from _default(path, rows, default)
        elif isinstance(node, ast.AnnAssign):
            yield from _default(path, rows, node.value)


def _between(
    path: Path, rows: list[str], left: ast.expr, operator: ast.AST, right: ast.expr
) -> Iterator[Mistake]:
    if left.end_lineno != right.lineno or left.end_col_offset is None:
        return
    kind = "sign" if isinstance(operator, ast.operator) else "bound"
    before, after = _SWAPPED[type(operator)]
    gap = rows[right.lineno - 1].encode()[left.end_col_offset : right.col_offset].decode()
    if f" {before} " in gap:
        start = left.end_col_offset + gap.index(f" {before} ") + 1
        yield Mistake(kind, path, right.lineno, start, before, after)


def _default(path: Path, rows: list[str], value: ast.expr | None) -> Iterator[Mistake]:
    if isinstance(value, ast.Constant) and isinstance(value.value, (bool, int, float)):
        given = value.value
        after = repr(not given) if isinstance(given, bool) else repr(1.5 * given or 1.5)
        before = rows[value.lineno - 1].encode()[value.col_offset : value.end_col_offset].decode()
        yield Mistake("default", path, value.lineno, value.col_offset, before, after)


def draw(seed: int, count: int) -> list[Mistake]:
    """Return mistakes drawn by chance: a number on each floor, each kind as likely."""
    generator, drawn = random.Random(seed), []  # noqa: S311  (no secret)
    for floor, folders in FLOORS.items():
        kinds: dict[str, list[Mistake]] = {}
        for path in tracked(*(f"{folder}/*.py" for folder in folders)):
            if floor == "framework" and path.as_posix().startswith(_COMPOSED):
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
    """Draw mistakes, write the copies and print a line for each."""
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
