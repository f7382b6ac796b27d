"""Lines of Python by package: all, and those with code (no comment, docstring or blank line).

python -m benchmarks.size
"""

from __future__ import annotations

import argparse
import subprocess
import tokenize
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def tracked(*patterns: str) -> list[Path]:
    """Return the files that git tracks and that exist, relative to the repository."""
    command = ["git", "-C", str(ROOT), "ls-files", "--", *patterns]
    names = subprocess.run(command, check=True, capture_output=True, text=True).stdout  # noqa: S603
    return [Path(name) for name in names.splitlines() if (ROOT / name).is_file()]


def package_of(path: Path) -> str:
    """Return the package for which a file counts: the first two folders, or the only one."""
    return "/".join(path.parts[:-1][:2])


def lines(path: Path) -> int:
    """Return the number of lines, as `wc -l` counts them."""
    return (ROOT / path).read_bytes().count(b"\n")


def code_lines(path: Path) -> int:
    """Return the number of lines with code."""
    rows, before = set[int](), tokenize.NEWLINE
    with (ROOT / path).open("rb") as file:
        for token in tokenize.tokenize(file.readline):
            if token.type in (tokenize.COMMENT, tokenize.NL, tokenize.ENCODING):
                continue
            statement = before in (tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT)
            if token.string.strip() and not (token.type == tokenize.STRING and statement):
                rows.update(range(token.start[0], token.end[0] + 1))
            before = token.type
    return len(rows)


def main() -> None:
    """Print a row for each package, and the sums outside tests and of tests."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    total, code, files = Counter[str](), Counter[str](), Counter[str]()
    for path in tracked("*.py"):
        side = "tests" if path.parts[0] == "tests" else "outside tests"
        for name in (package_of(path), f"all {side}"):
            total[name] += lines(path)
            code[name] += code_lines(path)
            files[name] += 1
    for name in sorted(total):
        print(f"{name:24}{total[name]:8}{code[name]:8}{files[name]:6}")


if __name__ == "__main__":
    main()
