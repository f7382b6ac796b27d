"""Count lines of code, docstrings, comments and tests, package by package.

    python benchmarks/source_lines.py [CHECKOUT]

Beside them what the house rules ask for: short modules, long functions, late imports, and how many
public functions with several arguments describe them.
"""

from __future__ import annotations

import argparse
import ast
import io
import subprocess
import tokenize
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

PACKAGES = ("uav_bt", "behaviours", "perception", "sim_bridge")
SHORT_MODULE = 80
LONG_FUNCTION = 50
SEVERAL = 2  # arguments that are not self or cls


def main() -> None:
    """Print a table of a checkout."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("checkout", nargs="?", type=Path, default=Path(__file__).parents[1])
    root = parser.parse_args().checkout
    print(f"{'':12}{'all':>8}{'code':>8}{'docs':>8}{'comment':>8}{'blank':>8}{'modules':>8}")
    total: Counter[str] = Counter()
    for name in (*PACKAGES, "tests", "benchmarks"):
        counts = sum((lines(path) for path in _modules(root, name)), Counter())
        if name in PACKAGES:
            total += counts
        print(f"{name:12}{row(counts)}")
    print(f"{'packages':12}{row(total)}")
    source = [path for name in PACKAGES for path in _modules(root, name)]
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in source]
    sizes = [len(path.read_text(encoding="utf-8").splitlines()) for path in source]
    late = sum(path.read_text(encoding="utf-8").count("noqa: PLC0415") for path in source)
    long = sum(length(each) > LONG_FUNCTION for tree in trees for each in functions(tree))
    documented, asked = described(trees)
    print(f"modules under {SHORT_MODULE} lines: {sum(size < SHORT_MODULE for size in sizes)}")
    print(f"functions over {LONG_FUNCTION} lines: {long}")
    print(f"late imports: {late}")
    print(
        f"public functions with {SEVERAL} arguments or more that describe them: "
        f"{documented} of {asked} ({100 * documented / asked:.0f} %)"
    )


def _modules(root: Path, name: str) -> list[Path]:
    """Return the Python files of a package that git follows."""
    listed = subprocess.run(  # noqa: S603 - git itself
        ["git", "-C", str(root), "ls-files", f"{name}/*.py"],  # noqa: S607 - as the shell finds it
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    return [root / line for line in listed.splitlines()]


def lines(path: Path) -> Counter[str]:
    """Count a module's lines by kind."""
    text = path.read_text(encoding="utf-8")
    kinds = dict.fromkeys(range(1, len(text.splitlines()) + 1), "blank")
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            kind = "comment"
        elif token.type in {tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT}:
            continue
        elif token.type == tokenize.ENDMARKER:
            break
        else:
            kind = "code"
        for number in range(token.start[0], token.end[0] + 1):
            if kinds.get(number) != "code":
                kinds[number] = kind
    for docstring in docstrings(ast.parse(text)):
        for number in range(docstring.lineno, (docstring.end_lineno or 0) + 1):
            kinds[number] = "docs"
    return Counter(kinds.values()) + Counter(all=len(kinds), modules=1)


def docstrings(tree: ast.Module) -> Iterator[ast.expr]:
    """Yield the docstrings of a module: of itself, its classes, functions and constants."""
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        for statement in body if isinstance(body, list) else ():
            value = statement.value if isinstance(statement, ast.Expr) else None
            if isinstance(value, ast.Constant) and isinstance(value.value, str):
                yield value


def functions(tree: ast.Module) -> Iterator[ast.FunctionDef]:
    """Yield all functions and methods."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            yield node


def length(function: ast.FunctionDef) -> int:
    """Return the lines of a function, its docstring left out."""
    text = ast.get_docstring(function, clean=False)
    return (function.end_lineno or 0) - function.lineno + 1 - len((text or "").splitlines())


def described(trees: list[ast.Module]) -> tuple[int, int]:
    """Return how many public functions of several arguments have `Args:`, and of how many."""
    documented = asked = 0
    for tree in trees:
        holders = [tree, *(node for node in tree.body if isinstance(node, ast.ClassDef))]
        for holder in holders:
            for function in holder.body:
                if not isinstance(function, ast.FunctionDef) or function.name.startswith("_"):
                    continue
                given = function.args
                count = len(given.posonlyargs) + len(given.args) + len(given.kwonlyargs)
                count -= isinstance(holder, ast.ClassDef)
                if count >= SEVERAL:
                    asked += 1
                    documented += "Args:" in (ast.get_docstring(function) or "")
    return documented, asked


def row(counts: Counter[str]) -> str:
    """Return a table's row."""
    kinds = ("all", "code", "docs", "comment", "blank", "modules")
    return "".join(f"{counts[kind]:8,}" for kind in kinds)


if __name__ == "__main__":
    main()
